"""Share of intervals that contain the true value, in data for which this is not known from the tests of the method.

Intervals were tested with scenes whose logarithms have a standard deviation of up to `MOST_SPREAD`, and with weights
that are as good as `MIN_SCENES` equal scenes (`python -m benchmarks.validity.intervals`). Outside this range the share
is measured: many sets of scenes are drawn from a Gaussian (for scales, on the logarithmic scale) with the number, the
spread and the effective number of scenes of the data, and each set gets its interval. Spread and effective number are
rounded, so that few such simulations are needed.

Where squared scales of scenes have an inverse gamma distribution, errors of all scenes together have Student's, and a
few large values decide a mean over scenes. A few scenes do not show such a tail. The share of intervals that contain
the true value is measured in the same way, with scenes of the same number and spread. Their degrees of freedom are
those that lead to the spread, but not below `FREEDOM`; what is left of the spread is Gaussian. Where the logarithms of
the data are less skewed than those of 95 % of the simulated sets, this tail is excluded.

Where single errors have a heavy tail, a few of them decide a second moment. Each scene's second moment over the square
of its mean absolute error, mean over scenes, tells whether they have: it is pi / 2 of a Gaussian. It does not tell how
heavy the tail is, because sums of heavy-tailed steps look lighter than they are. Above the median of Student's
distribution with `LIGHT` degrees of freedom the share is therefore measured with errors of few degrees (`TAILS`,
whichever leads to a nearer ratio), with as many scenes, and as many errors in each.
"""

import math
from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.inference.jackknife import student_interval
from tracknoise.inference.units import MIN_SCENES

MOST_SPREAD = 1.4
"""Largest tested standard deviation between scenes of the logarithm: a factor of 4."""
RUNS = 4000
"""Simulated sets of scenes."""
TOLERATED = 0.02
"""Coverage that may be lost before it is stated."""
FREEDOM = 3.0
"""Fewest degrees of freedom of the heavy tail of scales; with two or less there is no mean."""
TAILS, LIGHT = (2.5, 3.0), 8.0
"""Degrees of freedom of simulated errors, and from how many on nothing is stated."""
EXCLUDED = 0.05
"""Share of simulated sets that would wrongly exclude the heavy tail."""
_STEP = 0.2
"""Spreads are rounded to multiples of this."""
_RATIO = 1.15
"""Numbers of scenes are rounded to powers of this where they are large."""
_MOST = 1000
"""Simulated scenes of a set, where there are more: with 2,000 or 4,000 the share differs by less than .04."""
_RUNS_OF_ERRORS, _MOST_SCENES = 400, 40
"""Simulated sets of scenes with single errors, and scenes of such a set, where there are more."""
_ERRORS = (8, 32, 128)
"""Simulated errors of a scene."""
_AT_ONCE = 2**17
"""Simulated scenes that get their intervals at once: their arrays stay in a processor's cache."""


def coverage_outside(
    n_units: NDArray[np.intp],
    spread: NDArray[np.float64],
    n_effective: NDArray[np.float64],
    scale: str,
    *,
    level: float,
) -> NDArray[np.float64]:
    """Measured share of intervals that contain the true value, NaN inside the tested range.

    Parameters
    ----------
    n_units, spread, n_effective : (points,)
        Number of scenes or groups, their spread, and how many equal ones they are worth.
    scale
        Of the statistic; a name in `tracknoise.inference.jackknife.SCALES`.
    level
        Of the intervals.
    """
    skewed = scale in ("log", "logit")
    beyond = (spread > MOST_SPREAD) & skewed
    outside = (n_units >= MIN_SCENES) & ~np.isnan(spread) & (beyond | (n_effective < MIN_SCENES))
    coverage = np.full(n_units.shape, np.nan)
    for place in np.flatnonzero(outside):
        n = rounded_count(float(n_units[place]), least=MIN_SCENES)
        effective = min(rounded_count(float(n_effective[place]), least=1), n)
        between = round(float(spread[place]) / _STEP) * _STEP if skewed else 1.0
        coverage[place] = _covered(n, between, effective, level, skewed=skewed)
    return coverage


def coverage_of_heavy_scales(
    own: NDArray[np.float64], n_units: NDArray[np.intp], *, power: float, level: float
) -> NDArray[np.float64]:
    """Share of intervals of a mean scale that contain the true value if scales have a heavy tail.

    Parameters
    ----------
    own : (points, scenes)
        Each scene's own value; NaN where it has none.
    n_units : (points,)
        Number of scenes or groups that are resampled.
    power
        Of the squared scale that the values are: 1 of second moments, a half of mean absolute errors.
    level
        Of the intervals.

    Returns
    -------
    (points,) float64
        NaN where the tail is excluded, or costs no more than `TOLERATED`.
    """
    has_value = ~np.isnan(own)
    count = has_value.sum(axis=1)
    enough = (np.minimum(n_units, count) >= MIN_SCENES) & ((own > 0) | ~has_value).all(axis=1)
    spread, skewness = _spread_and_skewness(np.log(np.where(has_value & (own > 0), own, 1.0)) / power, has_value)
    asked = np.where(enough, np.round(spread / _STEP), 0.0).astype(np.intp)
    coverage = np.full(len(own), np.nan)
    for n, steps in np.unique(np.stack([n_units, asked])[:, asked > 0], axis=1).T.tolist():
        held, least_skewed = _covered_if_heavy(rounded_count(n, least=MIN_SCENES), steps * _STEP, power, level)
        chosen = (n_units == n) & (asked == steps) & (skewness >= least_skewed)
        coverage[chosen] = held
    return np.where(coverage < level - TOLERATED, coverage, np.nan)


@lru_cache(maxsize=4096)
def _covered_if_heavy(n: int, spread: float, power: float, level: float) -> tuple[float, float]:
    """Share of intervals of simulated scenes that contain the true mean, and a low quantile of their skewness."""
    rng = np.random.default_rng(n)
    half = max(_half_freedom(spread), FREEDOM / 2)
    rest = max(spread**2 - float(special.polygamma(1, half)), 0.0)
    logs = np.log(half) - np.log(rng.gamma(half, size=(n, RUNS))) + np.sqrt(rest) * rng.normal(size=(n, RUNS))
    true = half**power * np.exp(special.gammaln(half - power) - special.gammaln(half) + power**2 * rest / 2)
    sizes = np.ones((n, 1))
    intervals = [_intervals(np.exp(power * logs[:, part]), sizes, "log", level) for part in parts_of_runs(n)]
    low, high = np.concatenate(intervals, axis=1)
    held = float(((low <= true) & ~(high < true)).mean())
    skewness = _spread_and_skewness(logs.T, np.ones(logs.T.shape, dtype=np.bool_))[1]
    return held, float(np.quantile(skewness, EXCLUDED))


def _half_freedom(spread: float) -> float:
    """Half the degrees of freedom of an inverse gamma distribution whose logarithm has this standard deviation."""
    low, high = 1e-3, 1e6
    for _ in range(80):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if special.polygamma(1, middle) > spread**2 else (low, middle)
    return low


def _spread_and_skewness(
    logs: NDArray[np.float64], has_value: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Standard deviation and skewness between the scenes that are there, (points,). Shapes: (points, scenes)."""
    count = np.maximum(has_value.sum(axis=1), 1)
    apart = np.where(has_value, logs - (np.where(has_value, logs, 0.0).sum(axis=1) / count)[:, None], 0.0)
    second, third = ((apart**order).sum(axis=1) / count for order in (2, 3))
    skewness = np.where(second > 0, third, 0.0) / np.where(second > 0, second, 1.0) ** 1.5
    return np.sqrt(second * count / np.maximum(count - 1, 1)), skewness


def coverage_of_heavy_errors(
    second: NDArray[np.float64], absolute: NDArray[np.float64], n: NDArray[np.float64], *, level: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Share of intervals of second moments that contain the true value if single errors are heavy-tailed.

    Parameters
    ----------
    second, absolute, n : (points, scenes)
        Second moment, mean absolute error and number of errors of each scene; n is 0 where there are none.
    level
        Of the intervals.

    Returns
    -------
    pooled, geometric : (points,) float64
        Of means and of geometric means over scenes; NaN where tails are light or cost no more than `TOLERATED`.
    """
    ratio, kinds, of_kind = _ratios(second, absolute, n)
    coverage = np.full((2, len(second)), np.nan)
    for kind, (scenes, errors) in enumerate(kinds):
        tails = np.array([_tailed(scenes, errors, freedom, level) for freedom in TAILS])
        chosen = (of_kind == kind) & (ratio > _tailed(scenes, errors, LIGHT, level)[2])
        nearest = np.abs(ratio[chosen, None] - tails[:, 2]).argmin(axis=1)
        coverage[:, chosen] = tails[nearest, :2].T
    pooled, typical = np.where(coverage < level - TOLERATED, coverage, np.nan)
    return pooled, typical


def are_heavy(
    second: NDArray[np.float64], absolute: NDArray[np.float64], n: NDArray[np.float64], *, level: float
) -> NDArray[np.bool_]:
    """Whether single errors have a heavy tail, (points,). Parameters as in `coverage_of_heavy_errors`."""
    ratio, kinds, of_kind = _ratios(second, absolute, n)
    limits = np.array([*(_tailed(*kind, LIGHT, level)[2] for kind in kinds), np.inf])
    return np.asarray(ratio > limits[of_kind])


def _ratios(
    second: NDArray[np.float64], absolute: NDArray[np.float64], n: NDArray[np.float64]
) -> tuple[NDArray[np.float64], list[tuple[int, int]], NDArray[np.intp]]:
    """Mean ratios (points,), the numbers of scenes and errors to simulate, and which of these each point has; or -1."""
    usable = (n > 1) & (absolute > 0)
    count = usable.sum(axis=1)
    ratio = np.where(usable, second / np.where(usable, absolute, 1.0) ** 2, 0.0).sum(axis=1) / np.maximum(count, 1)
    usual = np.exp(np.where(usable, np.log(np.maximum(n, 1.0)), 0.0).sum(axis=1) / np.maximum(count, 1))
    size = np.abs(np.log(usual[:, None] / np.array(_ERRORS))).argmin(axis=1)
    of_kind = np.full(len(second), -1, dtype=np.intp)
    kinds: list[tuple[int, int]] = []
    for scenes, place in np.unique(np.stack([count, size])[:, count >= MIN_SCENES], axis=1).T.tolist():
        of_kind[(count == scenes) & (size == place)] = len(kinds)
        kinds.append((min(rounded_count(scenes, least=MIN_SCENES), _MOST_SCENES), _ERRORS[place]))
    return ratio, kinds, of_kind


@lru_cache(maxsize=1024)
def _tailed(scenes: int, errors: int, freedom: float, level: float) -> tuple[float, float, float]:
    """Shares of intervals that contain the true second moment: of the mean and of the geometric mean; median ratio."""
    rng = np.random.default_rng([scenes, errors])
    single = rng.standard_t(freedom, size=(errors, scenes, _RUNS_OF_ERRORS))
    second, absolute = (single**2).mean(axis=0), np.abs(single).mean(axis=0)
    true, sizes = freedom / (freedom - 2), np.ones((scenes, 1))
    logs = np.log(second) + np.log(errors / 2) - special.digamma(errors / 2)
    ends = _intervals(second, sizes, "log", level), _intervals(logs, sizes, "linear", level)
    shares = (
        float(((low <= aim) & ~(high < aim)).mean())
        for (low, high), aim in zip(ends, (true, np.log(true)), strict=True)
    )
    pooled, typical = shares
    return pooled, typical, float(np.median((second / absolute**2).mean(axis=0)))


def rounded_count(count: float, *, least: int) -> int:
    """A number of scenes, rounded so that few simulations are needed."""
    power = round(math.log(max(count, 1.0), _RATIO))
    return max(min(round(_RATIO**power), _MOST), least)


def parts_of_runs(n: int) -> Iterator[slice]:
    """Slices of the `RUNS` simulated sets of n scenes, which limit the memory of their intervals."""
    length = max(_AT_ONCE // n, 1)
    return (slice(first, first + length) for first in range(0, RUNS, length))


@lru_cache(maxsize=4096)
def _covered(n: int, spread: float, effective: int, level: float, *, skewed: bool) -> float:
    """Share of intervals of simulated scenes that contain the true mean."""
    logs = spread * np.random.default_rng(n).normal(size=(n, RUNS))
    values, true = (np.exp(logs), np.exp(spread**2 / 2)) if skewed else (logs, 0.0)
    sizes, scale = _sizes(n, effective)[:, None], "log" if skewed else "linear"
    intervals = [_intervals(values[:, part], sizes, scale, level) for part in parts_of_runs(n)]
    low, high = np.concatenate(intervals, axis=1)
    return float(((low <= true) & ~(high < true)).mean())


def _intervals(
    values: NDArray[np.float64], sizes: NDArray[np.float64], scale: str, level: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Those of the means of values of scenes (scenes, runs)."""
    total = (sizes * values).sum(axis=0)
    without = (total - sizes * values) / (sizes.sum() - sizes)
    return student_interval(total / sizes.sum(), without, scale=scale, level=level, sizes=sizes)


def _sizes(n: int, effective: int) -> NDArray[np.float64]:
    """Sizes of n scenes, lognormal by their quantiles, that are worth as many equal ones as given."""
    z = special.ndtri((np.arange(n) + 0.5) / n)
    low, high = 0.0, 20.0
    for _ in range(40):
        middle = (low + high) / 2
        sizes = np.exp(middle * (z - z[-1]))
        if sizes.sum() ** 2 / np.square(sizes).sum() > effective:
            low = middle
        else:
            high = middle
    return np.asarray(np.exp(low * (z - z[-1])))
