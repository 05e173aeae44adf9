"""Estimates: values with their intervals, one at a time or as arrays."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and its interval."""

    value: float | None  # None where it is unknown
    # low, high: bounds of the interval; None where there is none, or none on that side
    low: float | None = None
    high: float | None = None
    unit: str = ""  # of the value and its bounds, such as ``px``; empty where there is none
    # how the interval was made: a value of `tracknoise.inference.conventions.IntervalKind`, or ``paired``
    kind: str | None = None
    level: float | None = None  # probability that the interval contains the true value, between 0 and 1
    id: str | None = None  # of its row of results; None where it is no such number

    @classmethod
    def of(cls, value: float | None, found: "Estimate | None", unit: str) -> "Estimate":
        """A value with the interval that was found for it, if any."""
        if found is None:
            return cls(value, unit=unit)
        return cls(value, found.low, found.high, unit, found.kind, found.level, found.id)

    @classmethod
    def of_row(cls, row: Mapping[str, Any], value: str, low: str, high: str, unit: str = "") -> "Estimate":
        """Estimate in a row of a table, from the columns of these names and, if there are any, `kind` and `level`."""
        ids = row.get("ids") or {}
        return cls(row[value], row[low], row[high], unit, row.get("kind"), row.get("level"), ids.get(value))

    @classmethod
    def verdict(cls, row: Mapping[str, Any], column: str) -> "Estimate":
        """The row of results of a verdict: an estimate without a number."""
        return cls(None, id=(row.get("ids") or {}).get(column))

    def times(self, factor: float) -> "Estimate":
        """It and its interval times a factor above 0."""
        value, low, high = (None if one is None else one * factor for one in (self.value, self.low, self.high))
        return replace(self, value=value, low=low, high=high)

    def above(self, bound: float) -> bool:
        """Whether the whole interval is above a bound."""
        return self.low is not None and self.low > bound

    def below(self, bound: float) -> bool:
        """Whether the whole interval is below a bound."""
        return self.high is not None and self.high < bound


@dataclass(frozen=True, slots=True)
class EstimateArray:
    """Statistics of one condition with their intervals, (statistics, points), NaN where there are none."""

    # value, low, high: (statistics, points): values and the bounds of their intervals
    value: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    # n_units, n_scenes: (statistics, points): how many units, and how many scenes, each value rests on
    n_units: NDArray[np.intp]
    n_scenes: NDArray[np.intp]
    kind: str  # how the intervals were made
    level: float  # probability that an interval contains the true value
    # (statistics, points): how many units of one size would have a mean as uncertain as that of the units; None where
    # it is not known
    n_effective: NDArray[np.float64] | None = None

    def at(self, statistic: int, point: int = 0, *, unit: str = "") -> Estimate:
        """One of the estimates; what is NaN here is None there."""
        value, low, high = (_known(array[statistic, point]) for array in (self.value, self.low, self.high))
        return Estimate(value, low, high, unit, self.kind, self.level)


def _known(value: np.float64) -> float | None:
    return None if np.isnan(value) else float(value)
