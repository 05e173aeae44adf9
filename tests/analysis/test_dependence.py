"""Intervals and verdicts of effects, from scenes that scatter as wished."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product

import numpy as np
import polars as pl
import pytest
from scipy import stats

from tracknoise.analysis.factors import DEPENDENCE, dependence
from tracknoise.analysis.scene_values import run_values
from tracknoise.exceptions import SchemaError
from tracknoise.inference.units import SceneGroups
from tracknoise.statistics.curves import curves
from tracknoise.statistics.lifetimes import lifetimes_of_ends
from tracknoise.statistics.track_counts import outlier_ratios
from tracknoise.statistics.yardstick import ReferenceCondition, effects
from tracknoise.tables.findings_schema import CURVES, EFFECTS, LIFETIMES
from tracknoise.tables.schema import ENDS, FRAME_COUNTS, MOMENTS, SCALES, TRACKS, empty
from tracknoise.words import size_text

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
    kinds = {"population": "visible", "trimming": "untrimmed", "axis": "age"}
    return pl.DataFrame([row | kinds for row in rows], schema=dict(MOMENTS))


def scales(table: pl.DataFrame) -> pl.DataFrame:
    """Scales whose cores are the mean absolute errors."""
    sizes = {f"core_{axis}_px": pl.when(pl.col(f"mean_abs_{axis}") > 0).then(f"mean_abs_{axis}") for axis in "uv"}
    cores = table.with_columns(**sizes, beyond_u=0, beyond_v=0)
    return cores.select(pl.col(name).cast(kind) for name, kind in SCALES.items())


def asked(
    table: pl.DataFrame,
    ends: pl.DataFrame | None = None,
    frames: pl.DataFrame | None = None,
    *,
    n_draws: int = 400,
    **options: object,
) -> pl.DataFrame:
    """What `dependence` says after `curves` and `effects`."""
    ends = empty(ENDS) if ends is None else ends
    frames = empty(FRAME_COUNTS) if frames is None else frames
    bent = curves(table)
    lived = lifetimes_of_ends(ends)
    point = effects(bent, lived, outlier_ratios(frames), reference=REFERENCE)
    of_run = {name: options.pop(name) for name in ("trimming", "key_frames", "by_kind") if name in options}
    run = run_values(table, scales(table), ends, frames, bent, **of_run)
    return dependence(run, point, n_draws=n_draws, **options)


def answer(*args: object, statistic: str = "eta", factor: str = "speed", **options: object) -> dict[str, object]:
    (row,) = asked(*args, **options).filter(factor=factor, statistic=statistic).to_dicts()
    return row


def test_a_large_effect_is_found_with_its_size_and_the_better_level() -> None:
    row = answer(moments({1: 1.0, 2: 1.5}))
    assert (row["verdict"], row["why"]) == ("yes", None)
    assert (row["level_a"], row["level_b"], row["larger"], row["better"]) == ("1", "2", "2", "1")
    assert row["effect"] == pytest.approx(1.5, rel=0.03)
    assert row["margin"] == pytest.approx(1.1)
    assert row["margin"] < row["low"] < row["effect"] < row["high"] < 1.6
    assert row["p_yes"] <= row["q_yes"] <= 0.05 < row["p_no"]
    assert (row["n_scenes"], row["n_places"], row["at_low"], row["at_high"], row["level"]) == (12, 5, 1, 5, 0.95)
    assert (row["kind"], row["unit"], row["at"], row["coordinate"], row["resampled"]) == (
        "paired", "ratio", None, None, "scenes"
    )  # fmt: skip


def test_the_interval_of_two_levels_is_that_of_the_paired_log_ratios() -> None:
    table = moments({1: 1.0, 2: 1.5}, own=0.1)
    logs = table.filter(pl.col("at") > 0).with_columns(log=pl.col("mean_abs_u").log() + pl.col("mean_abs_v").log())
    means = logs.group_by("scene", "speed").agg(pl.col("log").mean() / 2).pivot("speed", index="scene", values="log")
    ratios = (means["2"] - means["1"]).to_numpy()
    low, high = stats.t.interval(0.95, 11, ratios.mean(), ratios.std(ddof=1) / np.sqrt(12))
    row = answer(table)
    assert np.log([row["effect"], row["low"], row["high"]]) == pytest.approx([ratios.mean(), low, high])


def test_second_moments_and_cores_are_compared_too() -> None:
    table = moments({1: 1.0, 2: 1.5})
    assert answer(table, statistic="Phi")["effect"] == pytest.approx(1.5**2, rel=0.05)
    core, absolute = (answer(table, statistic=name) for name in ("core", "eta"))
    assert core["effect"] == pytest.approx(absolute["effect"])
    assert core["axis"] == "age"


def drawn(counts: Mapping[int, int], *, outliers: float, outliers_in: slice = slice(2)) -> pl.DataFrame:
    """Scenes with as many errors at each age as `counts` says of the speed: of .3 px, and outliers up to 20 px."""
    rng, rows = np.random.default_rng(3), []
    kinds = {"population": "visible", "trimming": "untrimmed", "axis": "age"}
    for scene, (speed, n), age in product(range(12), counts.items(), range(1, AGES + 1)):
        errors = rng.normal(0.0, 0.3, (n, 2))
        is_outlier = rng.random(n) < outliers
        errors[is_outlier, outliers_in] = rng.uniform(-20.0, 20.0, (is_outlier.sum(), 2))[:, outliers_in]
        u, v = errors.T
        powers = {f"m_{'u' * a}{'v' * b}": ((u - u.mean()) ** a * (v - v.mean()) ** b).sum() for a, b in _POWERS}
        means = {"mean_u": u.mean(), "mean_v": v.mean(), "mean_abs_u": abs(u).mean(), "mean_abs_v": abs(v).mean()}
        values = {"scene": f"s{scene:02}", "speed": speed, "at": age, "n": n}
        rows.append(dict.fromkeys(MOMENTS, 0.0) | CONDITION | values | means | powers | kinds)
    return pl.DataFrame(rows, schema=dict(MOMENTS))


_POWERS = [(a, order - a) for order in (2, 3, 4) for a in range(order + 1)]


def test_a_second_moment_does_not_depend_on_how_many_errors_it_is_of() -> None:
    """The logarithm of a mean of few squares with heavy tails is too small: the level with fewer looked better."""
    row = answer(drawn({1: 600, 2: 3000}, outliers=0.03), statistic="Phi")
    assert row["low"] < 1.0 < row["high"] < 1.25
    assert row["verdict"] != "yes"
    gaussian = answer(drawn({1: 60, 2: 3000}, outliers=0.0), statistic="Phi")
    assert gaussian["low"] < 1.0 < gaussian["high"] < 1.1


def test_a_second_moment_of_too_few_errors_for_their_tails_is_not_compared() -> None:
    few = answer(drawn({1: 60, 2: 3000}, outliers=0.03), statistic="Phi")
    assert (few["effect"], few["verdict"]) == (None, "undecided")


def test_outliers_of_one_level_in_one_coordinate_are_not_left_out_alone() -> None:
    """Ages with them were left out in u, and v alone said that second moments are alike."""
    some = drawn({1: 90}, outliers=0.0), drawn({2: 90}, outliers=0.01, outliers_in=slice(1))
    row = answer(pl.concat(some), statistic="Phi")
    assert (row["effect"], row["verdict"]) == (None, "undecided")
    assert row["why"] == "tails of one of both are too heavy for so few errors"


def test_means_differ_in_px_at_one_age_by_a_share_of_the_core() -> None:
    table = moments({1: 1.0, 2: 1.5})
    row = answer(table, statistic="nu")
    assert (row["verdict"], row["unit"], row["coordinate"], row["better"]) == ("yes", "px", "u", None)
    means = table.group_by("speed", "at").agg(pl.col("mean_u").mean()).pivot("speed", index="at", values="mean_u")
    apart = means.filter(at=row["at"]).select((pl.col("2") - pl.col("1")).abs()).item()
    assert row["effect"] == pytest.approx(apart)
    cores = table.filter(pl.col("at") > 0).select(pl.col("mean_abs_u", "mean_abs_v").log().mean()).row(0)
    assert row["margin"] == pytest.approx(0.1 * np.exp(np.mean(cores)))
    assert row["margin"] < row["low"] < row["effect"] < row["high"]


def test_what_scenes_share_cancels_between_levels() -> None:
    # scenes differ by 30 %, but what each has of its own at a level is 2 %
    row = answer(moments({1: 1.0, 2: 1.0}))
    assert (row["verdict"], row["why"]) == ("no", None)
    assert row["low"] < 1 < row["high"] <= row["most"] < 1.05
    assert row["p_no"] <= row["q_no"] <= 0.05 < row["p_yes"]


def test_where_scenes_scatter_too_much_it_is_undecided() -> None:
    row = answer(moments({1: 1.0, 2: 1.0}, own=0.3, seed=2))
    assert (row["verdict"], row["why"]) == ("undecided", "the interval crosses the margin")
    assert row["low"] <= row["margin"] <= row["high"]
    assert row["more_scenes"] is None or row["more_scenes"] > 12


def test_one_bad_level_of_many_is_found() -> None:
    row = answer(moments({1: 1.0, 2: 1.0, 4: 1.0, 8: 1.4}))
    assert (row["verdict"], row["larger"], row["n_pairs"], row["n_levels"]) == ("yes", "8", 6, 4)
    assert answer(moments({1: 1.0, 2: 1.0, 4: 1.0, 8: 1.0}))["verdict"] == "no"


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_with_few_scenes_nothing_is_decided(factor: float) -> None:
    row = answer(moments({1: 1.0, 2: factor}, scenes=5))
    assert (row["verdict"], row["why"]) == ("undecided", "two levels share only 5 scenes; at least 6 are needed")
    assert (row["low"], row["high"], row["p_yes"], row["q_yes"], row["p_no"], row["effect"]) == (None,) * 6


def test_curves_that_cross_are_never_the_same() -> None:
    table = moments({1: 1.0, 2: 1.0})
    twice = pl.when(pl.col("speed") == 1).then(1.0).when(pl.col("at") < 3).then(2.0).when(pl.col("at") > 3).then(0.5)
    names = ["mean_abs_u", "mean_abs_v"]
    crossed = table.with_columns(pl.col(name) * twice.otherwise(1.0) for name in names)
    row = answer(crossed)
    assert (row["verdict"], row["effect"]) == ("yes", pytest.approx(2.0, rel=0.05))
    assert row["at"] != 3
    assert (row["better"], row["larger"]) == (("1", "2") if row["at"] < 3 else ("2", "1"))


def test_scenes_that_one_level_lacks_do_not_count() -> None:
    table = moments({1: 1.0, 2: 1.5})
    row = answer(table.filter((pl.col("speed") == 1) | (pl.col("scene") < "s07")))
    assert (row["n_scenes"], row["verdict"]) == (7, "yes")
    row = answer(table.filter((pl.col("speed") == 1) | (pl.col("scene") < "s05")))
    assert (row["n_scenes"], row["verdict"]) == (5, "undecided")


def test_ages_that_few_scenes_reach_are_left_out() -> None:
    table = moments({1: 1.0, 2: 1.5})
    row = answer(table.filter((pl.col("at") < 5) | (pl.col("scene") < "s05")))
    assert (row["n_scenes"], row["n_places"], row["at_low"], row["at_high"]) == (12, 4, 1, 4)
    few = (pl.col("at") == 5) & (pl.col("scene") >= "s05")
    row = answer(table.with_columns(n=pl.when(few).then(9).otherwise("n").cast(pl.Int64)))
    assert (row["n_scenes"], row["n_places"], row["at_low"], row["at_high"]) == (12, 4, 1, 4)


def test_a_no_needs_every_level() -> None:
    table = moments({1: 1.0, 2: 1.0, 4: 1.0})
    few = (pl.col("speed") != 4) | (pl.col("scene") < "s03")
    row = answer(table.filter(few))
    assert (row["verdict"], row["why"]) == ("undecided", "two levels share only 3 scenes; at least 6 are needed")
    row = answer(table.filter((pl.col("speed") != 4) | (pl.col("at") == 0)))
    assert (row["verdict"], row["why"]) == ("undecided", "nothing to compare speed 4 by")


def test_scenes_that_are_all_alike() -> None:
    table = moments({1: 1.0, 2: 1.2}, scenes=1)
    alike = pl.concat([table.with_columns(scene=pl.lit(f"s{number}")) for number in range(8)])
    row = answer(alike)
    assert row["verdict"] == "yes"
    assert (row["low"], row["high"]) == (pytest.approx(row["effect"]), pytest.approx(row["effect"]))
    same = pl.concat([alike.filter(speed=1), alike.filter(speed=1).with_columns(speed=pl.lit(2, dtype=pl.Int32))])
    row = answer(same)
    assert (row["effect"], row["low"], row["high"], row["verdict"]) == (1.0, 1.0, 1.0, "no")
    assert (row["larger"], row["better"]) == (None, None)


def test_errors_of_zero_at_one_level_have_no_ratio() -> None:
    table = moments({1: 1.0, 2: 1.0})
    none = (pl.col("speed") == 2) & (pl.col("scene") == "s03")
    row = answer(table.with_columns(mean_abs_u=pl.when(~none).then("mean_abs_u").otherwise(0.0)))
    assert (row["verdict"], row["why"]) == ("undecided", "a value of 0 at one of two levels, which has no ratio")
    both = pl.col("scene") == "s03"
    assert answer(table.with_columns(mean_abs_u=pl.when(~both).then("mean_abs_u").otherwise(0.0)))["verdict"] == "no"


def test_a_mean_error_that_scatters_around_zero_is_undecided_within_finite_bounds() -> None:
    rng = np.random.default_rng(3)
    table = moments({1: 1.0, 2: 1.0})
    noise = table.with_columns(pl.Series(name, rng.standard_normal(table.height)) for name in ("mean_u", "mean_v"))
    row = answer(noise, statistic="nu")
    assert row["verdict"] == "undecided"
    assert 0 <= row["low"] <= row["margin"] < row["high"] < 10


def test_turned_images_are_compared_upright() -> None:
    table = moments({1: 1.0})
    names = {"mean_abs_u": "mean_abs_v", "mean_abs_v": "mean_abs_u", "m_uu": "m_vv", "m_vv": "m_uu"}
    turned = table.rename(names).select(*MOMENTS).with_columns(
        mean_u=table["mean_v"], mean_v=-table["mean_u"], rotation=pl.lit(90, dtype=pl.Int16)
    )  # fmt: skip
    for statistic, same in (("nu", 0.0), ("eta", 1.0), ("Phi", 1.0), ("core", 1.0)):
        row = answer(pl.concat([table, turned]), factor="rotation", statistic=statistic)
        assert (row["verdict"], row["effect"]) == ("no", pytest.approx(same, abs=1e-12))
        assert row["n_places"] == 5


def test_trimmed_errors_are_another_question() -> None:
    table = moments({1: 1.0, 2: 1.5})
    trimmed = moments({1: 1.0, 2: 1.0}).with_columns(trimming=pl.lit("trimmed", dtype=MOMENTS["trimming"]))
    both = pl.concat([table, trimmed])
    assert [answer(both, trimming=name)["verdict"] for name in ("untrimmed", "trimmed")] == ["yes", "no"]


def groups_of(scenes: int, group: Callable[[int], int]) -> SceneGroups:
    return SceneGroups({("d", f"s{scene:02}"): f"g{group(scene)}" for scene in range(scenes)})


def test_groups_of_scenes_are_averaged_first() -> None:
    table = moments({1: 1.0, 2: 1.5}, own=0.1)
    pairs = groups_of(12, lambda scene: scene // 2)
    row = answer(table, groups=pairs)
    assert (row["resampled"], row["n_scenes"]) == ("groups", 12)
    assert row["effect"] == pytest.approx(answer(table)["effect"])
    copies = pl.concat([table, table.with_columns(scene=pl.col("scene").str.replace("s", "t"))])
    names = {("d", f"{letter}{scene:02}"): f"g{scene}" for letter in "st" for scene in range(12)}
    doubled = answer(copies, groups=SceneGroups(names))
    alone = answer(table)
    assert [doubled[name] for name in ("effect", "low", "high")] == pytest.approx(
        [alone[name] for name in ("effect", "low", "high")]
    )


def test_few_groups_leave_the_variation_within_them() -> None:
    table = moments({1: 1.0, 2: 1.5}, own=0.02)
    away = pl.when((pl.col("scene") < "s06") & (pl.col("speed") == 2)).then(1.5).otherwise(1.0)
    apart = table.with_columns(pl.col("mean_abs_u", "mean_abs_v") * away)
    halves = groups_of(12, lambda scene: scene // 6)
    row, plain = answer(apart, groups=halves), answer(apart)
    assert (row["resampled"], plain["resampled"]) == ("within", "scenes")
    assert row["effect"] == pytest.approx(plain["effect"])
    assert row["high"] / row["low"] < 1.1 < plain["high"] / plain["low"]
    row = answer(moments({1: 1.0, 2: 1.5}, scenes=7), groups=groups_of(7, lambda scene: min(scene, 4)))
    assert row["verdict"] == "undecided"
    assert row["why"].startswith("the scenes form only 5 groups; at least 6 are needed")


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


@pytest.mark.parametrize(("factor", "verdict", "better"), [(1.0, "no", None), (1.3, "yes", "2")])
def test_lifetimes(factor: float, verdict: str, better: str | None) -> None:
    row = answer(empty(MOMENTS), ends_of({1: 1.0, 2: factor, 4: 1.0}), statistic="lifetime")
    assert (row["verdict"], row["n_scenes"], row["at_low"], row["axis"]) == (verdict, 10, None, None)
    assert row["low"] <= row["effect"] <= row["high"]
    assert row["effect"] == pytest.approx(factor, rel=0.03)
    assert better in (row["better"], None)
    assert row["horizon"] > 1000


def lives_of(lengths: Mapping[int, int], hazard: Callable[[np.random.Generator], np.ndarray]) -> pl.DataFrame:
    """Ends of tracks with the same hazards at all speeds, in sequences of other lengths."""
    rng = np.random.default_rng(4)
    rows = []
    for scene in range(11):
        for speed, length in lengths.items():
            life = rng.geometric(hazard(rng))
            for number in range(1, length + 1):
                n = int((life == number).sum()) * (number < length), int((life >= length).sum()) * (number == length)
                rows.append(CONDITION | {"scene": f"s{scene:02}", "speed": speed, "block": 0, "lifetime": number}
                            | {"n_ended": n[0], "n_censored": n[1]})  # fmt: skip
    return pl.DataFrame(rows, schema=dict(ENDS)).filter(pl.col("n_ended") + pl.col("n_censored") > 0)


def test_lifetimes_do_not_depend_on_the_length_of_sequences() -> None:
    ends = lives_of({1: 60, 2: 15}, lambda rng: np.where(rng.random(2000) < 0.5, 0.3, 0.02))
    row = answer(empty(MOMENTS), ends, statistic="lifetime")
    assert (row["verdict"], row["horizon"]) == ("no", 15.0)


def lives_of_scenes(lengths: Sequence[int], hazards: Mapping[int, float]) -> pl.DataFrame:
    """Ends of tracks of other hazards at each speed, in scenes of these lengths."""
    rows = []
    for scene, length in enumerate(lengths):
        for speed, hazard in hazards.items():
            alive = 10_000.0
            for number in range(1, length + 1):
                ended = round(alive * hazard) if number < length else 0
                counts = {"n_ended": ended, "n_censored": round(alive) if number == length else 0}
                rows.append(
                    CONDITION | {"scene": f"s{scene:02}", "speed": speed, "block": 0, "lifetime": number} | counts
                )
                alive -= ended
    return pl.DataFrame(rows, schema=dict(ENDS))


def test_lifetimes_are_not_alike_because_sequences_are_short() -> None:
    """Hardly any track ends within eight frames, whatever the hazards."""
    ends = lives_of_scenes([8] * 11, {1: 0.02, 2: 0.04})
    row = answer(empty(MOMENTS), ends, statistic="lifetime")
    assert row["effect"] < 1.1
    assert row["verdict"] == "undecided"
    assert row["why"] == "more than half of the tracks live to the common horizon"


def test_one_short_scene_does_not_shorten_the_horizon() -> None:
    hazards = {1: 0.02, 2: 0.04}
    row = answer(empty(MOMENTS), lives_of_scenes([60] * 10 + [5], hazards), statistic="lifetime")
    without = answer(empty(MOMENTS), lives_of_scenes([60] * 10, hazards), statistic="lifetime")
    assert (row["verdict"], row["better"], row["horizon"]) == ("yes", "1", 60.0)
    assert row["effect"] == pytest.approx(without["effect"])


def test_a_horizon_of_one_frame_compares_nothing() -> None:
    ends = lives_of({1: 60, 2: 1}, lambda rng: np.full(2000, 0.1))
    row = answer(empty(MOMENTS), ends, statistic="lifetime")
    assert (row["verdict"], row["effect"]) == ("undecided", None)


@pytest.mark.parametrize(("outliers", "verdict"), [(500, "no"), (800, "yes")])
def test_outlier_ratios(outliers: int, verdict: str) -> None:
    row = answer(empty(MOMENTS), None, frames_of({1: 500, 2: outliers}), statistic="outlier_ratio")
    assert (row["verdict"], row["n_scenes"]) == (verdict, 10)
    assert row["low"] <= row["effect"] <= row["high"]
    assert row["effect"] == pytest.approx(outliers / 500, rel=0.03)


@pytest.mark.parametrize(("few", "is_bounded"), [(0, False), (1, False), (3, True)])
def test_a_ratio_to_hardly_any_outliers_has_no_upper_bound(few: int, is_bounded: bool) -> None:
    row = answer(empty(MOMENTS), None, frames_of({1: few, 2: 500}), statistic="outlier_ratio")
    assert (row["verdict"], row["larger"]) == ("yes", "2")
    assert row["effect"] >= row["low"] > 10
    assert (row["high"] is not None) == is_bounded
    assert ("or more)" in size_text(row)) != is_bounded


def test_outliers_that_never_were_decide_nothing() -> None:
    row = answer(empty(MOMENTS), None, frames_of({1: 0, 2: 0}), statistic="outlier_ratio")
    assert (row["effect"], row["verdict"], row["high"]) == (None, "undecided", None)


def test_more_trackers_make_a_weak_answer_weaker() -> None:
    weak = moments({1: 1.0, 2: 1.16}, own=0.05)
    alone = answer(weak)
    others = [moments({1: 1.0, 2: 1.0}, own=0.2, seed=number, tracker=f"t{number}") for number in range(1, 8)]
    among = asked(pl.concat([weak, *others])).filter(factor="speed", statistic="eta", tracker="lk").to_dicts()[0]
    assert among["q_yes"] > alone["q_yes"]


def test_what_else_is_asked_about_a_factor_leaves_an_answer_as_it_is() -> None:
    table = moments({1: 1.0, 2: 1.3}, own=0.2)
    more = ends_of({1: 20, 2: 20}, scenes=12), frames_of({1: 500, 2: 500}, scenes=12)
    about_sizes = pl.col("statistic").is_in(["core", "Phi"]), pl.col("factor") == "speed"
    alone, among = asked(table).filter(about_sizes), asked(table, *more).filter(about_sizes)
    columns = ["statistic", "q_yes", "q_no", "verdict"]
    assert among.select(columns).equals(alone.select(columns))
    assert alone["verdict"].to_list() == ["yes", "yes"]


def test_the_rows_are_those_of_the_effects_without_central_moments_and_with_the_core() -> None:
    table = moments({1: 1.0, 2: 1.2})
    bent = curves(table)
    point = effects(bent, empty(LIFETIMES), outlier_ratios(empty(FRAME_COUNTS)), reference=REFERENCE)
    run = run_values(table, scales(table), empty(ENDS), empty(FRAME_COUNTS), bent)
    found = dependence(run, point, n_draws=50)
    keys = ["dataset", "factor", *(name for name in CONDITION if name != "dataset"), "statistic"]
    expected = point.filter(pl.col("statistic") != "central").select(keys)
    assert found.filter(pl.col("statistic") != "core").select(keys).equals(expected)
    assert found.filter(statistic="core").height == found.filter(statistic="eta").height


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
    run = run_values(*map(empty, (MOMENTS, SCALES, ENDS, FRAME_COUNTS, CURVES)))
    found = dependence(run, empty(EFFECTS))
    assert found.equals(empty(DEPENDENCE))


def test_the_wrong_tables_are_refused() -> None:
    right = [MOMENTS, SCALES, ENDS, FRAME_COUNTS, CURVES, EFFECTS]
    for place in range(len(right)):
        tables = [empty(TRACKS if number == place else schema) for number, schema in enumerate(right)]
        with pytest.raises(SchemaError):
            dependence(run_values(*tables[:-1]), tables[-1])
