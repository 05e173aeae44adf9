"""How often intervals of simulated scenes hold the true value; `benchmarks/validity/intervals.py` does it in full."""

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.curve_intervals import curve_statistics
from tracknoise.analysis.lifetime_intervals import first_reached, survival
from tracknoise.inference.intervals import Method, averaged, pooled
from tracknoise.inference.survival import area_under
from tracknoise.inference.units import Units

RUNS, TRACKS, AGE, LONGEST, HORIZON = 400, 60, 8, 40, 20
BIAS_PX, STEP_PX, HAZARD, OUTLIERS = 0.2, 0.1, 0.06, 0.04
STUDENT, NO_DRAWS = Method("student"), 0


def units_of_runs(sums: np.ndarray) -> Units:
    """Sums (scenes, runs, columns) of many runs, each of which stands for a point."""
    scenes = tuple(f"s{number:02}" for number in range(len(sums)))
    return Units(sums, pl.DataFrame({"run": range(sums.shape[1])}), scenes, np.arange(len(sums)), "scenes")


def no_weights(n_scenes: int) -> np.ndarray:
    return np.empty((NO_DRAWS, n_scenes))


def share(low: np.ndarray, high: np.ndarray, true: float) -> float:
    return float(((low <= true) & (true <= high)).mean())


@pytest.mark.parametrize("n_scenes", [8, 28])
@pytest.mark.parametrize("weigh", [pooled, averaged])
def test_mean_and_second_moment_of_walks_whose_bias_and_scale_are_the_scenes(n_scenes, weigh):
    rng = np.random.default_rng(n_scenes)
    shape = (n_scenes, RUNS)
    bias, scale = BIAS_PX + 0.15 * rng.normal(size=shape), np.exp(0.2 * rng.normal(size=shape))
    walk = STEP_PX * rng.normal(size=(AGE, 2, *shape, TRACKS)).sum(axis=0)
    there = np.arange(TRACKS) < rng.integers(TRACKS // 2, TRACKS + 1, (*shape, 1))
    u, v = np.where(there, bias[..., None] + scale[..., None] * walk, 0.0)
    values = [there, u, v, u * u, u * v, v * v, np.abs(u), np.abs(v)]
    sums = np.stack([value.sum(axis=-1, dtype=np.float64) for value in values], axis=-1)
    scales = [*["linear"] * 4, "log", *["linear"] * 5]
    bounds = weigh(units_of_runs(sums), no_weights(n_scenes), curve_statistics, STUDENT, scales=scales)
    second = BIAS_PX**2 + 0.15**2 + np.exp(2 * 0.2**2) * STEP_PX**2 * AGE
    for row, true in ((0, BIAS_PX), (4, second)):
        assert 0.92 - 0.03 < share(bounds.low[row], bounds.high[row], true) < 0.97 + 0.015


@pytest.mark.parametrize("weigh", [pooled, averaged])
def test_blocks_of_two_scenes_tell_of_these_scenes(weigh):
    rng, blocks = np.random.default_rng(2), 16
    shape = (2 * blocks, RUNS)
    bias = np.repeat([0.0, 5.0], blocks)[:, None, None]
    u = bias + rng.normal(size=(*shape, 20))
    n = rng.integers(10, 21, shape)
    there = np.arange(20) < n[..., None]
    total, zero = np.where(there, u, 0.0).sum(axis=-1), np.zeros(shape)
    sums = np.stack([n, total, zero, (np.where(there, u, 0.0) ** 2).sum(axis=-1), *[zero] * 4], axis=-1)
    units = Units(sums, pl.DataFrame(), ("a", "b"), np.repeat([0, 1], blocks), "blocks")
    bounds = weigh(units, no_weights(2 * blocks), curve_statistics, STUDENT)
    wide = bounds.high[0] - bounds.low[0]
    assert 0.92 - 0.03 < share(bounds.low[0], bounds.high[0], 2.5) < 0.97 + 0.015
    assert (wide < 1.5).all()  # scenes that differ by 5 px do not make it wide
    assert (bounds.n_units == 2 * blocks).all()
    assert (bounds.n_scenes == 2).all()


@pytest.mark.parametrize("n_scenes", [8, 28])
def test_outlier_ratio_of_scenes_that_differ(n_scenes):
    rng = np.random.default_rng(n_scenes)
    rate = OUTLIERS * np.exp(0.3 * rng.normal(size=(n_scenes, RUNS)) - 0.045)
    offered = rng.poisson(800, rate.shape)
    sums = np.stack([offered, rng.binomial(offered, rate)], axis=-1).astype(np.float64)
    bounds = pooled(units_of_runs(sums), no_weights(n_scenes), lambda s: s[1:] / s[:1], STUDENT, scales=["logit"])
    assert 0.92 - 0.03 < share(bounds.low, bounds.high, OUTLIERS) < 0.97 + 0.015


@pytest.mark.parametrize("n_scenes", [8, 28])
def test_lifetimes_of_scenes_that_lose_tracks_at_different_rates(n_scenes):
    rng = np.random.default_rng(n_scenes)
    shape = (n_scenes, RUNS, TRACKS)
    hazard = HAZARD * np.exp(0.3 * rng.normal(size=(*shape[:2], 1)))
    life, left = rng.geometric(hazard, shape), rng.integers(1, LONGEST + 1, shape)
    run = np.arange(n_scenes * RUNS).reshape(n_scenes, RUNS, 1)
    place = run * (LONGEST + 1) + np.minimum(life, left)
    size = n_scenes * RUNS * (LONGEST + 1)
    ends = [np.bincount(place[chosen], minlength=size) for chosen in (life < left, life >= left)]
    sums = np.stack(ends, axis=-1).reshape(n_scenes, RUNS, LONGEST + 1, 2)[:, :, 1:].astype(np.float64)
    by_lifetime = sums.swapaxes(1, 2).reshape(n_scenes, LONGEST * RUNS, 2)
    lifetimes = np.arange(1.0, LONGEST + 1)

    def curves(totals: np.ndarray) -> np.ndarray:
        return survival(totals.reshape(2, LONGEST, RUNS, *totals.shape[2:]))[0]

    def flat(totals: np.ndarray) -> np.ndarray:
        return curves(totals).reshape(1, LONGEST * RUNS, *totals.shape[2:])

    def mean(totals: np.ndarray) -> np.ndarray:
        return area_under(np.moveaxis(curves(totals), 0, -1), lifetimes, HORIZON)[None] / HORIZON

    units, weights = units_of_runs(by_lifetime), no_weights(n_scenes)
    sizes = np.ones((LONGEST * RUNS, n_scenes))
    bounds = pooled(units, weights, flat, STUDENT, scales=["logit"], sizes=sizes)
    areas = pooled(units, weights, mean, STUDENT, scales=["logit"], sizes=sizes[:RUNS])
    population = HAZARD * np.exp(0.3 * np.random.default_rng(0).normal(size=200_000))
    survives = np.array([np.mean((1 - population) ** k) for k in lifetimes])
    assert (
        0.92 - 0.03
        < share(areas.low, areas.high, float(area_under(survives, lifetimes, HORIZON)) / HORIZON)
        < 0.97 + 0.015
    )
    low, high = (
        np.array([first_reached(values, lifetimes, 0.5) for values in bound.reshape(LONGEST, RUNS).T])
        for bound in (bounds.low, bounds.high)
    )
    held = share(low, high, first_reached(survives, lifetimes, 0.5))
    assert np.nanmedian(high - low) < 10 / np.sqrt(n_scenes / 8)
    assert held > 0.92 - 0.03  # whole frames make it cover more than its level
