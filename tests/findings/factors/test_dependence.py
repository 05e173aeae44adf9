"""Intervals and verdicts of effects, from scenes that scatter as wished."""

from collections.abc import Mapping

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.findings.factors.dependence import dependence
from tracknoise.statistics.curves import curves
from tracknoise.statistics.effects import effects
from tracknoise.statistics.factors import ReferenceCondition
from tracknoise.statistics.lifetimes import lifetimes_of_ends
from tracknoise.statistics.outliers import outlier_ratios
from tracknoise.tables.findings_schema import DEPENDENCE
from tracknoise.tables.schema import CURVES, EFFECTS, ENDS, FRAME_COUNTS, LIFETIMES, MOMENTS, TRACKS, empty

CONDITION = {
    "dataset": "d",
    "lighting": "day",
    "rotation": 0,
    "direction": "forward",
    "camera": "",
    "tracker": "lk",
    "speed": 1,
}
REFERENCE = ReferenceCondition("day")
AGES = 5
TRACKS_OF_A_SCENE = 400


def moments(
    levels: Mapping[int, float], *, scenes: int = 12, own: float = 0.02, seed: int = 0, **condition: object
) -> pl.DataFrame:
    """Scenes whose errors scatter, at each speed, by its factor times what the scene and the age have at all speeds.

    `own` is the standard deviation of what a scene has of its own at each speed.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for scene in range(scenes):
        of_scene = rng.uniform(0.7, 1.3)
        for speed, factor in levels.items():
            size = of_scene * factor * (1 + own * rng.standard_normal())
            for age in range(AGES + 1):
                scale = size * np.sqrt(age)
                values = {
                    "scene": f"s{scene:02}", "speed": speed, "at": age, "n": TRACKS_OF_A_SCENE,
                    "mean_u": 0.3 * scale, "mean_v": -0.2 * scale, "mean_abs_u": 0.8 * scale, "mean_abs_v": scale,
                    "m_uu": TRACKS_OF_A_SCENE * scale**2, "m_vv": 2 * TRACKS_OF_A_SCENE * scale**2,
                }  # fmt: skip
                rows.append(dict.fromkeys(MOMENTS, 0.0) | CONDITION | values | condition)
    kinds = {"population": "visible", "trimming": "trimmed", "axis": "age"}
    return pl.DataFrame([row | kinds for row in rows], schema=dict(MOMENTS))


def asked(
    table: pl.DataFrame, ends: pl.DataFrame | None = None, frames: pl.DataFrame | None = None, **options: object
) -> pl.DataFrame:
    """What `dependence` says after `curves` and `effects`."""
    ends = empty(ENDS) if ends is None else ends
    frames = empty(FRAME_COUNTS) if frames is None else frames
    bent = curves(table)
    lived = lifetimes_of_ends(ends)
    point = effects(bent, lived, outlier_ratios(frames), reference=REFERENCE)
    return dependence(table, ends, frames, bent, point, n_draws=400, **options)


def answer(*args: object, statistic: str = "eta", factor: str = "speed", **options: object) -> dict[str, object]:
    (row,) = asked(*args, **options).filter(factor=factor, statistic=statistic).to_dicts()
    return row


def test_a_large_effect_is_said_to_matter() -> None:
    row = answer(moments({1: 1.0, 2: 1.5}))
    assert (row["verdict"], row["why"]) == ("yes", None)
    assert row["margin"] < row["low"] < row["effect"] < row["high"]
    assert row["p_yes"] <= row["q_yes"] <= 0.05 < row["p_no"]
    assert (row["n_scenes"], row["n_places"], row["at_low"], row["at_high"], row["level"]) == (12, 5, 1, 5, 0.95)
    assert row["kind"] == "fieller"


def test_what_scenes_share_cancels_between_levels() -> None:
    # scenes differ by 30 %, but what each has of its own at a level is 2 %
    row = answer(moments({1: 1.0, 2: 1.0}))
    assert (row["verdict"], row["low"], row["why"]) == ("no", 0.0, None)
    assert row["effect"] < row["high"] < 0.05
    assert row["p_no"] <= row["q_no"] <= 0.05 < row["p_yes"]


def test_where_scenes_scatter_too_much_it_is_undecided() -> None:
    row = answer(moments({1: 1.0, 2: 1.0}, own=0.3))
    assert (row["verdict"], row["why"]) == ("undecided", "the interval contains the margin")
    assert row["low"] <= row["margin"] <= row["high"]


def test_one_bad_level_of_many_is_found() -> None:
    assert answer(moments({1: 1.0, 2: 1.0, 4: 1.0, 8: 1.4}))["verdict"] == "yes"
    assert answer(moments({1: 1.0, 2: 1.0, 4: 1.0, 8: 1.0}))["verdict"] == "no"


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_with_few_scenes_nothing_is_decided(factor: float) -> None:
    row = answer(moments({1: 1.0, 2: factor}, scenes=5))
    assert (row["verdict"], row["why"]) == ("undecided", "two levels share only 5 scenes; at least 6 are needed")
    assert (row["low"], row["high"], row["p_yes"], row["q_yes"], row["p_no"]) == (None,) * 5
    assert row["effect"] is not None


def test_scenes_that_one_level_lacks_do_not_count() -> None:
    table = moments({1: 1.0, 2: 1.5})
    row = answer(table.filter((pl.col("speed") == 1) | (pl.col("scene") < "s07")))
    assert (row["n_scenes"], row["verdict"]) == (7, "yes")
    row = answer(table.filter((pl.col("speed") == 1) | (pl.col("scene") < "s05")))
    assert (row["n_scenes"], row["verdict"]) == (5, "undecided")


def test_ages_that_few_scenes_reach_are_left_out() -> None:
    table = moments({1: 1.0, 2: 1.5}).filter((pl.col("at") < 5) | (pl.col("scene") < "s05"))
    row = answer(table)
    assert (row["n_scenes"], row["n_places"], row["at_low"], row["at_high"]) == (12, 4, 1, 4)


def test_a_no_needs_every_level() -> None:
    table = moments({1: 1.0, 2: 1.0, 4: 1.0})
    few = (pl.col("speed") != 4) | (pl.col("scene") < "s03")
    row = answer(table.filter(few))
    assert (row["verdict"], row["why"]) == ("undecided", "two levels share only 3 scenes; at least 6 are needed")
    row = answer(table.filter((pl.col("speed") != 4) | (pl.col("at") == 0)))
    assert (row["verdict"], row["why"]) == ("undecided", "nothing to compare speed 4 by")


def test_what_the_interval_cannot_use_cannot_make_a_no() -> None:
    # the levels differ at an age that only three scenes reach
    late = (pl.col("speed") == 2) & (pl.col("at") == 5)
    table = moments({1: 1.0, 2: 1.0}).with_columns(mean_abs_u=pl.when(late).then(9.0).otherwise("mean_abs_u"))
    row = answer(table.filter((pl.col("at") < 5) | (pl.col("scene") < "s03")))
    assert row["verdict"] == "undecided"
    assert row["high"] >= row["effect"] > row["margin"]


def test_scenes_that_are_all_alike() -> None:
    table = moments({1: 1.0, 2: 1.2}, scenes=1)
    alike = pl.concat([table.with_columns(scene=pl.lit(f"s{number}")) for number in range(8)])
    row = answer(alike)
    assert row["verdict"] == "yes"
    assert (row["low"], row["high"]) == (pytest.approx(row["effect"]), pytest.approx(row["effect"]))
    same = pl.concat([alike.filter(speed=1), alike.filter(speed=1).with_columns(speed=pl.lit(2, dtype=pl.Int32))])
    row = answer(same)
    assert (row["effect"], row["low"], row["high"], row["verdict"]) == (0.0, 0.0, 0.0, "no")


def test_where_nothing_is_biased_a_difference_in_bias_has_no_upper_bound() -> None:
    rng = np.random.default_rng(3)
    table = moments({1: 1.0, 2: 1.0})
    noise = table.with_columns(pl.Series(name, rng.standard_normal(table.height)) for name in ("mean_u", "mean_v"))
    row = answer(noise, statistic="nu")
    assert (row["verdict"], row["low"], row["high"]) == ("undecided", 0.0, float("inf"))


def test_turned_images_are_compared_upright() -> None:
    table = moments({1: 1.0})
    names = {"mean_abs_u": "mean_abs_v", "mean_abs_v": "mean_abs_u", "m_uu": "m_vv", "m_vv": "m_uu"}
    turned = table.rename(names).select(*MOMENTS).with_columns(
        mean_u=table["mean_v"], mean_v=-table["mean_u"], rotation=pl.lit(90, dtype=pl.Int16)
    )  # fmt: skip
    for statistic in ("nu", "eta", "Phi"):
        row = answer(pl.concat([table, turned]), factor="rotation", statistic=statistic)
        assert (row["verdict"], row["effect"]) == ("no", pytest.approx(0.0, abs=1e-12))


def ends_of(levels: Mapping[int, float], *, scenes: int = 10) -> pl.DataFrame:
    rng = np.random.default_rng(0)
    rows = [
        CONDITION | {"scene": f"s{scene}", "speed": speed, "block": block, "n_ended": 100, "n_censored": 5}
        | {"lifetime": round(base * factor * rng.uniform(0.98, 1.02))}
        for scene, base in enumerate(rng.integers(700, 1300, scenes))
        for speed, factor in levels.items()
        for block in range(2)
    ]  # fmt: skip
    return pl.DataFrame(rows, schema=dict(ENDS))


def frames_of(levels: Mapping[int, int], *, scenes: int = 10) -> pl.DataFrame:
    rng = np.random.default_rng(0)
    rows = [
        dict.fromkeys(FRAME_COUNTS, 0) | CONDITION | {"scene": f"s{scene}", "speed": speed, "frame": frame}
        | {"offered": 10_000, "outliers": round(outliers * base * rng.uniform(0.97, 1.03))}
        for scene, base in enumerate(rng.uniform(0.5, 2.0, scenes))
        for speed, outliers in levels.items()
        for frame in range(3)
    ]  # fmt: skip
    return pl.DataFrame(rows, schema=dict(FRAME_COUNTS))


@pytest.mark.parametrize(("factor", "verdict"), [(1.0, "no"), (1.3, "yes")])
def test_lifetimes(factor: float, verdict: str) -> None:
    row = answer(empty(MOMENTS), ends_of({1: 1.0, 2: factor, 4: 1.0}), statistic="lifetime")
    assert (row["verdict"], row["n_scenes"], row["at_low"], row["axis"]) == (verdict, 10, None, None)
    assert row["low"] <= row["effect"] <= row["high"]
    assert row["effect"] == pytest.approx((factor - 1) / ((factor + 2) / 3), abs=0.02)


@pytest.mark.parametrize(("outliers", "verdict"), [(500, "no"), (800, "yes")])
def test_outlier_ratios(outliers: int, verdict: str) -> None:
    row = answer(empty(MOMENTS), None, frames_of({1: 500, 2: outliers}), statistic="outlier_ratio")
    assert (row["verdict"], row["n_scenes"]) == (verdict, 10)
    assert row["low"] <= row["effect"] <= row["high"]


def test_outliers_that_never_were_decide_nothing() -> None:
    row = answer(empty(MOMENTS), None, frames_of({1: 0, 2: 0}), statistic="outlier_ratio")
    assert (row["effect"], row["verdict"], row["high"]) == (0.0, "undecided", float("inf"))


def test_more_questions_make_a_weak_answer_weaker() -> None:
    weak = moments({1: 1.0, 2: 1.16}, own=0.04)
    alone = answer(weak)
    others = [moments({1: 1.0, 2: 1.0}, own=0.5, seed=number, tracker=f"t{number}") for number in range(1, 8)]
    among = asked(pl.concat([weak, *others])).filter(factor="speed", statistic="eta", tracker="lk").to_dicts()[0]
    assert among["q_yes"] > alone["q_yes"]


def test_the_rows_are_those_of_the_effects() -> None:
    table = moments({1: 1.0, 2: 1.2})
    bent = curves(table)
    point = effects(bent, empty(LIFETIMES), outlier_ratios(empty(FRAME_COUNTS)), reference=REFERENCE)
    found = dependence(table, empty(ENDS), empty(FRAME_COUNTS), bent, point, n_draws=50)
    keys = [name for name in DEPENDENCE if name in EFFECTS and name not in ("verdict", "why", "axis")]
    assert found.select(keys).equals(point.select(keys))


def test_the_same_whatever_the_order_of_rows_and_scenes() -> None:
    table = pl.concat([moments({1: 1.0, 2: 1.1, 4: 1.2}), moments({1: 1.0, 2: 1.1}, tracker="sift", seed=1)])
    assert asked(table).equals(asked(table.sample(fraction=1.0, shuffle=True, seed=5)))
    assert not asked(table, seed=1).equals(asked(table))


def test_frames_are_counted_from_the_key_frame() -> None:
    table = moments({1: 1.0, 2: 1.5}).with_columns(
        pl.lit("frame").cast(MOMENTS["axis"]).alias("axis"), at=pl.col("at") + 7
    )
    row = answer(table.with_columns(pl.col("at").cast(pl.UInt32)), statistic="kappa", key_frames={"forward": 7})
    assert (row["verdict"], row["at_low"], row["at_high"], row["axis"]) == ("yes", 1, 5, "frame")


def test_nothing_gives_nothing() -> None:
    found = dependence(*map(empty, (MOMENTS, ENDS, FRAME_COUNTS, CURVES, EFFECTS)))
    assert found.equals(empty(DEPENDENCE))


def test_the_wrong_tables_are_refused() -> None:
    right = [MOMENTS, ENDS, FRAME_COUNTS, CURVES, EFFECTS]
    for place in range(len(right)):
        tables = [empty(TRACKS if number == place else schema) for number, schema in enumerate(right)]
        with pytest.raises(SchemaError):
            dependence(*tables)
