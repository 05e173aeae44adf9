"""What distinguishes the curves of one figure."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import polars as pl

MANY = 6
"""With more curves than this, only the moment about zero is drawn, and not the one about the mean."""


@dataclass(frozen=True, slots=True)
class Series:
    """The curves of one figure, by their names and colours.

    Attributes
    ----------
    field
        Column of the curves that distinguishes them.
    colours
        Colour of each of its values, in order.
    phrase
        How a sentence refers to one of its values, which replaces ``{}``.
    columns
        Titles of the columns of panels for u and v.
    """

    field: str
    colours: Mapping[str, str]
    phrase: str = "for {}"
    columns: tuple[str, str] = ("u (horizontal)", "v (vertical)")

    def present(self, points: pl.DataFrame) -> "Series":
        """The series without the names that have no point but those where errors are zero by construction."""
        names = points.filter(pl.col("since") != 0)[self.field].cast(pl.String).unique()
        return replace(self, colours={name: colour for name, colour in self.colours.items() if name in names})

    @property
    def banded(self) -> list[str]:
        """The names whose curves have a band: all, or only the first of many, because many bands hide each other."""
        names = list(self.colours)
        return names if len(names) <= MANY else names[:1]
