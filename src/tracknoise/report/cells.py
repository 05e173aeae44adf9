"""Tables as the page prints them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import polars as pl

from tracknoise.findings.wording import number, percent, pixels

_SHARES = ("outlier_ratio", "pooled_ratio", "dropped_share", "survival")


@dataclass(frozen=True, slots=True)
class Cells:
    """A table as the page prints it.

    Attributes
    ----------
    caption
        What it shows.
    headings
        Of the columns.
    rows
        Text of each cell.
    numeric
        Which columns hold numbers. These are aligned right.
    groups
        Headings over several columns, with the count of these; empty where there are none.
    """

    caption: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    numeric: Sequence[bool]
    groups: Sequence[tuple[str, int]] = ()


def cells(
    table: pl.DataFrame, columns: Mapping[str, str], caption: str, *, groups: Sequence[tuple[str, int]] = ()
) -> Cells:
    """Format the columns that `columns` names, under its headings; shares in percent."""
    chosen = table.select(list(columns))
    rows = [[_cell(value, name) for value, name in zip(row, columns, strict=True)] for row in chosen.iter_rows()]
    return Cells(caption, list(columns.values()), rows, [kind.is_numeric() for kind in chosen.dtypes], groups)


def _cell(value: object, column: str) -> str:
    if not isinstance(value, int | float | None):
        return str(value)
    if value is not None and column in _SHARES:
        return percent(value)
    return pixels(value) if column.endswith("_px") else number(value)
