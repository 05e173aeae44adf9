"""How much results differ between random seeds, and the intervals that include it."""

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.curve_intervals import interval_table
from tracknoise.analysis.seed_spread import SEED_SPREAD, Repeat, seed_spread, widened
from tracknoise.exceptions import SchemaError
from tracknoise.statistics.lifetimes import horizons, lifetimes_of_ends
from tracknoise.tables.findings_schema import INTERVALS
from tracknoise.tables.schema import ENDS, FRAME_COUNTS, MOMENTS, Schema, empty

CONDITION = {"dataset": "d", "lighting": "l", "rotation": 0, "direction": "forward", "camera": "", "tracker": "t"}


def typed(rows: list[dict[str, object]], schema: Schema) -> pl.DataFrame:
    return pl.DataFrame([{"speed": 1, **CONDITION, **row} for row in rows], schema=dict(schema))


def tables(n_scenes: int, rng: np.random.Generator) -> Repeat:
    """Ends, outliers and errors that differ between seeds by chance alone."""
    scenes = [f"s{number}" for number in range(n_scenes)]
    ends = [
        {"scene": scene, "block": block, "lifetime": life, "n_ended": int(n), "n_censored": 0, "n_lost": int(n)}
        | dict.fromkeys(("n_outlier", "n_displaced", "n_masked"), 0)
        for scene in scenes
        for block in range(16)
        for life, n in enumerate(rng.poisson([30, 20, 20, 10]), start=1)
    ]
    frames = [
        {"scene": scene, "frame": frame, "offered": 200, "outliers": int(rng.poisson(10))}
        for scene in scenes
        for frame in range(32)
    ]
    values = {name: 0.0 for name in MOMENTS if name.startswith(("mean_", "m_"))}
    errors = [
        {"scene": scene, "population": "visible", "trimming": "trimmed", "axis": "age", "at": 1, "n": 100, **values}
        | {"mean_u": rng.normal(), "m_uu": rng.gamma(20), "m_vv": 5.0, "mean_abs_u": 1.0, "mean_abs_v": 1.0}
        for scene in scenes
    ]
    return Repeat(typed(errors, MOMENTS), typed(ends, ENDS), typed(frames, FRAME_COUNTS))


HORIZONS: Schema = {"dataset": pl.String, "speed": ENDS["speed"], "restricted_to": pl.UInt32}
KNOWN = pl.DataFrame({"dataset": ["d"], "speed": [1], "restricted_to": [4]}, schema=dict(HORIZONS))


def found(n_scenes: int, n_seeds: int) -> tuple[pl.DataFrame, pl.DataFrame, list[Repeat]]:
    rng = np.random.default_rng(4)
    first, *others = (tables(n_scenes, rng) for _ in range(n_seeds))
    intervals = interval_table(first.moments, first.ends, first.frames)
    shared = horizons(lifetimes_of_ends(first.ends))
    return intervals, seed_spread(intervals, others, horizons=shared, population="visible"), [first, *others]


def test_the_spread_is_that_of_the_results_of_each_seed() -> None:
    _, spread, seeds = found(3, 4)
    ratios = [seed.frames["outliers"].sum() / seed.frames["offered"].sum() for seed in seeds]
    row = spread.row(by_predicate=pl.col("statistic") == "outlier_ratio", named=True)
    assert row["mean"] == pytest.approx(np.mean(ratios))
    assert row["standard_deviation"] == pytest.approx(np.std(ratios, ddof=1))
    assert (row["n_seeds"], row["unit"]) == (4, "share")
    means = [seed.moments["mean_u"].mean() for seed in seeds]
    one = spread.filter(statistic="nu", coordinate="u", weighting="features").row(0, named=True)
    assert one["standard_deviation"] == pytest.approx(np.std(means, ddof=1))
    assert {"mean_lifetime", "restricted_mean_lifetime", "median_lifetime", "survival"} <= set(spread["statistic"])


def test_intervals_of_blocks_become_wider_and_those_of_scenes_do_not() -> None:
    intervals, spread, _ = found(3, 3)
    wider = widened(intervals, spread, horizons=KNOWN)
    assert spread["widens_interval"].all()
    names = ["mean_lifetime", "restricted_mean_lifetime", "outlier_ratio"]
    for before, after in zip(
        *(table.filter(pl.col("statistic").is_in(names)).to_dicts() for table in (intervals, wider)), strict=True
    ):
        assert after["low"] < before["low"] < before["value"] < before["high"] < after["high"]
    kept = [name for name in INTERVALS if name not in ("low", "high")]
    assert wider.select(kept).equals(intervals.select(kept))
    many, of_scenes, _ = found(8, 3)
    assert not of_scenes["widens_interval"].any()
    assert widened(many, of_scenes, horizons=KNOWN).equals(many)


def test_the_widened_bound_by_hand() -> None:
    # 0.1 (0.08 to 0.125) on the logit scale, standard deviation 0.01 of 3 seeds: t is 4.303, the slope 1 / (0.1 x 0.9).
    row = {"aspect": "all", "statistic": "outlier_ratio", "unit": "share", "value": 0.1, "low": 0.08, "high": 0.125}
    intervals = typed([{**row, "level": 0.95, "resampled": "blocks"}], INTERVALS)
    spread = typed(
        [{"statistic": "outlier_ratio", "unit": "share", "mean": 0.1, "standard_deviation": 0.01, "n_seeds": 3}
         | {"widens_interval": True}], SEED_SPREAD
    )  # fmt: skip
    logit = lambda share: np.log(share / (1 - share))  # noqa: E731
    width = np.hypot(logit(0.1) - logit(0.08), 4.302653 * 0.01 / 0.09)
    assert widened(intervals, spread, horizons=KNOWN)["low"].item() == pytest.approx(
        1 / (1 + np.exp(width - logit(0.1)))
    )
    median = intervals.with_columns(
        statistic=pl.lit("median_lifetime"), unit=pl.lit("frames"), value=9.0, low=8.0, high=11.0
    )
    frames = spread.with_columns(statistic=pl.lit("median_lifetime"), standard_deviation=0.4)
    assert widened(median, frames, horizons=KNOWN).select("low", "high").row(0) == (7.0, 12.0)


def test_a_widened_restricted_mean_stays_below_its_horizon() -> None:
    row = {"aspect": "all", "statistic": "restricted_mean_lifetime", "unit": "frames", "value": 25.0, "low": 22.0}
    intervals = typed([{**row, "high": 27.0, "level": 0.95, "resampled": "blocks"}], INTERVALS)
    spread = typed(
        [{"statistic": "restricted_mean_lifetime", "unit": "frames", "mean": 25.0, "standard_deviation": 0.6}
         | {"n_seeds": 2, "widens_interval": True}], SEED_SPREAD
    )  # fmt: skip
    horizons = pl.DataFrame({"dataset": ["d"], "speed": [1], "restricted_to": [30]}, schema=dict(HORIZONS))
    low, high = widened(intervals, spread, horizons=horizons).select("low", "high").row(0)
    # On the logit scale of 25 of 30 frames: t is 12.706, the slope 1 / (25 / 30 x 5 / 30).
    logit = lambda frames: np.log(frames / (30 - frames))  # noqa: E731
    reach = 12.7062 * 0.6 / 30 / (25 / 30 * 5 / 30)
    assert logit(low) == pytest.approx(logit(25) - np.hypot(logit(25) - logit(22), reach), rel=1e-5)
    assert logit(high) == pytest.approx(logit(25) + np.hypot(logit(27) - logit(25), reach), rel=1e-5)
    assert 27.0 < high < 30.0


def test_one_seed_says_nothing_and_changes_nothing() -> None:
    intervals, spread, _ = found(3, 1)
    assert spread.equals(empty(SEED_SPREAD))
    assert widened(intervals, spread, horizons=KNOWN).equals(intervals)


def test_seeds_that_agree_change_nothing() -> None:
    first = tables(2, np.random.default_rng(0))
    intervals = interval_table(first.moments, first.ends, first.frames)
    spread = seed_spread(
        intervals, [first, first], horizons=horizons(lifetimes_of_ends(first.ends)), population="visible"
    )
    assert spread["standard_deviation"].max() == pytest.approx(0.0, abs=1e-12)
    both = widened(intervals, spread, horizons=KNOWN)
    np.testing.assert_allclose(both["low"].to_numpy(), intervals["low"].to_numpy(), rtol=1e-9)


def test_other_tables_are_refused() -> None:
    with pytest.raises(SchemaError, match="intervals"):
        widened(empty(ENDS), empty(SEED_SPREAD), horizons=KNOWN)
