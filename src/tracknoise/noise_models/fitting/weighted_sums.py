"""Sums of a condition and the weights of their equations: estimates from any of the components."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.units import Units
from tracknoise.noise_models.fitting.equations import Equations
from tracknoise.noise_models.fitting.held_out import LeftOut
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
    left_out
        What is left out in turn; None if nothing can be.
    """

    units: Units
    weights: Array
    left_out: LeftOut | None
    _scores: dict[tuple[int, ...], float] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, units: Units, weights: Array) -> "WeightedSums":
        """Of the units of a condition."""
        return cls(units, weights, LeftOut.of(units.points, independent_sums(units)))

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
        """Mean log likelihood of what was left out in turn, nat per error; NaN if nothing can be left out.

        It is computed once for each choice of components, because a selection asks for most of them several times.
        """
        if self.left_out is None:
            return float("nan")
        chosen = tuple(active)
        if chosen not in self._scores:
            self._scores[chosen] = self.left_out.score(self.weights, chosen)
        return self._scores[chosen]

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
        return Equations.of(sums).half_traces(self.weights, active)
