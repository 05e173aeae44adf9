"""Sums of a condition and the weights of their equations: estimates from any of the components."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.units import Units
from tracknoise.noise_models.fitting.equations import Equations
from tracknoise.noise_models.fitting.held_out import log_likelihoods
from tracknoise.noise_models.fitting.independent import independent_sums
from tracknoise.tables.enumerations import IntervalKind

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Bounded:
    """Estimates of n numbers, px^2, with their bounds, (n,) each; NaN where there is no interval."""

    value: Array
    low: Array
    high: Array

    def hull(self, other: "Bounded") -> "Bounded":
        """The same values, with the smallest intervals that contain both."""
        return Bounded(self.value, np.fmin(self.low, other.low), np.fmax(self.high, other.high))


@dataclass(frozen=True, slots=True, eq=False)
class WeightedSums:
    """What components are fitted to.

    Attributes
    ----------
    units
        Sums by product and age, columns `tracknoise.noise_models.fitting.equations.COLUMNS`.
    weights
        (equations,) float64, of squared residuals.
    """

    units: Units
    weights: Array

    def half_traces(self, active: Sequence[int], *, scale: str, level: float) -> Bounded:
        """Half traces of the active components, with Student's intervals from the jackknife on a scale."""
        return self._estimates(active, np.asarray, scale, level)

    def combined(self, active: Sequence[int], coefficients: Array, *, level: float) -> Bounded:
        """Linear combinations (n, 4) of half traces, none of which counts as negative."""

        def combinations(half_traces: Array) -> Array:
            kept = coefficients[:, list(active)]
            return np.asarray(np.einsum("na,a...->n...", kept, np.maximum(half_traces, 0.0)))

        return self._estimates(active, combinations, "log", level)

    def gains(self, active: Sequence[int]) -> Array:
        """What each active component gains in log likelihood on what was left out, nat per error; NaN with one."""
        if len(active) < 2:
            return np.full(len(active), np.nan)
        every = self.held_out(active)
        others = [[one for one in active if one != left] for left in active]
        return np.array([every - self.held_out(rest) for rest in others])

    def held_out(self, active: Sequence[int]) -> float:
        """Mean log likelihood of what was left out in turn, nat per error; NaN if nothing can be left out."""
        own = independent_sums(self.units)
        if len(own) < 2:
            return float("nan")
        left_out = np.transpose(own.sum(axis=0) - own, (2, 1, 0))
        half = np.maximum(self._solved(left_out, active), 0.0)
        measured = Equations.of(np.transpose(own, (2, 1, 0)))
        modelled = np.einsum("eau,au->eu", np.nan_to_num(measured.factors[:, list(active)]), half)
        counts = own[..., 0].T
        found = log_likelihoods(self.units.points, counts, measured.half_trace, modelled)
        return float(np.average(found, weights=counts.sum(axis=0)))

    def _estimates(self, active: Sequence[int], of: Callable[[Array], Array], scale: str, level: float) -> Bounded:
        def statistics(sums: Array) -> Array:
            return of(self._solved(sums, active))[:, None]

        found = pooled(
            self.units,
            np.zeros((0, len(self.units.sums))),
            statistics,
            Method(IntervalKind.student, level),
            scales=[scale] * len(statistics(self.units.sums.sum(axis=0).T)),
            sizes=self.units.sums[..., 0].sum(axis=1)[None],
        )
        return Bounded(found.value[:, 0], found.low[:, 0], found.high[:, 0])

    def _solved(self, sums: Array, active: Sequence[int]) -> Array:
        """Half traces of the active components, from sums (columns, equations, ...)."""
        solved = Equations.of(sums).solved(self.weights, active)
        return np.asarray(0.5 * (solved[:, 0] + solved[:, 2]))
