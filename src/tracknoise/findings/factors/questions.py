"""The questions about factors: which conditions are the levels of a factor, and which statistics are compared."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import polars as pl

from tracknoise.statistics.conditions import Condition
from tracknoise.statistics.definitions import NAMES, POOLED
from tracknoise.tables.schema import CONDITION, EFFECTS, check

CORE = "core"
"""Name of the robust scale, which is compared although `EFFECTS` lacks it."""
_ROLES: Mapping[str, str] = {
    **{name: role for names in NAMES.values() for role, name in names.items()},
    CORE: CORE,
    "lifetime": "lifetime",
    "outlier_ratio": "outlier_ratio",
}
_LEFT_OUT = "central"
"""Central second moments: the comparison of second moments and of means says what they say."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One factor, with all others held.

    Attributes
    ----------
    factor, held
        The factor, and the values of the other columns of the condition, and of `dataset`.
    axis
        Axis of the curves; None for numbers without one.
    levels
        The conditions to compare, by the value of the factor, sorted.
    statistics
        Name of each statistic that is asked about, by its role.
    """

    factor: str
    held: Mapping[str, object]
    axis: str | None
    levels: Mapping[object, Condition]
    statistics: Mapping[str, str]

    @property
    def dataset(self) -> str:
        """Name of the dataset."""
        return str(self.held["dataset"])

    @property
    def key(self) -> dict[str, object]:
        """The columns of the table that identify the cell."""
        names = {name: self.held.get(name) for name in CONDITION}
        return {"dataset": self.held["dataset"], "factor": self.factor, **names, "axis": self.axis}


def cells(effects: pl.DataFrame, conditions: list[Condition]) -> Iterator[Cell]:
    """The cells of a table of effects, in its order.

    Parameters
    ----------
    effects
        Says which factors are asked about, and where the others are held.
    conditions
        All that were measured, sorted.

    Raises
    ------
    SchemaError
        If it has other columns.
    """
    rows = check(effects, EFFECTS, "effects").filter(pl.col("statistic") != _LEFT_OUT)
    for (dataset, factor, *values, axis), part in rows.group_by(
        ["dataset", "factor", *CONDITION, "axis"], maintain_order=True
    ):
        held = {"dataset": dataset, **dict(zip(CONDITION, values, strict=True))}
        del held[str(factor)]
        levels = {key[POOLED.index(str(factor))]: key for key in conditions if _agrees(key, held)}
        statistics = {_ROLES[name]: name for name in part["statistic"]}
        if axis is not None:
            statistics[CORE] = CORE
        yield Cell(str(factor), held, axis, levels, statistics)


def _agrees(condition: Condition, held: Mapping[str, object]) -> bool:
    named = dict(zip(POOLED, condition, strict=True))
    return all(named[name] == value for name, value in held.items())
