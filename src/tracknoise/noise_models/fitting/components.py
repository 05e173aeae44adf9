"""The components of the noise of one tracker: which are there, how large they are, and how certain that is.

Intervals must not depend on close decisions about which components there are
(`tracknoise.noise_models.fitting.selection`). They are the smallest ones that contain the intervals of the model and of
its alternatives.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import SettingsError
from tracknoise.findings.sampling.groups import SceneGroups
from tracknoise.findings.sampling.units import Units, units_of
from tracknoise.noise_models.fitting.equations import COLUMNS, LEAST, NAMES, Equations, matrix, weights_of
from tracknoise.noise_models.fitting.selection import Dropped, Selection, choose, select
from tracknoise.noise_models.fitting.weighted_sums import Bounded, WeightedSums
from tracknoise.noise_models.model import Component, Interval
from tracknoise.noise_models.track_noise import TrackNoise

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

    @property
    def noise(self) -> TrackNoise:
        """The covariances, without their intervals."""
        return TrackNoise(**{name: part.covariance for name, part in self.components.items()})

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


def sums_of_units(sums: pl.DataFrame, groups: SceneGroups) -> Units:
    """What components are fitted to: the sums of a condition by unit.

    Parameters
    ----------
    sums
        Rows of the condition, schema `NOISE_SUMS`.
    groups
        Groups of scenes that are not independent of each other.
    """
    return units_of(sums.drop("block"), sums, points=["product", "age"], columns=COLUMNS, groups=groups)


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
    equations, sums = _weighted(units)
    selection = select(sums, level=level)
    every = {**_kept(equations, sums, selection, level), **_none(selection.dropped)}
    return FittedComponents({name: every[number] for number, name in enumerate(NAMES)}, sums, selection, level)


def fit_noise(units: Units, *, level: float) -> TrackNoise:
    """The covariances that `fit_components` returns. Without intervals and alternatives it takes half the time.

    Parameters
    ----------
    units, level
        As in `fit_components`.

    Raises
    ------
    SettingsError
        If there are too few errors.
    """
    equations, sums = _weighted(units)
    active = choose(sums, level=level)
    covariances = equations.bounded(sums.weights, active)
    return TrackNoise(**{NAMES[number]: matrix(entries) for number, entries in zip(active, covariances, strict=True)})


def _weighted(units: Units) -> tuple[Equations, WeightedSums]:
    """Equations of all units together, and the weighted sums of each."""
    whole = units.sums.sum(axis=0).T
    if np.count_nonzero(whole[0] >= LEAST) < len(NAMES):
        raise SettingsError("noise model: found too few errors to fit, expected tracks of several frames")
    equations = Equations.of(whole)
    return equations, WeightedSums.of(units, weights_of(whole[0], units.points, equations))


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
    found = {number: Interval(value=0.0, low=_least(one), high=one.most_px) for number, one in dropped.items()}
    return {
        number: Component(covariance=np.zeros((2, 2)), sigma=found[number], why_dropped=one.why)
        for number, one in dropped.items()
    }


def _least(one: Dropped) -> float | None:
    """Lower bound of a component that was dropped; None where there is no interval."""
    return None if one.most_px is None else 0.0


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
