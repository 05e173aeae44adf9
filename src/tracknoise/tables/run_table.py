"""A table of a whole run: its name, its columns, and how its numbers are rows of the table of results."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, TypeAlias

import polars as pl

from tracknoise.tables.quantities import Quantity
from tracknoise.tables.schema import CONDITION, VIEW, Schema

Columns: TypeAlias = Mapping[str, str]
"""Columns of a table by columns of `RESULTS`."""
Constants: TypeAlias = Mapping[str, Any]
ALL_ROWS = pl.lit(value=True)


@dataclass(frozen=True, slots=True)
class Value:
    """A column of numbers of a table.

    Attributes
    ----------
    quantity
        Of the numbers.
    column
        Of the table.
    labels
        What the identity of the row has besides the keys of the table, or in place of one that the table has not.
    rows
        Values of columns of the table in the rows that have it; by default all rows have it.
    carried
        More columns of the row, and of the table.
    topic
        Of the row; None where it is that of the table.
    always
        Whether there is a row where the number is missing too.
    """

    quantity: str
    column: str
    labels: Constants = field(default_factory=dict)
    rows: Constants = field(default_factory=dict)
    carried: Columns = field(default_factory=dict)
    topic: str | None = None
    always: bool = False


@dataclass(frozen=True, slots=True)
class Rows:
    """A table as rows of results.

    Attributes
    ----------
    topic
        Of its rows.
    keys
        Columns of the identity, and of the table.
    values
        Its numbers. The first of those with the same `rows` is there in every row; others may be missing.
    packed
        A column of the identity, and columns of the table that it holds as text, joined by a colon.
    """

    topic: str
    keys: Columns
    values: Sequence[Value]
    packed: Mapping[str, Sequence[str]] = field(default_factory=dict)

    @property
    def topics(self) -> frozenset[str]:
        """Topics of its rows."""
        return frozenset(value.topic or self.topic for value in self.values)


class RunTable(dict[str, pl.DataType | type[pl.DataType]]):
    """The columns of a table of a run, which has a name.

    Parameters
    ----------
    name
        Of its file, and of the table in the API.
    columns
        Names and types, in order.
    rows
        Of results that it makes; None where it has no numbers of its own.
    title
        Of its file in a report; empty where it has none as it is.
    verdicts
        Its rows that are in the document of findings; None where none are.
    quantities
        Of its numbers, without those of `tracknoise.tables.quantities.QUANTITIES`.
    without_truth
        Whether errors of the truth change none of its numbers.
    """

    def __init__(
        self,
        name: str,
        columns: Schema,
        rows: Rows | None = None,
        *,
        title: str = "",
        verdicts: pl.Expr | None = None,
        quantities: Mapping[str, Quantity] = MappingProxyType({}),
        without_truth: bool = False,
    ) -> None:
        super().__init__(columns)
        self.name, self.rows, self.title, self.verdicts = name, rows, title, verdicts
        self.quantities, self.without_truth = quantities, without_truth

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(self.name)

    @property
    def are_curves(self) -> bool:
        """Whether it holds curves of errors and nothing else."""
        return self.rows is not None and self.rows.topics == {"errors"}


def same(*names: str) -> dict[str, str]:
    """Columns that have the same name in a table and in results."""
    return {name: name for name in names}


def bounds_of(stem: str, unit: str = "") -> dict[str, str]:
    """Bounds of an interval, and its level."""
    return {"low": f"{stem}_low{unit}", "high": f"{stem}_high{unit}", "level": "level"}


OF_CONDITION: dict[str, str] = same("dataset", *CONDITION)
OF_VIEW: dict[str, str] = same("dataset", *VIEW)
OF_CLASS: dict[str, str] = {"part_low": "class_low", "part_high": "class_high"}
ESTIMATED: dict[str, str] = same("low", "high", "level", "resampled", "n_units", "n_scenes") | {"interval": "kind"}
ESTIMATED_OF_N: dict[str, str] = {**ESTIMATED, "n": "n"}
COUNTED: dict[str, str] = same("n", "n_scenes")


def by_quantity(names: Mapping[str, tuple[str, Constants]], carried: Columns, **labels: str | None) -> list[Value]:
    """Values of a table with the columns quantity and value: quantities of results and their labels, by `names`."""
    return [
        Value(quantity, "value", {**labels, **constants}, {"quantity": name}, carried)
        for name, (quantity, constants) in names.items()
    ]


def one_number(topic: str, quantity: str, value: str, keys: Columns, carried: Columns) -> Rows:
    """A table with one number in each row."""
    return Rows(topic, keys, [Value(quantity, value, carried=carried)])
