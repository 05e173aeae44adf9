"""Second moments over scenes that have biases: coverage, the formula by hand, and what is said of heavy tails."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from scipy import stats

from tracknoise.analysis.curve_intervals import curve_statistics
from tracknoise.analysis.scene_spread import Parts, coverage_of_heavy_tails, with_biases
from tracknoise.inference.intervals import Method, averaged, pooled
from tracknoise.inference.units import Units

RUNS, TRACKS, ROWS = 600, 100, [4, 5]
SCALES = [*["linear"] * 4, "log", "log", *["linear"] * 4]


def scenes(rng, n_scenes, *, bias, scale, freedom=np.inf, mean=0.0):
    """Units of which each point is a run: scenes with Gaussian errors about a bias of their own."""
    drawn = rng.normal(size=(n_scenes, RUNS)) if np.isinf(freedom) else rng.standard_t(freedom, (n_scenes, RUNS))
    spread = 1.0 if np.isinf(freedom) else np.sqrt(freedom / (freedom - 2))
    first = mean + bias * drawn / spread + scale * rng.normal(size=drawn.shape) / np.sqrt(TRACKS)
    second = first**2 + scale**2 * rng.chisquare(TRACKS - 1, drawn.shape) / TRACKS
    one = np.ones_like(first)
    sums = TRACKS * np.stack([one, first, first, second, second, second, one, one], axis=-1)
    names = tuple(f"s{number:02}" for number in range(n_scenes))
    return Units(sums, pl.DataFrame({"run": range(RUNS)}), names, np.arange(n_scenes), "scenes")


def bounds(units, weigh):
    found = weigh(units, np.empty((0, len(units.sums))), curve_statistics, Method(), scales=SCALES)
    return with_biases(units, Parts.of(units, "features" if weigh is pooled else "scenes"), found, ROWS)


def share(found, true):
    return float(((found.low[4] <= true) & (true <= found.high[4])).mean())


@pytest.mark.parametrize("weigh", [pooled, averaged])
@pytest.mark.parametrize("n_scenes", [8, 28])
@pytest.mark.parametrize("scale", [0.1, 0.3, 0.9])
def test_intervals_contain_the_second_moment_of_scenes_with_biases(weigh, n_scenes, scale):
    units = scenes(np.random.default_rng(n_scenes), n_scenes, bias=0.3, scale=scale)
    assert 0.93 - 0.02 < share(bounds(units, weigh), 0.3**2 + scale**2) < 0.97 + 0.02


def test_a_bias_that_all_scenes_share_does_not_make_the_interval_wide():
    units = scenes(np.random.default_rng(1), 8, bias=0.0, scale=0.1, mean=1.0)
    found = bounds(units, pooled)
    assert share(found, 1.01) > 0.93 - 0.02
    assert np.median(found.high[4] - found.low[4]) < 0.05


def test_the_formula_by_hand_of_scenes_without_noise():
    """Without a variance within scenes the interval is that of the variance of biases, of mean zero."""
    biases = np.array([0.3, -0.3, 0.1, -0.1, 0.5, -0.5, 0.2, -0.2])
    units = scenes(np.random.default_rng(2), 8, bias=0.0, scale=0.0)
    first = np.broadcast_to(biases[:, None], (8, RUNS))
    one = np.ones_like(first)
    units = replace(units, sums=TRACKS * np.stack([one, first, first, *[first**2] * 3, one, one], axis=-1))
    found = bounds(units, averaged)
    mean = np.mean(biases**2)
    degrees = min(8, 2 * mean**2 / (np.var(biases**2, ddof=1) / 8)) * 7 / 8
    high, low = (degrees / stats.chi2.ppf(tail, degrees) for tail in (0.025, 0.975))
    np.testing.assert_allclose(found.value[4], mean)
    np.testing.assert_allclose(found.high[4], mean * high)
    np.testing.assert_allclose(found.low[4], mean * low)


def test_heavy_tails_are_stated_where_biases_decide_and_not_elsewhere():
    rng = np.random.default_rng(3)
    units = scenes(rng, 11, bias=0.3, scale=0.1, freedom=3)
    stated = coverage_of_heavy_tails(units, Parts.of(units, "features"), level=0.95)[0]
    assert np.isfinite(stated).mean() > 0.95
    assert abs(np.nanmean(stated) - share(bounds(units, pooled), 0.3**2 + 0.1**2)) < 0.05
    unbiased = scenes(rng, 11, bias=0.01, scale=0.3)
    assert np.isnan(coverage_of_heavy_tails(unbiased, Parts.of(unbiased, "features"), level=0.95)).all()


@pytest.mark.parametrize("resampled", ["within", "blocks"])
def test_other_intervals_stay_as_they_are(resampled):
    units = scenes(np.random.default_rng(4), 8, bias=0.3, scale=0.1)
    found = pooled(units, np.empty((0, 8)), curve_statistics, Method(), scales=SCALES)
    other = replace(units, resampled=resampled)
    assert with_biases(other, Parts.of(other, "features"), found, ROWS) is found
    assert np.isnan(coverage_of_heavy_tails(other, Parts.of(other, "features"), level=0.95)).all()
