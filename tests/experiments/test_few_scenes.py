"""In which conditions blocks of tracks are resampled: where scenes with what is pooled are too few."""

import polars as pl

from tracknoise.analysis.run_inputs import conditions_of_few_scenes, has_errors
from tracknoise.analysis.time_structure import lagged
from tracknoise.inference.units import NO_GROUPS, SceneGroups
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import by_condition
from tracknoise.tables.schema import INCREMENTS, ORIGIN


def rows(*, tracker: str, scenes: range, **more: object) -> pl.DataFrame:
    view = {"dataset": "d", "lighting": "day", "rotation": 0, "direction": "forward", "camera": ""}
    names = [f"s{place}" for place in scenes]
    table = pl.DataFrame({"scene": names}).with_columns(
        pl.lit(value).alias(name) for name, value in {**view, "tracker": tracker, "speed": 1, **more}.items()
    )
    return table.select(*(pl.col(name).cast(kind) for name, kind in ORIGIN.items()), *more)


def measured(*, seen: range, tracked: range, frames: range, tracker: str = "lk") -> list[pl.DataFrame]:
    errors = [rows(tracker=tracker, scenes=seen, population="visible", n=5)]
    without = rows(tracker=tracker, scenes=frames, population="visible", n=0)
    of = {"frames": frames, "ends": tracked}
    return [*(rows(tracker=tracker, scenes=scenes) for scenes in of.values()), pl.concat([*errors, without])]


def few(*conditions: list[pl.DataFrame], groups: SceneGroups = NO_GROUPS) -> list[str]:
    frames, ends, moments = (pl.concat(tables) for tables in zip(*conditions, strict=True))
    errors = moments.filter(has_errors("visible"))
    tables = (by_condition(table, table.schema, "table") for table in (errors, ends, frames))
    found = conditions_of_few_scenes(*tables, groups)
    assert found.columns == POOLED
    return sorted(found["tracker"])


def test_scenes_without_features_or_without_errors_do_not_count() -> None:
    six, five = range(6), range(5)
    assert few(measured(seen=six, tracked=six, frames=six)) == []
    assert few(measured(seen=five, tracked=five, frames=six)) == ["lk"]
    assert few(measured(seen=five, tracked=six, frames=six)) == ["lk"]
    assert few(measured(seen=five, tracked=five, frames=five)) == ["lk"]


def test_a_tracker_that_is_missing_in_scenes_has_few_of_its_own() -> None:
    every = measured(seen=range(8), tracked=range(8), frames=range(8))
    some = measured(seen=range(4), tracked=range(4), frames=range(4), tracker="imported")
    assert few(every, some) == ["imported"]
    four = SceneGroups({("d", f"s{place}"): str(place % 4) for place in range(8)})
    assert few(measured(seen=range(6), tracked=range(6), frames=range(6)), groups=four) == ["lk"]
    assert few(every, some, groups=four) == ["imported"]


def test_changes_of_a_tracker_of_few_scenes_keep_their_blocks_beside_another_of_many() -> None:
    pairs = [rows(tracker=name, scenes=scenes, block=3) for name, scenes in (("lk", range(8)), ("some", range(4)))]
    constant = {name: pl.lit(1).cast(kind).alias(name) for name, kind in INCREMENTS.items() if kind.is_numeric()}
    columns = {name: pl.lit(None).cast(kind).alias(name) for name, kind in INCREMENTS.items()} | constant
    changes = pl.concat(pairs).with_columns(block=pl.col("block").cast(pl.UInt8))
    made = changes.select(pl.col(name) if name in changes.columns else columns[name] for name in INCREMENTS)
    of_some = rows(tracker="some", scenes=range(1)).select(POOLED)
    found = lagged(made, of_some)
    assert found.filter(tracker="some")["block"].unique().to_list() == [3]
    assert found.filter(tracker="lk")["block"].unique().to_list() == [0]
