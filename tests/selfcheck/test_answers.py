"""Limits for intervals and p-values: right ones pass, wrong ones do not."""

from collections.abc import Iterator

import numpy as np
import polars as pl
import pytest
from benchmarks.selfcheck.scene_pools import (
    ALARM,
    LOG_SPREAD,
    MEAN_SPREAD_PX,
    N_TRACKS,
    NOISE_PX,
    REPLICATES,
    interval_checks,
    zero_mean_checks,
)
from scipy.stats import t as student

SCENES, AGES = 12, 24


def intervals(rng: np.random.Generator, *, level: float = 0.95, wider: float = 1.0, iid: bool = False) -> pl.DataFrame:
    """Student's intervals of mean errors and, on the log scale, of second moments, as the package would make them."""
    shape = (REPLICATES * AGES * 2, SCENES)
    means = rng.normal(0, MEAN_SPREAD_PX, shape) + rng.normal(0, NOISE_PX / np.sqrt(N_TRACKS), shape)
    squares = NOISE_PX**2 * np.exp(2 * LOG_SPREAD * rng.standard_normal(shape))
    squares *= rng.chisquare(N_TRACKS, shape) / N_TRACKS
    reach = wider * student.isf((1 - level) / 2, SCENES - 1) / np.sqrt(SCENES)
    spread = NOISE_PX / np.sqrt(N_TRACKS) if iid else means.std(axis=1, ddof=1)
    relative = squares.std(axis=1, ddof=1) / squares.mean(axis=1)
    middle, half = means.mean(axis=1), reach * spread
    second, ratio = squares.mean(axis=1), np.exp(reach * relative)
    parts = [
        _table("mean", "nu", middle - half, middle + half),
        _table("scale", "Phi", second / ratio, second * ratio),
    ]
    return pl.concat(parts)


def _table(kind: str, statistic: str, low: np.ndarray, high: np.ndarray) -> pl.DataFrame:
    labels = {"statistic": statistic, "aspect": "all", "population": "visible", "trimming": "untrimmed"}
    places = [
        (f"{kind} {number}", age, axis) for number in range(REPLICATES) for age in range(1, AGES + 1) for axis in "uv"
    ]
    table = pl.DataFrame(places, schema=["tracker", "at", "coordinate"], orient="row")
    named = [pl.lit(value).alias(name) for name, value in {**labels, "weighting": "features"}.items()]
    return table.with_columns(*named, low=pl.Series(low), high=pl.Series(high))


def wrong(checks: Iterator[pl.DataFrame]) -> list[str]:
    return pl.concat(checks).filter(pl.col("n_wrong") > 0)["quantity"].to_list()


def test_right_intervals_pass():
    rng = np.random.default_rng(0)
    failures = sum(bool(wrong(interval_checks(intervals(rng), scenes=SCENES))) for _ in range(200))
    assert failures <= 200 * 30 * ALARM


@pytest.mark.parametrize(
    "fault", [{"wider": 2.0}, {"wider": 0.5}, {"iid": True}, {"level": 0.8}, {"wider": 1.5}, {"wider": 0.7}]
)
def test_intervals_that_are_too_wide_or_too_narrow_do_not(fault):
    rng = np.random.default_rng(1)
    assert all(wrong(interval_checks(intervals(rng, **fault), scenes=SCENES)) for _ in range(20))


def test_intervals_that_are_missing_do_not():
    table = intervals(np.random.default_rng(2))
    assert len(wrong(interval_checks(table.clear(), scenes=SCENES))) == 3
    some = table.with_columns(low=pl.when(pl.col("at") > 3).then("low"))
    assert len(wrong(interval_checks(some, scenes=SCENES))) >= 2


def zero_mean(rng: np.random.Generator, power: float = 1.0, n_false: int = 0, biased: str = "yes") -> pl.DataFrame:
    """P-values of true zeros raised to a power, and verdicts."""
    names = [f"{kind} {number}" for kind in ("mean", "scale") for number in range(REPLICATES)]
    ages = [(name, age, rng.uniform() ** power, None) for name in names for age in range(1, AGES + 1)]
    overall = [(name, None, 0.5, "yes" if place < n_false else "undecided") for place, name in enumerate(names)]
    schema = {"tracker": pl.String, "at": pl.Int64, "sign_flip_p": pl.Float64, "verdict": pl.String}
    return pl.DataFrame([*ages, *overall, ("biased", None, 0.001, biased)], schema=schema, orient="row")


def test_verdicts_and_p_values_of_a_zero_mean():
    rng = np.random.default_rng(3)
    assert wrong(zero_mean_checks(zero_mean(rng, n_false=2))) == []
    assert wrong(zero_mean_checks(zero_mean(rng, n_false=6))) == ["true zeros that are rejected"]
    assert wrong(zero_mean_checks(zero_mean(rng, biased="undecided"))) == ["a mean of half a pixel"]
    for power in (2.0, 0.5, 0.0):
        assert wrong(zero_mean_checks(zero_mean(rng, power))) == ["distance of p-values from uniform (Kolmogorov)"]
