"""A figure: a chart with two texts, or the reason why there is none."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from tracknoise.exceptions import FigureError
from tracknoise.report.cells import Cells
from tracknoise.report.report_data import ReportData


@dataclass(frozen=True, slots=True)
class Figure:
    """A chart and its description.

    Attributes
    ----------
    id
        Name of its files without extension, and anchor in the page.
    title
        Its topic.
    shows
        What is drawn.
    look_for
        What to look for, with the numbers of the run.
    spec
        The chart, as a Vega-Lite specification.
    message
        What the figure shows about this run, in a few words; empty where nothing is established.
    """

    id: str
    title: str
    shows: str
    look_for: str
    spec: dict[str, Any]
    message: str = ""


@dataclass(frozen=True, slots=True)
class Absence:
    """A figure that could not be drawn.

    Attributes
    ----------
    id, title
        Of the figure.
    why
        One sentence: why it is missing.
    """

    id: str
    title: str
    why: str


Sections: TypeAlias = Mapping[str, Sequence[Callable[[ReportData], Sequence[Figure | Absence]]]]
"""What makes the figures of sections of the report, by the ids of the sections."""
SectionTables: TypeAlias = Mapping[str, Callable[[ReportData], Sequence[Cells]]]
"""What makes the tables below them."""


def require_distinct(items: Iterable[Figure | Absence]) -> None:
    """Refuse figures that share an id: the files of one would replace those of the other."""
    for name, times in Counter(item.id for item in items).items():
        if times > 1:
            raise FigureError(f"found {times} figures with the id {name!r}, expected one")
