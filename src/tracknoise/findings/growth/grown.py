"""What is fitted to the errors of one condition as they grow, with intervals: (growth) and (autocorrelation)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.growth.fit import TERMS, contributions, fit_freely, fit_growth, misfit
from tracknoise.findings.intervals.change_bounds import SUMS as CHANGES
from tracknoise.findings.intervals.change_bounds import correlated
from tracknoise.findings.sampling.bounds import Bounds, Method, pooled
from tracknoise.findings.sampling.resampling import leave_one_out
from tracknoise.findings.sampling.units import Draws, Units, units_of
from tracknoise.findings.shape.verdict import Interval
from tracknoise.tables.schema import ORIGIN

Array = NDArray[np.float64]

MIN_AGES = 4
"""Fewest ages of a fit."""
SUMS = ("n", "uu", "vv")
"""What a fit needs of each age: the count, and the sums of squared errors."""
ONE_STEP = pl.col("lag") == 1
"""Rows of `INCREMENTS` of which (autocorrelation) at one step is made: all that time structure needs."""
_MIN_UNITS = 4
_OWN = 0.05
"""How far off (growth) may be, relative to the second moment: that much is added to each age's standard error."""


@dataclass(frozen=True, slots=True)
class Fit:
    """(growth) of one coordinate.

    Attributes
    ----------
    sizes
        By term: white (px), walk (px per sqrt(frame)) and drift (px per frame).
    shares
        By term, of the fitted second moment, mean over the ages.
    misfit
        Root mean square of what is missed, relative to the second moment.
    """

    sizes: Mapping[str, Interval]
    shares: Mapping[str, Interval]
    misfit: float


def fit_ages(units: Units, *, min_features: int) -> NDArray[np.bool_]:
    """Which points are fitted: up to the first that rests on too few errors, or too few units.

    Parameters
    ----------
    units
        Points by `since`; columns `SUMS`.
    min_features
        Fewest errors of all units together.
    """
    n = units.sums[..., 0]
    enough = (n.sum(axis=0) >= min_features) & (np.count_nonzero(n, axis=0) >= min(_MIN_UNITS, len(n)))
    return np.logical_and.accumulate(enough)


def fitted(units: Units, weights: Array, ages: NDArray[np.bool_], method: Method) -> tuple[Fit, Fit]:
    """(growth) of u and of v.

    Parameters
    ----------
    units
        Points by `since`; columns `SUMS`.
    weights : (draws, units)
        How often each unit was drawn.
    ages : (points,)
        Which are fitted, at least `MIN_AGES`, with errors that are not all zero.
    method
        How to make intervals.
    """
    part = replace(units, sums=units.sums[:, ages], points=units.points.filter(pl.Series(ages)))
    since = part.points["since"].to_numpy().astype(np.float64)
    second, weight = _observed(part)

    def statistics(sums: Array) -> Array:
        """Coefficients, free and bounded, and shares of u, then of v, (18, 1, ...)."""
        return np.concatenate([_fit(sums, axis, second[axis], since, weight[axis]) for axis in (0, 1)])

    bounds = pooled(part, weights, statistics, method, sizes=part.sums[..., 0].sum(axis=1)[None])
    u, v = (_named(bounds, 9 * axis, second[axis], since, weight[axis]) for axis in (0, 1))
    return u, v


def neighbours(increments: pl.DataFrame) -> pl.DataFrame:
    """Rows of lag 1 of `INCREMENTS`, of which only what (autocorrelation) is made of is kept."""
    return increments.filter(ONE_STEP).select(*ORIGIN, "block", "trimming", *CHANGES)


def related(changes: pl.DataFrame, draws: Draws, method: Method, *, resampled: bool) -> tuple[Interval, Interval]:
    """(autocorrelation) at one step of u and of v.

    Parameters
    ----------
    changes
        What `neighbours` kept of one condition and trimming.
    draws, method
        How to make intervals.
    resampled
        Whether blocks may be resampled where scenes are few.
    """
    units = units_of(changes, changes if resampled else None, points=[], columns=CHANGES)
    bounds = correlated(units, draws.weights(units), method)
    return _interval(bounds, 0), _interval(bounds, 1)


def mean_drift(moments: pl.DataFrame) -> tuple[float, float]:
    """Mean error of u and of v per frame, px: what fits the mean errors of all ages, as a line through zero.

    Parameters
    ----------
    moments
        Columns since, n, u and v; at least one row.
    """
    since, n, u, v = moments.select("since", "n", "u", "v").to_numpy().astype(np.float64).T
    total = (n * since**2).sum()
    return float((since * u).sum() / total), float((since * v).sum() / total)


def _observed(units: Units) -> tuple[Array, Array]:
    """Second moments of u and v at each age, and their weights, (2, ages) each."""
    whole = _second(units.sums.sum(axis=0).T)
    without = _second(np.moveaxis(leave_one_out(units.sums), 0, -1).swapaxes(0, 1))
    influence = np.nan_to_num(without - whole[..., None])
    variance = (influence**2).sum(axis=-1) if units.resampled else np.zeros_like(whole)  # of the jackknife
    least = 1e-6 * whole.max(axis=1, keepdims=True)  # a second moment of zero must not decide alone
    return whole, 1 / (variance + (_OWN * whole) ** 2 + least**2)


def _second(sums: Array) -> Array:
    """(Phi) of u and of v from `SUMS`, (2, ages, ...), NaN where undefined."""
    n, uu, vv = sums
    return np.stack([uu, vv]) / np.where(n > 1, n - 1, np.nan)


def _fit(sums: Array, axis: int, second: Array, since: Array, weight: Array) -> Array:
    """What `fitted` needs of one coordinate, (9, 1, ...); ages that a draw has nothing of are taken as observed."""
    drawn = _second(sums)[axis]
    whole = second.reshape(-1, *[1] * (drawn.ndim - 1))
    known = np.where(np.isnan(drawn), whole, drawn)
    free, bounded = fit_freely(known, since, weight), fit_growth(known, since, weight)
    return np.concatenate([free, bounded, contributions(bounded, since)])[:, None]


def _named(bounds: Bounds, first: int, second: Array, since: Array, weight: Array) -> Fit:
    """The fit of one coordinate, whose rows of `bounds` begin at `first`."""
    free, bounded, shares = (
        {term: _interval(bounds, first + step + row) for row, term in enumerate(TERMS)} for step in (0, 3, 6)
    )
    sizes = {term: _root(bounded[term], free[term]) for term in TERMS}
    return Fit(sizes, shares, misfit(second, since, fit_growth(second, since, weight)))


def _root(bounded: Interval, free: Interval) -> Interval:
    """Root of a coefficient of the bounded fit, with bounds that hold those of either fit.

    Where the truth is at a bound, the bounded fit pulls the other terms away from theirs, and its draws do not tell.
    """
    low, high = (function(getattr(bounded, end), getattr(free, end)) for function, end in ((min, "low"), (max, "high")))
    return Interval(*(max(value, 0.0) ** 0.5 for value in (bounded.value, low, high)))


def _interval(bounds: Bounds, row: int) -> Interval:
    value, low, high = (float(values[row, 0]) for values in (bounds.value, bounds.low, bounds.high))
    return Interval(value, low, high)
