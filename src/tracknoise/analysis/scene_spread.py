"""How much scenes differ, and intervals that hold for scenes that have biases of their own.

A second moment is the mean over scenes of a variance within scenes, W, and of a squared bias, B. Variances differ by
factors, so that their logarithms are close to Gaussian. Biases are close to Gaussian themselves, and some are near
zero: the logarithms of their squares have a long tail. Each part therefore has its own interval, and both are combined
(Zou, Huo and Taleban 2009):

    W + B - sqrt(w^2 + b^2 + 2 r w b), w = W - W_low, b = B (1 - d / chi2_high)  to
    W + B + sqrt(w^2 + b^2 + 2 r w b), w = W_high - W, b = B (d / chi2_low - 1)    (biased)

W_low and W_high are those of `tracknoise.inference.jackknife` on the logarithmic scale. chi2_low and chi2_high
are quantiles of chi-squared of d degrees. If biases are Gaussian, of mean m and variance s^2, B varies as if d were
n (m^2 + s^2)^2 / (s^4 + 2 m^2 s^2), where n scenes of equal size would be as good. d is that or 2 B^2 over the variance
of B among scenes, whichever is less, times (n - 1) / n. r is the correlation of both parts among scenes, or 0 if that
is negative.

Source: G. Y. Zou, C. Y. Huo, J. Taleban, Environmetrics 20 (2009).

Coverage of intervals of second moments if the biases of scenes have heavy tails, which a few scenes do not show.

It is that of simulated scenes whose number, share of squared biases and spread of variances are those of the data, and
whose biases have Student's distribution of 3 degrees of freedom. It is stated where heavy tails would cost more than
`TOLERATED` of the coverage. `python -m benchmarks.validity.differing_scenes` measures what they cost.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.analysis.condition_units import SUMS
from tracknoise.inference.conventions import IntervalKind
from tracknoise.inference.coverage import (
    RUNS,
    TOLERATED,
    coverage_of_heavy_scales,
    coverage_outside,
    parts_of_runs,
    rounded_count,
)
from tracknoise.inference.estimates import EstimateArray
from tracknoise.inference.intervals import BetweenScenes, Method, Statistics, column_means, pooled
from tracknoise.inference.jackknife import shares_of, student_interval
from tracknoise.inference.next_scene import next_scene
from tracknoise.inference.units import MIN_SCENES, Resampled, Units, by_number
from tracknoise.tables.enumerations import Weighting

Array = NDArray[np.float64]

OF_SCENES = (Resampled.scenes, Resampled.groups)
"""What is resampled where (biased) is used, and where coverage was tested."""


def between_scenes(
    units: Units, statistics: Statistics, scales: Sequence[str], estimates: EstimateArray
) -> BetweenScenes:
    """How much scenes differ in their own statistics."""
    own = own_values(units, statistics)
    between = next_scene(units, own, scales, level=estimates.level)
    unknown = np.full_like(between.spread, np.nan)
    return with_estimates(BetweenScenes(between.spread, between.low, between.high, unknown), units, scales, estimates)


def own_values(units: Units, statistics: Statistics) -> NDArray[np.float64]:
    """Statistics of the sums of each scene, (statistics, points, scenes)."""
    return statistics(np.transpose(by_number(units.scene, units.sums), (2, 1, 0)))


def spread_on(units: Units, statistics: Statistics, scale: str, *, level: float) -> NDArray[np.float64]:
    """Standard deviation between scenes, (statistics, points), of all statistics on one scale: see `between_scenes`."""
    own = own_values(units, statistics)
    return next_scene(units, own, [scale] * len(own), level=level).spread


def with_estimates(
    between: BetweenScenes, units: Units, scales: Sequence[str], estimates: EstimateArray
) -> BetweenScenes:
    """The same beside other estimates of the same statistics, whose coverage is asked for.

    Where values of scenes are far from Gaussian, the interval of an estimate can reach beyond the prediction for one
    scene. The prediction is then widened to contain it.
    """
    low = np.where(np.isnan(between.next_low), np.nan, np.fmin(between.next_low, estimates.low))
    high = np.where(np.isnan(between.next_high), np.nan, np.fmax(between.next_high, estimates.high))
    coverage = _coverage(estimates, units, between.spread, scales)
    return replace(between, next_low=low, next_high=high, coverage=coverage)


def with_coverage(between: BetweenScenes, rows: Sequence[int], coverage: NDArray[np.float64]) -> BetweenScenes:
    """The same with the coverage of some statistics, (rows, points), where that is known and lower."""
    lowest = between.coverage.copy()
    lowest[list(rows)] = np.fmin(lowest[list(rows)], coverage)
    return replace(between, coverage=lowest)


def with_heavy_scales(
    between: BetweenScenes, own: Array, estimates: EstimateArray, powers: Mapping[int, float]
) -> BetweenScenes:
    """The same with the coverage of some statistics if the scales of scenes have a heavy tail.

    `own`: (statistics, points, scenes), of each scene. `powers`: of the squared scale, by row.
    """
    widened = between
    for row, power in powers.items():
        covered = coverage_of_heavy_scales(own[row], estimates.n_units[row], power=power, level=estimates.level)
        widened = with_coverage(widened, [row], covered[None])
    return widened


def geometric_rows(between: BetweenScenes, rows: Sequence[int]) -> BetweenScenes:
    """Of some of the statistics, beside their geometric means: these are tested with any spread."""
    spread, low, high = (array[list(rows)] for array in (between.spread, between.next_low, between.next_high))
    return BetweenScenes(spread, low, high, np.full(spread.shape, np.nan))


def _coverage(
    estimates: EstimateArray, units: Units, spread: NDArray[np.float64], scales: Sequence[str]
) -> NDArray[np.float64]:
    """Coverage of intervals of estimates, (statistics, points), NaN inside the tested range."""
    tested = estimates.kind == IntervalKind.student and units.resampled in OF_SCENES
    if not tested or estimates.n_effective is None:
        return np.full(spread.shape, np.nan)
    parts = zip(estimates.n_units, spread, estimates.n_effective, scales, strict=True)
    return np.stack([coverage_outside(n, own, worth, scale, level=estimates.level) for n, own, worth, scale in parts])


_DEGREES = (1.0, 1e6)


@dataclass(frozen=True, slots=True)
class Parts:
    """Parts of the second moments of u and v, by unit.

    Attributes
    ----------
    sizes : (units, points, 1)
        How much each unit counts; 0 where it has no part.
    biases, squares, variances : (units, points, 2)
        Mean error, its square, and variance within the unit, each times the size.
    """

    sizes: Array
    biases: Array
    squares: Array
    variances: Array

    @classmethod
    def of(cls, units: Units, weighting: Weighting) -> "Parts":
        """Of units with the columns `SUMS`, for the second moment of all features or the mean over scenes."""
        sums = {name: units.sums[..., row, None] for row, name in enumerate(SUMS)}
        n = sums["n"]
        first, second = (np.concatenate([sums[u], sums[v]], axis=-1) for u, v in (("u", "v"), ("uu", "vv")))
        squares = np.square(first) / np.maximum(n, 1.0)
        pooled_features = weighting == Weighting.features
        size = n if pooled_features else (n > 0).astype(np.float64)
        each = np.ones_like(n) if pooled_features else size / np.maximum(n, 1.0)
        parts = (first * each, squares * each, np.maximum(second - squares, 0.0) * each)
        return cls(units.joined(size), *(units.joined(part) for part in parts))


def with_biases(units: Units, parts: Parts, estimates: EstimateArray, rows: Sequence[int]) -> EstimateArray:
    """The same with intervals of second moments by (biased), if scenes or groups of them are resampled.

    `units`: of one condition, with the columns `SUMS`.
    """
    if estimates.kind != IntervalKind.student or units.resampled not in OF_SCENES:
        return estimates
    place = list(rows)
    low, high = biased_interval(parts, _variance(units, parts, estimates.level), estimates.value[place])
    bounded = np.isfinite(low) & np.isfinite(high) & np.isfinite(estimates.high[place])
    lows, highs = estimates.low.copy(), estimates.high.copy()
    lows[place], highs[place] = np.where(bounded, low, lows[place]), np.where(bounded, high, highs[place])
    return replace(estimates, low=lows, high=highs)


def biased_interval(parts: Parts, within: EstimateArray, value: Array) -> tuple[Array, Array]:
    """Bounds by (biased), (2, points); NaN or infinite where there are none. Shapes: value (2, points)."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        mean = (parts.squares.sum(axis=0) / parts.sizes.sum(axis=0)).T
        degrees = _degrees(parts).T
        tail = (1 - within.level) / 2
        least, most = (2 * inverse(degrees / 2, tail) for inverse in (special.gammaincinv, special.gammainccinv))
        factor = value / (within.value + mean)
        related = _correlation(parts).T
        below = _combined(within.value - within.low, mean * (1 - degrees / most), related)
        above = _combined(within.high - within.value, mean * (degrees / least - 1), related)
        return value - factor * below, value + factor * above


def spread_of_biases(parts: Parts) -> tuple[Array, Array]:
    """Squared mean m^2 and variance s^2 of the biases of units, (points, 2); NaN where there are fewer than two."""
    weights = shares_of(parts.sizes)
    together = np.square(weights).sum(axis=0)
    total = parts.sizes.sum(axis=0)
    squared = np.square(parts.biases.sum(axis=0) / total)
    variance = np.maximum(parts.squares.sum(axis=0) / total - squared, 0.0) / (1 - together)
    return np.maximum(squared - together * variance, 0.0), variance


def _variance(units: Units, parts: Parts, level: float) -> EstimateArray:
    """Mean variance within scenes, (2, points)."""
    sums = np.concatenate([parts.sizes, parts.variances], axis=-1)
    joined = replace(units, sums=sums, scene=np.arange(len(sums)), group=None, resampled=Resampled.scenes)
    return pooled(
        joined, np.empty((0, len(sums))), column_means, Method(IntervalKind.student, level), scales=["log"] * 2
    )


def _combined(one: Array, other: Array, correlation: Array) -> Array:
    """How far the end of a sum lies from it, from the distances of the ends of its parts."""
    return np.sqrt(one**2 + other**2 + 2 * correlation * one * other)


def _correlation(parts: Parts) -> Array:
    """The r of (biased), (points, 2)."""
    weights = shares_of(parts.sizes)
    own = [part / np.where(parts.sizes > 0, parts.sizes, 1.0) for part in (parts.squares, parts.variances)]
    a, b = (weights * (values - (weights * values).sum(axis=0)) for values in own)
    products = (a * b).sum(axis=0) / np.sqrt(np.square(a).sum(axis=0) * np.square(b).sum(axis=0))
    return np.asarray(np.clip(np.nan_to_num(products), 0.0, 1.0))


def _degrees(parts: Parts) -> Array:
    """The d of (biased), (points, 2)."""
    weights = shares_of(parts.sizes)
    together = np.square(weights).sum(axis=0)
    mean = parts.squares.sum(axis=0) / parts.sizes.sum(axis=0)
    own = parts.squares / np.where(parts.sizes > 0, parts.sizes, 1.0)
    variance = np.square(weights * (own - mean)).sum(axis=0) / (1 - together)
    m2, s2 = spread_of_biases(parts)
    gaussian = np.square(m2 + s2) / (s2 * (s2 + 2 * m2)) / together
    return np.asarray(np.clip(np.fmin(gaussian, 2 * mean**2 / variance) * (1 - together), *_DEGREES))


_STEP = 0.2
"""Shares and spreads are rounded to multiples of this."""


def coverage_of_heavy_tails(units: Units, parts: Parts, *, level: float) -> Array:
    """Coverage of the intervals of `tracknoise.analysis.scene_spread` if biases are heavy-tailed.

    Returns (2, points). Of u and of v; NaN where it is the level to within `TOLERATED`, or where no scenes are
    resampled. `units`: of one condition, with the columns of `tracknoise.analysis.condition_units.SUMS`.
    """
    coverage = np.full(parts.biases.shape[1:], np.nan)
    if units.resampled in OF_SCENES:
        shares, spreads = _share_of_biases(parts), _log_spread(parts)
        counts = (parts.sizes[..., 0] > 0).sum(axis=0)
        for place in zip(*np.nonzero(shares >= _STEP), strict=True):
            share, spread = (round(float(part[place]) / _STEP) * _STEP for part in (shares, spreads))
            coverage[place] = _covered(rounded_count(float(counts[place[0]]), least=MIN_SCENES), share, spread, level)
    return np.where(coverage < level - TOLERATED, coverage, np.nan).T


def _share_of_biases(parts: Parts) -> Array:
    """Share of the second moment that is the variance of biases between scenes, (points, 2); 0 where unknown."""
    with np.errstate(divide="ignore", invalid="ignore"):
        total = (parts.squares + parts.variances).sum(axis=0) / parts.sizes.sum(axis=0)
        share = spread_of_biases(parts)[1] / total
    return np.asarray(np.clip(np.nan_to_num(share, posinf=0.0), 0.0, 1.0))


def _log_spread(parts: Parts) -> Array:
    """Standard deviation between units of the logarithm of their own variance, 0 where there are fewer than two."""
    own = parts.variances / np.where(parts.sizes > 0, parts.sizes, 1.0)
    there = own > 0
    logs = np.where(there, np.log(np.where(there, own, 1.0)), 0.0)
    count = there.sum(axis=0)
    mean = logs.sum(axis=0) / np.maximum(count, 1)
    return np.asarray(np.sqrt((there * np.square(logs - mean)).sum(axis=0) / np.maximum(count - 1, 1)))


@lru_cache(maxsize=4096)
def _covered(n: int, share: float, spread: float, level: float) -> float:
    """Share of intervals of simulated scenes that contain the true second moment, 1."""
    heavy, gaussian = _drawn(n)
    biases = np.sqrt(share / 3) * heavy
    variances = (1 - share) * np.exp(spread * gaussian - spread**2 / 2)
    intervals = [_intervals(biases[:, part], variances[:, part], level) for part in parts_of_runs(n)]
    low, high = np.concatenate(intervals, axis=2)
    return float(((low <= 1) & (high >= 1)).mean())


@lru_cache(maxsize=1)
def _drawn(n: int) -> tuple[Array, Array]:
    """Of Student's distribution of 3 degrees of freedom, and of a Gaussian, for `RUNS` sets of n scenes."""
    rng, shape = np.random.default_rng(n), (n, RUNS, 1)
    return rng.standard_t(3, size=shape), rng.normal(size=shape)


def _intervals(biases: Array, variances: Array, level: float) -> tuple[Array, Array]:
    """Those of the second moments of scenes of such biases and variances, (scenes, runs, 1)."""
    parts = Parts(np.ones_like(biases), biases, np.square(biases), variances)
    within, total = variances.mean(axis=0), variances.sum(axis=0)
    low, high = student_interval(within, (total - variances) / (len(biases) - 1), scale="log", level=level)
    units, kind = np.full(within.T.shape, len(biases)), IntervalKind.student
    estimates = EstimateArray(within.T, low.T, high.T, units, units, kind, level)
    return biased_interval(parts, estimates, (within + parts.squares.mean(axis=0)).T)
