"""Interval of a mean over units whose values are lognormal, or shares whose logits are Gaussian: arrays only.

Where scenes differ much, the largest values decide a mean, and a sample with few scenes often has none of them. A
standard error from such a sample is too small. The logarithms y of the values of the units have no such tail. With
their variance s^2, the mean of a lognormal distribution is exp(c), c = mean of y + b s^2 / 2 with b = 1. Its interval
combines those of both terms (Zou, Huo and Taleban 2009):

    c - sqrt(t^2 v s^2 + (b / 2)^2 (s^2 - s^2 f / chi2_high)^2)  to
    c + sqrt(t^2 v s^2 + (b / 2)^2 (s^2 f / chi2_low - s^2)^2)    (lognormal)

v is the sum of the squared weights of the units, f the degrees of freedom of s^2, and t, chi2_low and chi2_high are
quantiles of Student's t and of chi-squared of f degrees. For shares of mean p, y are logits and b = 1 - 2 p, to second
order; in the second term s^2 and its bounds are at most -log of p or of 1 - p. Where b is negative the ends change
places.

In s^2 all units count alike, except those smaller than the median unit, which count less because their own error is
larger. Within groups, s^2 is about the mean of each group, c is that of the mean itself, and the weights are those of
the values: the mean is then that of these groups. Its second term only allows for skewness, and b is halved, which the
simulation shows to be enough. v s^2 then has one more term, for the sizes w of the units, which are
random as well: the variance of their logarithms within groups times the sum of the squares of (weight - w).

Values need not be lognormal: (lognormal) is only used together with the interval of the jackknife
(`tracknoise.findings.sampling.jackknife`). `python -m benchmarks.validity.intervals` measures both.

Source: G. Y. Zou, C. Y. Huo, J. Taleban, Environmetrics 20 (2009).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import special

_FREEDOM = np.geomspace(1.0, 10_000.0, 2001)
"""Degrees of freedom at which quantiles are computed; those between are interpolated."""


@dataclass(frozen=True, slots=True)
class Means:
    """Means over units on the scale of logarithms or logits.

    Attributes
    ----------
    values, sizes : (units, ...)
        Logarithms or logits of the units, and how much each unit holds, 0 where it has no part.
    bend, limit : (...)
        b, and the largest s^2 in the second term.
    """

    values: NDArray[np.float64]
    sizes: NDArray[np.float64]
    bend: NDArray[np.float64]
    limit: NDArray[np.float64]


def lognormal_interval(means: Means, level: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two-sided intervals of means by (lognormal), on their scale.

    Parameters
    ----------
    means
        Of units that are independent.
    level
        Between 0 and 1.

    Returns
    -------
    low, high : (...) float64
    """
    weights = shares_of(means.sizes)
    added, below, above = _parts(means, np.square(weights).sum(axis=0), None, level)
    middle = (weights * means.values).sum(axis=0) + added
    return middle - below, middle + above


def interval_within(
    means: Means, middle: NDArray[np.float64], weights: NDArray[np.float64], groups: NDArray[np.intp], level: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The same of means of these groups of units.

    Parameters
    ----------
    means
        Of units that are independent within their group.
    middle : (...)
        The means, on their scale.
    weights : (units, ...)
        By how much a mean changes with the value of each unit.
    groups : (units,) intp
        The group of each unit.
    level
        Between 0 and 1.
    """
    of_sizes = np.square(weights - shares_of(means.sizes)).sum(axis=0) * variance_of_sizes(means.sizes, groups)
    _, below, above = _parts(means, np.square(weights).sum(axis=0), groups, level, of_sizes)
    return middle - below, middle + above


def shares_of(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sizes (units, ...) over their sum; 0 where that is 0."""
    total = sizes.sum(axis=0)
    return np.asarray(sizes / np.where(total > 0, total, 1.0))


def variance_of_sizes(sizes: NDArray[np.float64], groups: NDArray[np.intp]) -> NDArray[np.float64]:
    """Variance of the logarithms of sizes (units, ...) within their groups."""
    there = sizes > 0
    return variance_of_units(np.log(np.where(there, sizes, 1.0)), there.astype(np.float64), groups)[0]


def _parts(
    means: Means,
    squares: NDArray[np.float64],
    groups: NDArray[np.intp] | None,
    level: float,
    more: NDArray[np.float64] | float = 0.0,
) -> tuple[NDArray[np.float64], ...]:
    """B s^2 / 2, and how far the ends lie from c; `more` is added to v s^2."""
    variance, freedom = variance_of_units(means.values, means.sizes, groups)
    t, least, most = (np.interp(freedom, _FREEDOM, quantile) for quantile in _quantiles(level))
    of_mean = np.square(t) * (squares * variance + more)
    bend = means.bend if groups is None else means.bend / 2
    added, *ends = (bend / 2 * np.minimum(variance * part, means.limit) for part in (1.0, least, most))
    below, above = added - np.minimum(*ends), np.maximum(*ends) - added
    return added, np.sqrt(of_mean + np.square(below)), np.sqrt(of_mean + np.square(above))


def variance_of_units(
    values: NDArray[np.float64], sizes: NDArray[np.float64], groups: NDArray[np.intp] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Variance s^2 of values between units, about the mean of their group, and its degrees of freedom f.

    Parameters
    ----------
    values, sizes : (units, ...)
        Values, such as logarithms of others, and how much each unit holds, 0 where it has no part.
    groups : (units,) intp
        The group of each unit; by default all are of one.

    Returns
    -------
    variance, freedom : (...) float64
        The variance is NaN where a value is infinite.
    """
    counted = _alike(sizes)
    number = np.zeros(len(values), dtype=np.intp) if groups is None else groups
    squares = lost = total = freedom = np.zeros(np.broadcast_shapes(values.shape, sizes.shape)[1:])
    for group in np.unique(number):
        q, y = counted[number == group], values[number == group]
        held = np.maximum(q.sum(axis=0), np.finfo(np.float64).tiny)
        own = np.square(q).sum(axis=0)
        with np.errstate(invalid="ignore"):  # where a value is infinite, such as the logarithm of 0, there is none
            squares = squares + (q * np.square(y - (q * y).sum(axis=0) / held)).sum(axis=0)
        lost, total = lost + own / held, total + q.sum(axis=0)
        freedom = freedom + np.maximum(np.square(held) / np.where(own > 0, own, np.inf) - 1, 0.0)
    apart = total - lost
    return squares / np.where(apart > 1e-12 * total, apart, np.inf), np.maximum(freedom, 1.0)


def _alike(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """How much each unit counts in a variance: alike, but for those smaller than the median of those that are there."""
    ordered = -np.sort(-sizes, axis=0)
    there = np.maximum((sizes > 0).sum(axis=0), 1)
    middle = [np.take_along_axis(ordered, place[None], axis=0)[0] for place in ((there - 1) // 2, there // 2)]
    median = (middle[0] + middle[1]) / 2
    return np.asarray(np.minimum(sizes, median) / np.where(median > 0, median, 1.0))


@lru_cache(maxsize=8)
def _quantiles(level: float) -> tuple[NDArray[np.float64], ...]:
    """Of every number of degrees of freedom f: Student's t, f / chi2_high and f / chi2_low."""
    tail, half = (1 - level) / 2, _FREEDOM / 2
    high, low = 2 * special.gammainccinv(half, tail), 2 * special.gammaincinv(half, tail)
    return np.asarray(special.stdtrit(_FREEDOM, 1 - tail), dtype=np.float64), _FREEDOM / high, _FREEDOM / low
