"""Effects of factors, from curves and counts small enough to work them out by hand."""

from collections.abc import Mapping

import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.statistics.yardstick import FACTORS, ReferenceCondition, effects
from tracknoise.tables.findings_schema import CURVES, EFFECTS, LIFETIMES, OUTLIERS
from tracknoise.tables.schema import empty

CONDITION = {
    "dataset": "d",
    "lighting": "day",
    "rotation": 0,
    "direction": "forward",
    "camera": "",
    "tracker": "lk",
    "speed": 1,
}
POINT = {
    "population": "visible", "trimming": "untrimmed", "weighting": "features", "statistic": "eta", "axis": "age",
    "n": 500, "n_scenes": 3, "unit": "px", "uv": None, "cut": False,
}  # fmt: skip
REFERENCE = ReferenceCondition("day")


def curve(values: Mapping[int, float], *, v: float = 0.0, **condition: object) -> pl.DataFrame:
    """A curve in u by its places; in v it is the constant."""
    rows = [CONDITION | POINT | condition | {"at": at, "u": u, "v": v} for at, u in values.items()]
    return pl.DataFrame(rows, schema=dict(CURVES))


def lived(lifetime: int, **condition: object) -> pl.DataFrame:
    """Lifetimes of tracks that all live as long."""
    row = {"lifetime": lifetime, "n_ended": 5, "n_censored": 0, "at_risk": 5, "survival": 0.0, "n_scenes": 1}
    return pl.DataFrame([CONDITION | row | condition], schema=dict(LIFETIMES))


def rejected(ratio: float | None, **condition: object) -> pl.DataFrame:
    row = dict.fromkeys(OUTLIERS) | CONDITION | {"pooled_ratio": ratio} | condition
    return pl.DataFrame([row], schema=dict(OUTLIERS))


def found(curves: list[pl.DataFrame], *others: pl.DataFrame, **options: object) -> pl.DataFrame:
    lifetimes = [table for table in others if "lifetime" in table.columns]
    outliers = [table for table in others if "pooled_ratio" in table.columns]
    return effects(
        pl.concat([empty(CURVES), *curves]),
        pl.concat([empty(LIFETIMES), *lifetimes]),
        pl.concat([empty(OUTLIERS), *outliers]),
        **{"reference": REFERENCE, **options},
    )


def effect(*args: object, factor: str = "speed", statistic: str = "eta", **options: object) -> dict[str, object]:
    (row,) = found(*args, **options).filter(factor=factor, statistic=statistic).to_dicts()
    return row


SLOW = curve({0: 0.0, 1: 1.0, 2: 2.0, 4: 4.0})
FAST = curve({0: 0.0, 2: 2.5, 4: 5.0}, speed=2)


def test_two_speeds_by_hand() -> None:
    # at ages 2 and 4 apart by 0.5 and 1; the curve between them rises from 0 to 4.5
    row = effect([SLOW, FAST])
    assert (row["level_a"], row["level_b"], row["coordinate"], row["at"]) == ("1", "2", "u", 4)
    assert (row["difference"], row["common"], row["effect"]) == (1.0, 4.5, pytest.approx(1 / 4.5))
    assert (row["n_levels"], row["n_pairs"], row["n_shared"], row["verdict"], row["why"]) == (2, 1, 2, "yes", None)
    assert (row["tracker"], row["speed"], row["unit"], row["axis"]) == ("lk", None, "px", "age")


def test_the_verdict_turns_at_the_margin() -> None:
    assert effect([SLOW, FAST], margin=0.2)["verdict"] == "yes"
    assert effect([SLOW, FAST], margin=1 / 4.5)["verdict"] == "no"
    assert effect([SLOW, FAST], margin=0.3)["verdict"] == "no"


def test_the_larger_of_the_two_coordinates_decides() -> None:
    row = effect([curve({1: 1.0}, v=1.0), curve({1: 1.0}, v=2.0, speed=2)])
    assert (row["coordinate"], row["effect"]) == ("v", pytest.approx(1 / 1.5))


def test_of_several_speeds_the_worst_pair_decides_and_pairs_apart_are_left_out() -> None:
    curves = [curve({2: 2.0, 3: 3.0}), curve({2: 2.0, 4: 4.0}, speed=2), curve({3: 6.0}, speed=3)]
    row = effect(curves)
    assert (row["level_a"], row["level_b"], row["at"], row["effect"]) == ("1", "3", 3, pytest.approx(3 / 4.5))
    assert (row["n_levels"], row["n_pairs"], row["n_shared"]) == (3, 2, 1)


def test_no_is_not_said_of_a_level_that_could_not_be_compared() -> None:
    same = [curve({2: 2.0, 3: 3.0}), curve({2: 2.0}, speed=2), curve({5: 5.0}, speed=5)]
    row = effect(same)
    assert (row["effect"], row["verdict"]) == (0.0, "undecided")
    assert row["why"] == "nothing to compare speed 5 by"
    assert effect(same[:2])["verdict"] == "no"
    assert effect([*same[1:], curve({2: 9.0})])["verdict"] == "yes"  # one difference is enough for a yes


def test_levels_that_share_nothing_are_undecided() -> None:
    row = effect([curve({2: 2.0}, speed=2), curve({3: 2.0}, speed=3)])
    assert (row["verdict"], row["why"], row["effect"], row["n_pairs"]) == (
        "undecided", "no two levels have a point in common", None, 0,
    )  # fmt: skip


def test_one_level_alone_is_undecided() -> None:
    row = effect([SLOW])
    assert (row["verdict"], row["why"], row["n_levels"]) == ("undecided", "only one speed was measured: 1", 1)


def test_what_is_zero_by_construction_is_not_compared() -> None:
    assert effect([curve({0: 0.0}), curve({0: 0.0}, speed=2)])["verdict"] == "undecided"
    names = {"axis": "frame", "statistic": "kappa"}
    curves = [curve({23: 1.0, 24: 0.0, 25: 1.0}, **names), curve({24: 0.0, 25: 3.0}, speed=2, **names)]
    row = effect(curves, statistic="kappa", reference=ReferenceCondition("day", key_frames={"forward": 24}))
    assert (row["at"], row["n_shared"], row["effect"]) == (1, 1, 1.0)


def test_frames_played_backward_are_compared_at_the_same_distance_from_the_key_frame() -> None:
    names = {"axis": "frame", "statistic": "kappa"}
    curves = [curve({26: 1.0, 28: 2.0}, **names), curve({7: 1.0, 9: 2.0}, direction="backward", **names)]
    reference = ReferenceCondition("day", key_frames={"forward": 24, "backward": 5})
    row = effect(curves, factor="direction", statistic="kappa", reference=reference)
    assert (row["effect"], row["n_shared"]) == (0.0, 2)


@pytest.mark.parametrize(
    "other",
    [{"population": "projected"}, {"trimming": "trimmed"}, {"weighting": "scenes"}, {"cut": True}],
    ids=lambda other: next(iter(other)),
)
def test_only_the_experiments_own_curves_count(other: dict[str, object]) -> None:
    assert effect([SLOW, FAST, curve({1: 99.0}, speed=3, **other)])["level_b"] == "2"


def test_the_trimmed_curves_are_compared_where_the_experiment_says_so() -> None:
    trimmed = [curve({1: value}, speed=speed, trimming="trimmed") for speed, value in ((1, 1.0), (2, 3.0))]
    assert effect([SLOW, FAST, *trimmed], trimming="trimmed")["effect"] == pytest.approx(1.0)


def test_turned_images_are_compared_upright() -> None:
    mean = {"statistic": "nu"}
    upright = curve({1: 1.0}, v=2.0, **mean)
    row = effect([upright, curve({1: 2.0}, v=-1.0, rotation=90, **mean)], factor="rotation", statistic="nu")
    assert (row["effect"], row["verdict"]) == (0.0, "no")
    row = effect([upright, curve({1: 1.0}, v=2.0, rotation=90, **mean)], factor="rotation", statistic="nu")
    assert row["verdict"] == "yes"


def test_other_factors_are_held_where_the_reference_says() -> None:
    day = [SLOW, FAST]
    night = [curve({1: 1.0, 2: 2.0, 4: 4.0}, lighting="night"), curve({2: 90.0}, lighting="night", speed=2)]
    assert effect(day + night)["difference"] == 1.0
    assert effect(day + night, reference=ReferenceCondition("night"))["difference"] == 88.0
    rows = found(day + night).filter(factor="lighting", statistic="eta")
    assert rows.select("lighting", "tracker", "speed", "difference").rows() == [
        (None, "lk", 1, 0.0),
        (None, "lk", 2, 87.5),
    ]


def test_each_tracker_has_its_own_effect_of_speed() -> None:
    sift = [curve({2: 1.0}, tracker="sift"), curve({2: 1.0}, tracker="sift", speed=2)]
    rows = found([SLOW, FAST, *sift]).filter(factor="speed", statistic="eta")
    assert rows.select("tracker", "verdict").rows() == [("lk", "yes"), ("sift", "no")]
    row = effect([SLOW, FAST, *sift], factor="tracker")
    assert (row["level_a"], row["level_b"], row["speed"], row["tracker"]) == ("lk", "sift", 1, None)


def test_a_difference_in_bias_is_also_given_beside_the_size_of_errors() -> None:
    # biases 0.01 and 0.03 differ by all that varies, but by 1 % of an error of 2 px
    curves = [curve({1: 0.01}, statistic="nu"), curve({1: 0.03}, statistic="nu", speed=2)]
    sizes = [curve({1: 2.0}), curve({1: 2.0}, speed=2)]
    row = effect([*curves, *sizes], statistic="nu")
    assert (row["effect"], row["verdict"]) == (pytest.approx(1.0), "yes")
    assert row["share_of_absolute"] == pytest.approx(0.01)
    assert effect([*curves, *sizes])["share_of_absolute"] is None


def test_numbers_without_a_curve_are_compared_by_their_range_over_their_mean() -> None:
    tables = [lived(4), lived(6, speed=2), lived(8, speed=3), rejected(0.1), rejected(None, speed=2)]
    row = effect([], *tables, statistic="lifetime")
    assert (row["difference"], row["common"], row["effect"], row["verdict"]) == (4.0, 6.0, pytest.approx(2 / 3), "yes")
    assert (row["level_a"], row["level_b"], row["at"], row["unit"], row["n_pairs"]) == ("1", "3", None, "frames", 3)
    row = effect([], *tables, statistic="outlier_ratio")
    assert (row["verdict"], row["effect"]) == ("undecided", None)
    assert effect([], rejected(0.0), rejected(0.0, speed=2), statistic="outlier_ratio")["verdict"] == "no"


def test_a_number_that_one_level_lacks_is_no_reason_for_a_no() -> None:
    row = effect([], lived(4), lived(4, speed=2), rejected(0.1, speed=3), statistic="lifetime")
    assert (row["verdict"], row["why"]) == ("undecided", "nothing to compare speed 3 by")


def test_every_factor_is_asked_about_every_statistic() -> None:
    table = found([SLOW, FAST], lived(4))
    assert table.schema == pl.Schema(dict(EFFECTS))
    assert table["factor"].unique(maintain_order=True).to_list() == list(FACTORS)
    expected = ["nu", "eta", "Phi", "central", "lifetime", "outlier_ratio"]
    assert table.filter(factor="speed")["statistic"].to_list() == expected


def test_nothing_gives_nothing() -> None:
    assert found([]).equals(empty(EFFECTS))


def test_the_wrong_tables_are_refused() -> None:
    for tables in ([LIFETIMES, LIFETIMES, OUTLIERS], [CURVES, CURVES, OUTLIERS], [CURVES, LIFETIMES, CURVES]):
        with pytest.raises(SchemaError):
            effects(*map(empty, tables), reference=REFERENCE)
