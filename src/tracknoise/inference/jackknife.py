"""The jackknife: Student's and lognormal intervals, and standard deviations, from estimates without each unit.

Lognormal values
----------------

Where scenes differ much, the largest values decide a mean, and a sample with few scenes often has none of them. A
standard error from such a sample is too small. The logarithms y of the values of the units have no such tail. With
their variance s^2, the mean of a lognormal distribution is exp(c), c = mean of y + b s^2 / 2 with b = 1. Its interval
combines those of both terms (Zou, Huo and Taleban 2009):

    c - sqrt(t^2 v s^2 + (b / 2)^2 (s^2 - s^2 f / chi2_high)^2)  to
    c + sqrt(t^2 v s^2 + (b / 2)^2 (s^2 f / chi2_low - s^2)^2)    (lognormal)

v is the sum of the squared weights of the units, f the degrees of freedom of s^2, and t, chi2_low and chi2_high are
quantiles of Student's t and of chi-squared of f degrees. In s^2 all units count alike, except those smaller than the
median unit, which count less because their own error is larger.

For shares of mean p, y are logits and b = 1 - 2 p, to second order; in the second term s^2 and its bounds are at most
-log of p or of 1 - p. Where b is negative the ends change places.

Within groups, s^2 is about the mean of each group, c is that of the mean itself, and the weights are those of the
values: the mean is then that of these groups. Its second term only allows for skewness, and b is halved, which the
simulation shows to be enough. v s^2 then has one more term, for the sizes w of the units, which are random as well: the
variance of their logarithms within groups times the sum of the squares of (weight - w).

Values need not be lognormal. Except within groups, (lognormal) is therefore only used together with (student), by
(skewed). `python -m benchmarks.validity.intervals` measures both.

Source: G. Y. Zou, C. Y. Huo, J. Taleban, Environmetrics 20 (2009).

Student's intervals
-------------------

The standard error of a statistic g is that of its jackknife (Efron and Stein 1981). It uses g_i, the statistic of all n
units but the i-th. If unit i has a share w_i of the observations, it is

    se^2 = sum of (1 - w_i)^2 / (1 - 2 w_i + sum of w_j^2) (g - g_i)^2    (spread)

This is without bias for weighted means over units that vary alike: for these g - g_i is w_i / (1 - w_i) of unit i's
distance from g, whose variance the denominator has. Where all w_i are 1 / n, it is the usual one. The interval is g +-
t se, with Student's quantile of as many degrees of freedom as such an se^2 has (student): n - 1 where all units hold
the same, fewer where some outweigh the others (Bell and McCaffrey 2002).

For what is never negative g is the logarithm, for shares the logit, for correlations the inverse hyperbolic tangent
(Fisher 1915), so that bounds stay within limits. Where the g_i of a unit does not exist, as that of a share of 0, its
linear approximation stands for it.

With units drawn within s strata of n, g is the mean of g_i in each stratum, the factor is ((s n - 1) / (s n))^2 n / (n
- 1), and there are s (n - 1) degrees.

Scales and shares are means over units that may differ by factors. The values of the units are
(g - (1 - w_i) g_i) / w_i, before the logarithm. The lower bound is that of (lognormal), and the upper one that of
(lognormal) or of (student), whichever is higher. If the lower bound of (lognormal) exceeds the statistic, the values
are not lognormal, and that of (student) is used (skewed). For a share above a half the ends change places.

With units within groups, se^2 is s^2 times the sum of w_i^2, where s^2 is the variance of the units about the mean of
their group, and a term for sizes as in (lognormal) (within). Scales and shares have (lognormal) alone.

Such intervals contain the true value more often than bootstrap percentiles, corrected or not, and they need no draws:
`python -m benchmarks.validity.intervals`. Under two degrees of freedom they are too wide rather than too narrow.

Source of the degrees of freedom: R. Bell, D. McCaffrey, Survey Methodology 28 (2002).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from tracknoise.inference.conventions import LEVEL

_FREEDOM = np.geomspace(1.0, 10_000.0, 2001)
"""Degrees of freedom at which quantiles are computed; those between are interpolated."""


@dataclass(frozen=True, slots=True)
class Means:
    """Means over units on the scale of logarithms or logits."""

    # values, sizes: (units, ...): logarithms or logits of the units, and how much each unit holds, 0 where it has no
    # part
    values: NDArray[np.float64]
    sizes: NDArray[np.float64]
    # bend, limit: (...): b, and the largest s^2 in the second term
    bend: NDArray[np.float64]
    limit: NDArray[np.float64]


def lognormal_interval(means: Means, level: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two-sided intervals of means by (lognormal), on their scale. Returns low, high (...)."""
    weights = shares_of(means.sizes)
    added, below, above = _lognormal_parts(means, np.square(weights).sum(axis=0), None, level)
    middle = (weights * means.values).sum(axis=0) + added
    return middle - below, middle + above


def interval_within(
    means: Means, middle: NDArray[np.float64], weights: NDArray[np.float64], groups: NDArray[np.intp], level: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The same of means of these groups of units. Shapes: middle (...), weights (units, ...), groups (units,)."""
    of_sizes = np.square(weights - shares_of(means.sizes)).sum(axis=0) * variance_of_sizes(means.sizes, groups)
    _, below, above = _lognormal_parts(means, np.square(weights).sum(axis=0), groups, level, of_sizes)
    return middle - below, middle + above


def shares_of(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sizes (units, ...) over their sum; 0 where that is 0."""
    total = sizes.sum(axis=0)
    return np.asarray(sizes / np.where(total > 0, total, 1.0))


def variance_of_sizes(sizes: NDArray[np.float64], groups: NDArray[np.intp]) -> NDArray[np.float64]:
    """Variance of the logarithms of sizes (units, ...) within their groups."""
    present = sizes > 0
    return variance_of_units(np.log(np.where(present, sizes, 1.0)), present.astype(np.float64), groups)[0]


def _lognormal_parts(
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

    Shapes: values, sizes (units, ...), groups (units,); returns variance, freedom (...). The variance is NaN where a
    value is infinite.
    """
    counted = _alike(sizes)
    number = np.zeros(len(values), dtype=np.intp) if groups is None else groups
    squares = lost = total = freedom = np.zeros(np.broadcast_shapes(values.shape, sizes.shape)[1:])
    for group in np.unique(number):
        q, y = counted[number == group], values[number == group]
        held = np.maximum(q.sum(axis=0), np.finfo(np.float64).tiny)
        sum_q2 = np.square(q).sum(axis=0)
        with np.errstate(invalid="ignore"):  # where a value is infinite, such as the logarithm of 0, there is none
            squares = squares + (q * np.square(y - (q * y).sum(axis=0) / held)).sum(axis=0)
        lost, total = lost + sum_q2 / held, total + q.sum(axis=0)
        freedom = freedom + np.maximum(np.square(held) / np.where(sum_q2 > 0, sum_q2, np.inf) - 1, 0.0)
    apart = total - lost
    return squares / np.where(apart > 1e-12 * total, apart, np.inf), np.maximum(freedom, 1.0)


def _alike(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """How much each unit counts in a variance: alike, but for those smaller than the median of those that are there."""
    ordered = -np.sort(-sizes, axis=0)
    n_present = np.maximum((sizes > 0).sum(axis=0), 1)
    middle = [np.take_along_axis(ordered, place[None], axis=0)[0] for place in ((n_present - 1) // 2, n_present // 2)]
    median = (middle[0] + middle[1]) / 2
    return np.asarray(np.minimum(sizes, median) / np.where(median > 0, median, 1.0))


@lru_cache(maxsize=8)
def _quantiles(level: float) -> tuple[NDArray[np.float64], ...]:
    """Of every number of degrees of freedom f: Student's t, f / chi2_high and f / chi2_low."""
    tail, half = (1 - level) / 2, _FREEDOM / 2
    high, low = 2 * special.gammainccinv(half, tail), 2 * special.gammaincinv(half, tail)
    return np.asarray(special.stdtrit(_FREEDOM, 1 - tail), dtype=np.float64), _FREEDOM / high, _FREEDOM / low


Function = Callable[[NDArray[np.float64]], NDArray[np.float64]]
_SKEWED = ("log", "logit")
LEAST = 1 / 4
"""A unit whose value is 0 counts as this share of the mean, or as half an event if that is less."""
_SAME = 1e-12
"""Influences that are smaller than this, relative to the largest value, are rounding, and so are such shares."""


@dataclass(frozen=True, slots=True)
class Scale:
    """A scale on which a statistic has no limits: the limits, to the scale, from it, and its slope there.

    Shares within `_SAME` of a limit are at it: a product or a sum that is 0 or 1 on paper may be off by rounding.
    """

    low: float
    high: float
    to: Function
    back: Function
    slope: Function


SCALES: Mapping[str, Scale] = {
    "linear": Scale(-np.inf, np.inf, np.asarray, np.asarray, np.ones_like),
    "log": Scale(0.0, np.inf, np.log, np.exp, np.reciprocal),
    "logit": Scale(_SAME, 1.0 - _SAME, special.logit, special.expit, lambda share: 1 / (share * (1 - share))),
    "fisher": Scale(-1.0, 1.0, np.arctanh, np.tanh, lambda correlation: 1 / (1 - correlation**2)),
}


def student_interval(
    estimate: ArrayLike,
    jackknife: NDArray[np.float64],
    *,
    scale: str = "linear",
    level: float = LEVEL,
    n_units: ArrayLike | None = None,
    sizes: NDArray[np.float64] | None = None,
    strata: NDArray[np.intp] | None = None,
    groups: NDArray[np.intp] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two-sided intervals of any number of statistics by (student), of scales and shares by (skewed).

    Parameters
    ----------
    estimate : (...)
        The statistics of all units.
    jackknife : (units, ...)
        Those of all units but one; NaN where there is none.
    scale
        A name in `SCALES`.
    level
        Between 0 and 1.
    n_units : (...)
        How many units the statistics rest on, by default all; with strata, in each of these. Where they are fewer than
        2 there are no bounds.
    sizes : (units, ...)
        How much each unit holds of what is counted, by default the same, and 0 where it has no part; with strata all
        that have a part count alike, and strata without such units do not count.
    strata : (units,) intp
        The stratum of each unit, if there are several that hold the same.
    groups : (units,) intp
        The group of each unit, for intervals that hold for these groups only, by (within).

    Returns
    -------
    low, high : (...) float64
        NaN where the estimate is NaN or comes from fewer than two units, and where an upper bound is infinite. Also NaN
        for a share of 0 or 1, which does not show how rare an event is in other units. Both bounds of a size of 0, or
        of a correlation of -1 or 1, are equal to it, because these do not occur by chance.
    """
    value, to = np.asarray(estimate, dtype=np.float64), SCALES[scale]
    n = np.broadcast_to(len(jackknife) if n_units is None else np.asarray(n_units), value.shape)
    inside = (value > to.low) & (value < to.high)
    safe = np.where(inside, value, 0.5)
    middle, slope = to.to(safe), to.slope(safe)
    jackknife_inside = (jackknife > to.low) & (jackknife < to.high)
    linear = slope * (value - jackknife)
    moved = np.where(jackknife_inside, middle - to.to(np.where(jackknife_inside, jackknife, 0.5)), linear)
    held = np.ones((len(jackknife), *[1] * value.ndim)) if sizes is None else sizes
    if strata is not None:
        variance, freedom = _of_strata(moved, held > 0, np.maximum(n, 2), strata)
    else:
        variance, freedom = _of_sizes(moved, held) if groups is None else _of_groups(moved, held, groups)
    width = special.stdtrit(freedom, (1 + level) / 2) * np.sqrt(variance)
    ends = middle - width, middle + width
    if scale in _SKEWED and strata is None:
        ends = _skewed(safe, jackknife, held, ends, scale=scale, level=level, groups=groups)
    usable = (n > 1) & ~np.isnan(value) & (inside | (scale != "logit"))
    with np.errstate(over="ignore"):
        low, high = (np.where(inside, to.back(end), value) for end in ends)
    high = np.where(np.isinf(high), np.nan, high)
    return np.where(usable, low, np.nan), np.where(usable, high, np.nan)


def _skewed(
    value: NDArray[np.float64],
    jackknife: NDArray[np.float64],
    sizes: NDArray[np.float64],
    student: tuple[NDArray[np.float64], NDArray[np.float64]],
    *,
    scale: str,
    level: float,
    groups: NDArray[np.intp] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Bounds by (skewed) on the scale, of values inside its limits, from those by (student)."""
    to, w, shares = SCALES[scale], shares_of(sizes), scale == "logit"
    own_values = _own_values(value, jackknife, sizes, w, shares=shares)
    bend, limit = (1 - 2 * value, -np.log(np.minimum(value, 1 - value))) if shares else (1.0, np.inf)
    means = Means(to.to(own_values), sizes, np.asarray(bend), np.asarray(limit))
    middle = to.to(value)
    if groups is not None:
        return interval_within(means, middle, w * to.slope(value) / to.slope(own_values), groups, level)
    low, high = lognormal_interval(means, level)
    rises = means.bend > 0
    low = np.where(rises, np.where(low < middle, low, student[0]), np.minimum(low, student[0]))
    high = np.where(rises, np.maximum(high, student[1]), np.where(high > middle, high, student[1]))
    return low, high


def _own_values(
    value: NDArray[np.float64],
    jackknife: NDArray[np.float64],
    sizes: NDArray[np.float64],
    w: NDArray[np.float64],
    *,
    shares: bool,
) -> NDArray[np.float64]:
    """Values of the units, inside the limits of their scale: a value of 0 counts as half an event or as `LEAST`."""
    own_values = (value - (1 - w) * np.where(np.isnan(jackknife), value, jackknife)) / np.where(w > 0, w, 1.0)
    if shares:
        event = np.minimum(0.5 / np.maximum(sizes, 1.0), LEAST * np.minimum(value, 1 - value))
        own_values = np.clip(own_values, event, 1 - event)
    else:
        own_values = np.where(own_values > _SAME * value, own_values, LEAST * value)
    return np.where(w > 0, own_values, value)


def centred(jackknife: NDArray[np.float64], strata: NDArray[np.intp] | None = None) -> NDArray[np.float64]:
    """What leaving out each unit changes, beside what leaving out another of its stratum does, 0 where undefined.

    Shapes: jackknife (units, ...), strata (units,). `jackknife`: NaN where there is none.
    """
    groups = np.zeros(len(jackknife), dtype=np.intp) if strata is None else strata
    changes = np.empty_like(jackknife)
    for group in np.unique(groups):
        values = jackknife[groups == group]
        has_value = ~np.isnan(values)
        mean = np.where(has_value, values, 0.0).sum(axis=0) / np.maximum(has_value.sum(axis=0), 1)
        changes[groups == group] = np.where(has_value, values - mean, 0.0)
    return changes


def acceleration(jackknife: NDArray[np.float64], strata: NDArray[np.intp] | None = None) -> NDArray[np.float64]:
    """Acceleration a of BCa intervals (Efron 1987): a sixth of the skewness of the influences of the units.

    Returns (...). 0 where no unit has any influence.
    """
    influence = -centred(jackknife, strata)
    size = np.abs(influence).max(axis=0)
    scaled = influence / np.where(size > 0, size, 1.0)
    squares = (scaled**2).sum(axis=0)
    skewed: NDArray[np.float64] = (scaled**3).sum(axis=0) / (6 * np.where(squares > 0, squares, 1.0) ** 1.5)
    rounding = _SAME * np.abs(np.where(np.isnan(jackknife), 0.0, jackknife)).max(axis=0)
    return np.where(size > rounding, skewed, 0.0)


def parts(moved: NDArray[np.float64], sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """What each unit adds to the error of a statistic: their squares add up to (spread).

    Parameters
    ----------
    moved, sizes : (units, ...)
        By how much a statistic is more than it is without a unit, and how much the unit holds.
    """
    w = shares_of(sizes)
    return _jackknife_parts(moved, w, _apart(w))


def _jackknife_parts(
    moved: NDArray[np.float64], w: NDArray[np.float64], apart: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.asarray(moved * (1 - w) / np.sqrt(apart))


def degrees(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Degrees of freedom of (spread) for a mean over units that vary alike, whatever their sizes (units, ...).

    (spread) is x' A x with A = M' D M, where M takes the mean of weights w from each unit's x, and D holds
    w^2 / (1 - 2 w + sum of w^2); it has tr(A)^2 / tr(A^2) degrees (Bell and McCaffrey 2002), which is one less than
    the units where all weigh the same. Of A the trace is the sum of w^2.
    """
    w = shares_of(sizes)
    return _degrees(w, _apart(w))


def _degrees(w: NDArray[np.float64], apart: NDArray[np.float64]) -> NDArray[np.float64]:
    squares = np.square(w)
    d, square = squares / apart, squares.sum(axis=0)
    d0, (d1, d2) = d.sum(axis=0), (np.einsum("i...,i...->...", d, term) for term in (w, squares))
    cross = square**2 * d0**2 + 2 * d0 * d2 - 4 * square * d0 * d1 + 2 * d1**2
    total = cross + np.einsum("i...,i...->...", np.square(d), 1 + 2 * (square - 2 * w))
    degrees: NDArray[np.float64] = square**2 / np.where(total > 0, total, 1.0)
    highest = max(len(w) - 1.0, 1.0)
    return np.clip(degrees, 1.0, highest)  # rounding may lead out of it where one unit outweighs all others


def _apart(w: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variance of a unit's distance from the mean of weights w, in units of its own; 1 where it is all there is."""
    squares = np.square(w)
    of_others: NDArray[np.float64] = squares.sum(axis=0) - squares
    return np.where(w < 1, np.square(1 - w) + np.maximum(of_others, 0.0), 1.0)


def _of_sizes(moved: NDArray[np.float64], sizes: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Variance, and its degrees of freedom, of units of one kind; a unit without influence adds 0."""
    w = shares_of(sizes)
    apart = _apart(w)
    added = _jackknife_parts(np.where(np.isnan(moved), 0.0, moved), w, apart)
    return np.square(added).sum(axis=0), _degrees(w, apart)


def _of_groups(
    moved: NDArray[np.float64], sizes: NDArray[np.float64], groups: NDArray[np.intp]
) -> tuple[NDArray[np.float64], ...]:
    """The same by (within)."""
    w = shares_of(sizes)
    apart = np.where(np.isnan(moved), 0.0, moved) * (1 - w) / np.where(w > 0, w, 1.0)
    variance, freedom = variance_of_units(apart, sizes, groups)
    of_sizes = variance_of_sizes(sizes, groups) * np.square(w * apart).sum(axis=0)
    return np.asarray(variance * np.square(w).sum(axis=0) + of_sizes), freedom


def _of_strata(
    moved: NDArray[np.float64], present: NDArray[np.bool_], n: NDArray[np.intp], strata: NDArray[np.intp]
) -> tuple[NDArray[np.float64], ...]:
    """The same of units in strata of n units each, of which those with a unit `present` count."""
    has_units = np.stack([present[strata == stratum].any(axis=0) for stratum in np.unique(strata)])
    n_strata = np.maximum(has_units.sum(axis=0), 1)
    factor = (1 - 1 / (n_strata * n)) ** 2 * n / (n - 1)
    squares: NDArray[np.float64] = np.square(centred(moved, strata)).sum(axis=0)
    return np.asarray(factor * squares), np.asarray(n_strata * (n - 1.0))


BLOCKS = 10


def jackknife(rows: NDArray[np.float64], estimate: Callable[[NDArray[np.float64]], float]) -> tuple[float, float]:
    """An estimate from rows in the order of time, and its standard deviation.

    Parameters
    ----------
    rows
        (n, ...) float64, n at least 2.
    estimate
        Makes the estimate of some of the rows.
    """
    blocks = np.array_split(np.arange(len(rows)), min(BLOCKS, len(rows)))
    left_out = [estimate(np.delete(rows, block, axis=0)) for block in blocks]
    return estimate(rows), float(np.sqrt((len(blocks) - 1) * np.var(left_out)))
