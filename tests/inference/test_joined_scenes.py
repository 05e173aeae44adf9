"""Scenes of one group as one unit, for statistics that know nothing of groups."""

import polars as pl

from tracknoise.inference.units import JoinedScenes, Resampled, SceneGroups

SCENES = [f"s{number:02}" for number in range(14)]
PAIRS = SceneGroups({("d", scene): f"place-{number // 2}" for number, scene in enumerate(SCENES)})


def test_scenes_of_enough_groups_get_the_name_of_their_group() -> None:
    joined = JoinedScenes.of({"d": SCENES}, PAIRS)
    found = joined.rename(pl.DataFrame({"scene": ["s00", "s01", "s02"]}), "d")["scene"].to_list()
    assert found[0] == found[1] != found[2]
    assert len(joined.scenes({"d": SCENES})["d"]) == 7
    assert joined.resampled(Resampled.scenes, "d", ["group 0", "group 1"]) == Resampled.groups


def test_scenes_of_few_groups_and_of_other_datasets_keep_their_names() -> None:
    few = SceneGroups({("d", scene): f"place-{number % 3}" for number, scene in enumerate(SCENES)})
    table = pl.DataFrame({"scene": SCENES})
    apart = JoinedScenes.of({"d": SCENES}, few)
    assert apart.rename(table, "d").equals(table)
    assert apart.resampled(Resampled.scenes, "d", SCENES) == Resampled.within
    joined = JoinedScenes.of({"d": SCENES}, PAIRS)
    assert joined.rename(table, "other").equals(table)
    assert joined.resampled(Resampled.blocks, "d", SCENES) == Resampled.blocks
