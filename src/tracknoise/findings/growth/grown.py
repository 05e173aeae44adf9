"""What is fitted to the errors of one condition as they grow, with intervals: (growth) and (saturating)."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.estimate import Estimate, EstimateArray
from tracknoise.findings.growth.fit import TERM_UNITS, TERMS, GrowthFit
from tracknoise.findings.growth.models import OWN
from tracknoise.findings.growth.saturating import SaturatingFit, range_tried
from tracknoise.findings.sampling.bounds import Method, Statistics, pooled_by
from tracknoise.findings.sampling.resampling import leave_one_out
from tracknoise.findings.sampling.units import Units
from tracknoise.tables.enumerations import IntervalKind, Resampled

Array = NDArray[np.float64]
_Fit = Callable[[Array], Array]
Sizes = Mapping[str, Estimate]
"""By term: white, saturating_white and saturating (px), walk, drift (`TERM_UNITS`), and time_constant (frames)."""

MIN_AGES = 4
"""Fewest ages of a fit."""
GROWTH_SUMS = ("n", "uu", "vv")
"""What a fit needs of each age: the count, and the sums of squared errors."""
_MIN_UNITS = 4
_ROUNDING = 1e-9


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


def pooled_sizes(units: Units, weights: Array, ages: NDArray[np.bool_], method: Method) -> tuple[Sizes, Sizes]:
    """Sizes of (growth) of u and of v, of all errors together.

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

    def fits(since: Array, weight: Array) -> _Fit:
        fit = GrowthFit.at(since, weight)
        return lambda second: np.concatenate([fit.free(second), fit.bounded(second), fit.alone(second)])

    u, v = _pooled(units, weights, ages, method, fits)
    return _of_terms(u), _of_terms(v)


def pooled_saturating(units: Units, weights: Array, ages: NDArray[np.bool_], method: Method) -> tuple[Sizes, Sizes]:
    """Sizes and time constant of (saturating) of u and of v, of all errors together.

    Parameters
    ----------
    units, weights, ages, method
        As in `pooled_sizes`. A bound of the time constant at an end of what is tried is none.
    """
    tried = range_tried(units.points["since"].to_numpy().astype(np.float64)[ages])

    def named(found: list[Estimate]) -> Sizes:
        white, size, constant = found
        return {
            "saturating_white": _root(white, white, unit="px"),
            "saturating": _root(size, size, unit="px"),
            "time_constant": _between(replace(constant, unit="frames"), *tried),
        }

    def fits(since: Array, weight: Array) -> _Fit:
        return SaturatingFit.at(since, weight).fit

    u, v = _pooled(units, weights, ages, method, fits)
    return named(u), named(v)


def mean_drift(moments: pl.DataFrame) -> tuple[float, float]:
    """Mean error of u and of v per frame, px: what fits the mean errors of all ages, as a line through zero.

    Parameters
    ----------
    moments
        Columns since, n, u and v; at least one row.
    """
    since, n, u, v = (moments[name].to_numpy().astype(np.float64) for name in ("since", "n", "u", "v"))
    total = (n * since**2).sum()
    return float((since * u).sum() / total), float((since * v).sum() / total)


def _pooled(
    units: Units,
    weights: Array,
    ages: NDArray[np.bool_],
    method: Method,
    fits: Callable[[Array, Array], _Fit],
) -> tuple[list[Estimate], list[Estimate]]:
    """What the fits at some ages with some weights find of u and of v, with intervals."""
    part = replace(units, sums=units.sums[:, ages], points=units.points[np.flatnonzero(ages)])
    since = part.points["since"].to_numpy().astype(np.float64)
    second, weight = _observed(part)
    both = [fits(since, of_axis) for of_axis in weight]

    def statistics(sums: Array) -> Array:
        """Of u, then of v, (statistics, 1, ...); ages without data in a draw are taken as observed."""
        drawn = _second(sums)
        whole = second.reshape(*second.shape, *[1] * (drawn.ndim - 2))
        known = np.where(np.isnan(drawn), whole, drawn)
        return np.concatenate([fit(of_axis) for fit, of_axis in zip(both, known, strict=True)])[:, None]

    bounds = _of_differing_scenes(part, weights, statistics, method)
    found = [bounds.at(row) for row in range(len(bounds.value))]
    return found[: len(found) // 2], found[len(found) // 2 :]


def _of_differing_scenes(units: Units, weights: Array, statistics: Statistics, method: Method) -> EstimateArray:
    """Bounds of coefficients. Those that are above 0 contain the bounds of a mean over scenes that differ by factors.

    Resampling a few scenes does not show how far the largest of all scenes lie above the others; the logarithms of
    their own coefficients do (`tracknoise.findings.sampling.lognormal`).
    """
    differing = method.kind == IntervalKind.bca and units.resampled != Resampled.blocks
    methods = [method, Method(IntervalKind.student, method.level)] if differing else [method]
    sizes = units.sums[..., 0].sum(axis=1)[None]
    bounds, *others = pooled_by(methods, units, weights, statistics, scales="log", sizes=sizes)
    if not others:
        return bounds
    skewed = others[0]
    positive = (bounds.low > 0) & ~np.isnan(skewed.low + skewed.high)
    return replace(
        bounds,
        low=np.where(positive, np.minimum(bounds.low, skewed.low), bounds.low),
        high=np.where(positive, np.maximum(bounds.high, skewed.high), bounds.high),
    )


def _observed(units: Units) -> tuple[Array, Array]:
    """Second moments of u and v at each age, and their weights, (2, ages) each."""
    whole = _second(units.sums.sum(axis=0).T)
    without = _second(np.moveaxis(leave_one_out(units.sums), 0, -1).swapaxes(0, 1))
    influence = np.nan_to_num(without - whole[..., None])
    variance = (influence**2).sum(axis=-1) if units.resampled else np.zeros_like(whole)  # of the jackknife
    least = 1e-6 * whole.max(axis=1, keepdims=True)  # a second moment of zero must not decide alone
    return whole, 1 / (variance + (OWN * whole) ** 2 + least**2)


def _second(sums: Array) -> Array:
    """(Phi) of u and of v from `GROWTH_SUMS`, (2, ages, ...), NaN where undefined."""
    n, uu, vv = sums
    return np.stack([uu, vv]) / np.where(n > 1, n - 1, np.nan)


def _of_terms(found: list[Estimate]) -> Sizes:
    """Sizes from free and bounded coefficients, and from those of terms that would explain everything alone."""
    free, bounded, alone = (found[first : first + len(TERMS)] for first in range(0, 3 * len(TERMS), len(TERMS)))
    return {
        term: _at_most(_root(one, other, unit=unit), _length(whole.high))
        for term, one, other, whole, unit in zip(TERMS, bounded, free, alone, TERM_UNITS, strict=True)
    }


def _at_most(size: Estimate, most: float | None) -> Estimate:
    """The same with an upper bound that is not above that of all errors.

    A coefficient of one scene can be near 0 where another term takes its part, so that the logarithms of coefficients
    differ more than scenes do.
    """
    if size.value is None or size.high is None or most is None:
        return size
    return replace(size, high=max(min(size.high, most), size.value))


def _root(bounded: Estimate, free: Estimate, *, unit: str) -> Estimate:
    """Root of a coefficient of the bounded fit, with bounds that contain those of either fit.

    Where the true coefficient is 0, the bounded fit shifts the other terms, and its draws do not show that.
    """
    low = None if bounded.low is None or free.low is None else min(bounded.low, free.low)
    high = None if bounded.high is None or free.high is None else max(bounded.high, free.high)
    return replace(bounded, value=_length(bounded.value), low=_length(low), high=_length(high), unit=unit)


def _between(estimate: Estimate, least: float, most: float) -> Estimate:
    """The same without bounds that are not between two limits."""
    low = estimate.low if estimate.above(least * (1 + _ROUNDING)) else None
    high = estimate.high if estimate.below(most * (1 - _ROUNDING)) else None
    return replace(estimate, low=low, high=high)


def _length(square: float | None) -> float | None:
    return None if square is None else float(max(square, 0.0) ** 0.5)
