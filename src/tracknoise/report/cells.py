"""Tables as the page prints them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import polars as pl

from tracknoise.words import number, percent, pixels

_CHARACTERS, _GAP = 135, 2
"""Characters in a line of a table that is as wide as the page, and those between two columns."""
_MOST_TURNED = 6
"""Tables with more rows than this are not turned."""
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

    def part(self, places: Sequence[int], caption: str, groups: Sequence[tuple[str, int]] = ()) -> "Cells":
        """Some of the columns, by their places, under another caption."""
        rows = [[row[place] for place in places] for row in self.rows]
        return Cells(
            caption, [self.headings[place] for place in places], rows, [self.numeric[place] for place in places], groups
        )

    @property
    def is_dense(self) -> bool:
        """Whether the table needs small print to fit the page."""
        widest = [max(map(len, column)) for column in zip(self.headings, *self.rows, strict=True)]
        return sum(widest) + _GAP * len(widest) > _CHARACTERS

    @property
    def fitting(self) -> "Cells":
        """The table as the page prints it: one that is too wide and has few rows has a column for each of them."""
        if not self.is_dense or not 0 < len(self.rows) <= _MOST_TURNED:
            return self
        above = [title for title, span in self.groups for _ in range(span)] or [""] * len(self.headings)
        names = [f"{group}: {name}" if group else name for group, name in zip(above, self.headings, strict=True)]
        turned = [[name, *column] for name, column in zip(names, zip(*self.rows, strict=True), strict=True)]
        return Cells(self.caption, turned[0], turned[1:], [False] * len(turned[0]))


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
