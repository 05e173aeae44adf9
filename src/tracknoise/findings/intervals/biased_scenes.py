"""Intervals of second moments over scenes that have biases of their own.

A second moment is the mean over scenes of a variance within scenes, W, and of a squared bias, B. Variances differ by
factors, so that their logarithms are close to Gaussian. Biases are close to Gaussian themselves, and some are near
zero: the logarithms of their squares have a long tail. Each part therefore has its own interval, and both are combined
(Zou, Huo and Taleban 2009):

    W + B - sqrt(w^2 + b^2 + 2 r w b), w = W - W_low, b = B (1 - d / chi2_high)  to
    W + B + sqrt(w^2 + b^2 + 2 r w b), w = W_high - W, b = B (d / chi2_low - 1)    (biased)

W_low and W_high are those of `tracknoise.findings.sampling.jackknife` on the logarithmic scale. chi2_low and chi2_high
are quantiles of chi-squared of d degrees. If biases are Gaussian, of mean m and variance s^2, B varies as if d were
n (m^2 + s^2)^2 / (s^4 + 2 m^2 s^2), where n scenes of equal size would be as good. d is that or 2 B^2 over the variance
of B among scenes, whichever is less, times (n - 1) / n. r is the correlation of both parts among scenes, or 0 if that
is negative.

Source: G. Y. Zou, C. Y. Huo, J. Taleban, Environmetrics 20 (2009).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.findings.estimate import EstimateArray
from tracknoise.findings.sampling.bounds import Method, column_means, pooled
from tracknoise.findings.sampling.lognormal import shares_of
from tracknoise.findings.sampling.units import SUMS, Units
from tracknoise.tables.enumerations import IntervalKind, Resampled, Weighting

Array = NDArray[np.float64]

OF_SCENES = (Resampled.scenes, Resampled.groups)
"""What is resampled where (biased) is used."""
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
        size = n if pooled_features else (n > 1).astype(np.float64)
        each = np.ones_like(n) if pooled_features else size / np.maximum(n - 1, 1.0)
        parts = (first * each, squares * each, np.maximum(second - squares, 0.0) * each)
        return cls(units.joined(size), *(units.joined(part) for part in parts))


def with_biases(units: Units, parts: Parts, estimates: EstimateArray, rows: Sequence[int]) -> EstimateArray:
    """The same with intervals of second moments by (biased), if scenes or groups of them are resampled.

    Parameters
    ----------
    units
        Of one condition, with the columns `SUMS`.
    parts
        Of their second moments, with the weighting of the estimates.
    estimates
        Student's intervals, (statistics, points); others stay as they are.
    rows
        Where the second moments of u and of v are among the statistics.
    """
    if estimates.kind != IntervalKind.student or units.resampled not in OF_SCENES:
        return estimates
    place = list(rows)
    low, high = biased_interval(parts, _variance(units, parts, estimates.level), estimates.value[place])
    known = np.isfinite(low) & np.isfinite(high) & np.isfinite(estimates.high[place])
    lows, highs = estimates.low.copy(), estimates.high.copy()
    lows[place], highs[place] = np.where(known, low, lows[place]), np.where(known, high, highs[place])
    return replace(estimates, low=lows, high=highs)


def biased_interval(parts: Parts, within: EstimateArray, value: Array) -> tuple[Array, Array]:
    """Bounds by (biased), (2, points); NaN or infinite where there are none.

    Parameters
    ----------
    parts
        Of the second moments.
    within
        Mean variance W with its bounds, (2, points).
    value : (2, points)
        The second moments; they are more than W + B by a factor of n / (n - 1), if all n features are pooled.
    """
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
