"""Choose rows of a table by the values of its columns."""

from collections.abc import Collection, Mapping
from typing import Any, TypeAlias, TypedDict

import polars as pl

from tracknoise.exceptions import UnknownNameError
from tracknoise.tables.schema import ORIGIN

Names: TypeAlias = str | Collection[str]
Numbers: TypeAlias = int | Collection[int]
Wanted: TypeAlias = str | float | Collection[str | float | None] | None
"""One value, or several; None means a missing value."""


class ConditionColumns(TypedDict, total=False):
    """Columns of a condition; a column that is not given is not restricted."""

    lighting: Names
    rotation: Numbers
    direction: Names
    camera: Names
    tracker: Names
    speed: Numbers


class OriginColumns(ConditionColumns, total=False):
    """Columns of a condition and its sequences."""

    scene: Names
    camera: Names


class IntervalColumns(ConditionColumns, total=False):
    """Columns of the table of intervals by which rows are chosen: see `tracknoise.tables.findings_schema.INTERVALS`."""

    statistic: Names
    aspect: Names
    population: Names | None
    trimming: Names | None
    weighting: Names | None
    axis: Names | None
    at: Numbers | None
    coordinate: Names | None


class ResultColumns(ConditionColumns, total=False):
    """Columns of the table of results by which rows are chosen: see `tracknoise.tables.results.IDENTITY`."""

    id: Names
    quantity: Names
    topic: Names
    factor: Names | None
    axis: Names | None
    at: Numbers | None
    coordinate: Names | None
    part: Names | None
    aspect: Names | None
    population: Names | None
    trimming: Names | None
    weighting: Names | None


def findings_about(findings: pl.DataFrame, results: pl.DataFrame, tracker: str) -> pl.DataFrame:
    """Findings that have a part about a tracker, with the text and the numbers of these parts.

    Parameters
    ----------
    findings
        Schema `FINDINGS`.
    results
        Schema `RESULTS`.
    tracker
        Its name.
    """
    numbers = {row["id"]: row for row in results.filter(tracker=tracker).iter_rows(named=True)}
    rows = []
    for row in findings.iter_rows(named=True):
        parts = [part for part in row["parts"] if part["tracker"] == tracker]
        if not parts:
            continue
        ids = [name for part in parts for name in part["rows"]]
        first = row if row["rows"][:1] == ids[:1] else numbers.get(ids[0], {}) if ids else {}
        own = {name: first.get(name) for name in ("value", "low", "high", "unit")}
        text = " ".join(filter(None, [row["opening"], *(part["text"] for part in parts), row["closing"]]))
        rows.append({**row, **own, "text": text, "rows": ids, "parts": parts, "brief": ""})
    return pl.DataFrame(rows, schema=findings.schema)


def select(table: pl.DataFrame, wanted: Mapping[str, Any]) -> pl.DataFrame:
    """Rows that have the wanted values, in their order.

    Parameters
    ----------
    table
        Any table.
    wanted
        One value or several, by column.

    Raises
    ------
    UnknownNameError
        If there is no such column, or the column is one of names and does not have such a name.
    """
    for column, value in wanted.items():
        _require_known(table, column, _listed(value))
        table = filtered(table, {column: value})
    return table


def filtered(table: pl.DataFrame, wanted: Mapping[str, Any]) -> pl.DataFrame:
    """The same as `select`, without the check of names.

    Raises
    ------
    UnknownNameError
        If there is no such column.
    """
    for column, value in wanted.items():
        if column not in table.columns:
            raise UnknownNameError("column", column, table.columns)
        table = table.filter(pl.col(column).is_in(_listed(value), nulls_equal=True))
    return table


def _listed(value: Wanted) -> list[str | float | None]:
    return list(value) if isinstance(value, Collection) and not isinstance(value, str) else [value]


def _require_known(table: pl.DataFrame, column: str, values: list[str | float | None]) -> None:
    known = _names(table, column)
    for value in values:
        if known is not None and value not in known:
            raise UnknownNameError(column, str(value), [str(name) for name in known if name is not None])


def _names(table: pl.DataFrame, column: str) -> list[Any] | None:
    """Which names a column can have; None where it holds no names, or is not there."""
    kind = table.schema.get(column)
    if isinstance(kind, pl.Enum):
        return [*kind.categories, None]
    return table[column].unique().to_list() if kind == pl.String or (kind and column in ORIGIN) else None
