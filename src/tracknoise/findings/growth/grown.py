"""What is fitted to the errors of one condition as they grow, with intervals: (growth)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.estimate import Estimate, EstimateArray
from tracknoise.findings.growth.fit import TERM_UNITS, TERMS, contributions, fit_freely, fit_growth, misfit
from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.resampling import leave_one_out
from tracknoise.findings.sampling.units import Units

Array = NDArray[np.float64]

MIN_AGES = 4
"""Fewest ages of a fit."""
GROWTH_SUMS = ("n", "uu", "vv")
"""What a fit needs of each age: the count, and the sums of squared errors."""
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

    sizes: Mapping[str, Estimate]
    shares: Mapping[str, Estimate]
    misfit: float


def fit_ages(units: Units, *, min_features: int) -> NDArray[np.bool_]:
    """Which points are fitted: up to the first that rests on too few errors, or too few units.

    Parameters
    ----------
    units
        Points by `since`; columns `GROWTH_SUMS`.
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
        Points by `since`; columns `GROWTH_SUMS`.
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
    """(Phi) of u and of v from `GROWTH_SUMS`, (2, ages, ...), NaN where undefined."""
    n, uu, vv = sums
    return np.stack([uu, vv]) / np.where(n > 1, n - 1, np.nan)


def _fit(sums: Array, axis: int, second: Array, since: Array, weight: Array) -> Array:
    """What `fitted` needs of one coordinate, (9, 1, ...); ages without data in a draw are taken as observed."""
    drawn = _second(sums)[axis]
    whole = second.reshape(-1, *[1] * (drawn.ndim - 1))
    known = np.where(np.isnan(drawn), whole, drawn)
    free, bounded = fit_freely(known, since, weight), fit_growth(known, since, weight)
    return np.concatenate([free, bounded, contributions(bounded, since)])[:, None]


def _named(bounds: EstimateArray, first: int, second: Array, since: Array, weight: Array) -> Fit:
    """The fit of one coordinate, whose rows of `bounds` begin at `first`."""
    free, bounded, shares = (
        {term: bounds.at(first + step + row) for row, term in enumerate(TERMS)} for step in (0, 3, 6)
    )
    sizes = {term: _root(bounded[term], free[term], unit=unit) for term, unit in zip(TERMS, TERM_UNITS, strict=True)}
    return Fit(sizes, shares, misfit(second, since, fit_growth(second, since, weight)))


def _root(bounded: Estimate, free: Estimate, *, unit: str) -> Estimate:
    """Root of a coefficient of the bounded fit, with bounds that contain those of either fit.

    Where the true coefficient is 0, the bounded fit shifts the other terms, and its draws do not show that.
    """
    low = None if bounded.low is None or free.low is None else min(bounded.low, free.low)
    high = None if bounded.high is None or free.high is None else max(bounded.high, free.high)
    return replace(bounded, value=_length(bounded.value), low=_length(low), high=_length(high), unit=unit)


def _length(square: float | None) -> float | None:
    return None if square is None else float(max(square, 0.0) ** 0.5)
