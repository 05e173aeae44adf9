"""The components of the noise of one tracker: which are there, how large they are, and how certain that is.

Intervals must not depend on close decisions about which components there are
(`tracknoise.noise_models.fitting.selection`). They are the smallest ones that contain the intervals of the model and of
its alternatives.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import SettingsError
from tracknoise.findings.sampling.units import Units
from tracknoise.noise_models.fitting.equations import LEAST, NAMES, Equations, matrix, weights_of
from tracknoise.noise_models.fitting.selection import Dropped, Selection, select
from tracknoise.noise_models.fitting.weighted_sums import Bounded, WeightedSums
from tracknoise.noise_models.model import Component, Interval

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FittedComponents:
    """Components, and what they were fitted to.

    Attributes
    ----------
    components
        By name, in the order of `NAMES`.
    sums
        Sums, and weights of their equations.
    selection
        Numbers of the components that were kept, and alternatives.
    level
        Of the intervals.
    """

    components: dict[str, Component]
    sums: WeightedSums
    selection: Selection
    level: float

    def combined(self, coefficients: Array) -> list[Interval]:
        """Square roots of linear combinations of the half traces, px, with their intervals.

        Parameters
        ----------
        coefficients
            (n, 4) float64, not negative.
        """
        models = (self.selection.active, *self.selection.alternatives)
        found = reduce(Bounded.hull, [self.sums.combined(one, coefficients, level=self.level) for one in models])
        return [_root(*bounds) for bounds in zip(found.value, found.low, found.high, strict=True)]


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
    sums = WeightedSums(units, weights_of(whole[0], units.points, equations))
    selection = select(sums, level=level)
    every = {**_kept(equations, sums, selection, level), **_none(selection.dropped)}
    return FittedComponents({name: every[number] for number, name in enumerate(NAMES)}, sums, selection, level)


def _kept(equations: Equations, sums: WeightedSums, selection: Selection, level: float) -> dict[int, Component]:
    """Components by number."""
    sizes = [_sizes(sums, active, level) for active in (selection.active, *selection.alternatives)]
    covariances = equations.bounded(sums.weights, selection.active)
    return {
        number: _component(entries, [each[number] for each in sizes if number in each])
        for number, entries in zip(selection.active, covariances, strict=True)
    }


def _sizes(sums: WeightedSums, active: Sequence[int], level: float) -> dict[int, tuple[float, float]]:
    """Bounds of the half trace of each active component, px^2."""
    found = sums.half_traces(active, scale="log", level=level)
    return {number: (low, high) for number, low, high in zip(active, found.low, found.high, strict=True)}


def _component(entries: Array, bounds: Sequence[tuple[float, float]]) -> Component:
    low, high = np.array(bounds).T
    return Component(
        covariance=matrix(entries),
        sigma=_root(0.5 * (entries[0] + entries[2]), np.fmin.reduce(low), np.fmax.reduce(high)),
    )


def _none(dropped: Mapping[int, Dropped]) -> dict[int, Component]:
    """Components without noise."""
    return {
        number: Component(
            covariance=np.zeros((2, 2)), sigma=Interval(value=0.0, low=0.0, high=one.most_px), why_dropped=one.why
        )
        for number, one in dropped.items()
    }


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
