"""The components of the noise of one tracker: which are there, how large they are, and how certain that is.

A component is dropped if the interval of its variance reaches 0, or if scenes that were left out are not described
better with it. This is done one at a time, the least certain first, and the others are fitted again. As there are four
components, these intervals have a quarter of the usual error probability.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import SettingsError
from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.units import Units
from tracknoise.noise_models.fitting.equations import LEAST, NAMES, Equations, matrix, weights_of
from tracknoise.noise_models.fitting.held_out import log_likelihoods
from tracknoise.noise_models.model import Component, Interval
from tracknoise.tables.enumerations import IntervalKind

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FittedComponents:
    """Components, and what they were fitted to.

    Attributes
    ----------
    components
        By name, in the order of `NAMES`.
    units, weights, active
        Sums, weights of their equations, and numbers of the components that were kept.
    level
        Of the intervals.
    """

    components: dict[str, Component]
    units: Units
    weights: Array
    active: tuple[int, ...]
    level: float

    def combined(self, coefficients: Array) -> list[Interval]:
        """Square roots of linear combinations of the half traces, px, with their intervals.

        Parameters
        ----------
        coefficients
            (n, 4) float64, not negative.
        """

        def combinations(half_traces: Array) -> Array:
            kept = coefficients[:, list(self.active)]
            return np.asarray(np.einsum("na,a...->n...", kept, np.maximum(half_traces, 0.0)))

        found = _estimates(self.units, self.weights, self.active, "log", self.level, combinations)
        return [_root(*bounds) for bounds in zip(found.value, found.low, found.high, strict=True)]


@dataclass(frozen=True, slots=True, eq=False)
class _Estimates:
    """Half traces of the active components, or what is made of them, px^2, with their bounds."""

    value: Array
    low: Array
    high: Array


def fit_components(units: Units, *, level: float) -> FittedComponents:
    """Fit the components to the sums of a condition.

    Parameters
    ----------
    units
        Sums by product and age, columns `COLUMNS`.
    level
        Of the intervals.

    Raises
    ------
    SettingsError
        If there are too few errors.
    """
    whole = units.sums.sum(axis=0).T
    if np.count_nonzero(whole[0] >= LEAST) < len(NAMES):
        raise SettingsError("noise model: found too few errors to fit, expected tracks of several frames")
    equations = Equations.of(whole)
    weights = weights_of(whole[0], units.points, equations)
    active, dropped = list(range(len(NAMES))), dict[int, tuple[str, float | None]]()
    while True:
        found = _estimates(units, weights, active, "linear", 1.0 - (1.0 - level) / len(NAMES))
        gains = _gains(units, weights, active)
        worst = _least_certain(found, gains)
        if worst is None or len(active) == 1:
            break
        dropped[active[worst]] = _reason(found, gains, worst)
        del active[worst]
    return _fitted(units, equations, weights, active, dropped, level)


def _fitted(
    units: Units,
    equations: Equations,
    weights: Array,
    active: Sequence[int],
    dropped: dict[int, tuple[str, float | None]],
    level: float,
) -> FittedComponents:
    sizes = _estimates(units, weights, active, "log", level)
    covariances = equations.bounded(weights, active)
    kept = {
        number: Component(covariance=matrix(entries), sigma=_root(0.5 * (entries[0] + entries[2]), low, high))
        for number, entries, low, high in zip(active, covariances, sizes.low, sizes.high, strict=True)
    }
    none = {
        number: Component(covariance=np.zeros((2, 2)), sigma=Interval(value=0.0, low=0.0, high=high), why_dropped=why)
        for number, (why, high) in dropped.items()
    }
    every = kept | none
    named = {name: every[number] for number, name in enumerate(NAMES)}
    return FittedComponents(named, units, weights, tuple(active), level)


def _root(square: float, low: float, high: float) -> Interval:
    """The square root of an estimate, with bounds that contain it."""
    value = float(np.sqrt(max(square, 0.0)))
    bounds = [None if np.isnan(bound) else float(np.sqrt(max(bound, 0.0))) for bound in (low, high)]
    lower, upper = bounds
    return Interval(
        value=value,
        low=None if lower is None else min(lower, value),
        high=None if upper is None else max(upper, value),
    )


def _unchanged(half_traces: Array) -> Array:
    return half_traces


def _estimates(
    units: Units,
    weights: Array,
    active: Sequence[int],
    scale: str,
    level: float,
    of: Callable[[Array], Array] = _unchanged,
) -> _Estimates:
    """Half traces, or what is made of them, with Student's intervals from the jackknife."""

    def statistics(sums: Array) -> Array:
        solved = Equations.of(sums).solved(weights, active)
        return of(0.5 * (solved[:, 0] + solved[:, 2]))[:, None]

    count = len(statistics(units.sums.sum(axis=0).T))
    found = pooled(
        units,
        np.zeros((0, len(units.sums))),
        statistics,
        Method(IntervalKind.student, level),
        scales=[scale] * count,
        sizes=units.sums[..., 0].sum(axis=1)[None],
    )
    return _Estimates(found.value[:, 0], found.low[:, 0], found.high[:, 0])


def _left_out(units: Units) -> Array:
    """Sums of all but one of what is resampled, (columns, equations, units)."""
    joined = units.joined(units.sums)
    return np.transpose(joined.sum(axis=0) - joined, (2, 1, 0))


def _gains(units: Units, weights: Array, active: Sequence[int]) -> Array:
    """What each active component gains in log likelihood on units that were left out, nat per error; NaN with one."""
    if len(units.joined(units.sums)) < 2 or len(active) < 2:
        return np.full(len(active), np.nan)
    every = _held_out(units, weights, active)
    others = [[one for one in active if one != left] for left in active]
    return np.array([every - _held_out(units, weights, rest) for rest in others])


def _held_out(units: Units, weights: Array, active: Sequence[int]) -> float:
    own = units.joined(units.sums)
    solved = Equations.of(_left_out(units)).solved(weights, active)
    half = np.maximum(0.5 * (solved[:, 0] + solved[:, 2]), 0.0)
    measured = Equations.of(np.transpose(own, (2, 1, 0)))
    modelled = np.einsum("eau,au->eu", np.nan_to_num(measured.factors[:, list(active)]), half)
    counts = own[..., 0].T
    found = log_likelihoods(units.points, counts, measured.half_trace, modelled)
    return float(np.average(found, weights=counts.sum(axis=0)))


def _least_certain(found: _Estimates, gains: Array) -> int | None:
    """Place of the component to drop; None if all are to be kept."""
    reaches = np.where(np.isnan(found.low), found.value <= 0.0, found.low <= 0.0)
    doubtful = reaches | (gains <= 0.0)
    if not doubtful.any():
        return None
    width = np.where(np.isnan(found.low), 1.0, found.value - found.low)
    certainty = found.value / np.where(width > 0.0, width, 1.0)
    return int(np.argmin(np.where(doubtful, certainty, np.inf)))


def _reason(found: _Estimates, gains: Array, place: int) -> tuple[str, float | None]:
    high = found.high[place]
    most = None if np.isnan(high) else float(np.sqrt(max(high, 0.0)))
    if found.low[place] <= 0.0 or found.value[place] <= 0.0:
        return "the interval of its variance reaches 0", most
    return f"scenes that were left out are not described better with it ({gains[place]:+.2g} nat per error)", most
