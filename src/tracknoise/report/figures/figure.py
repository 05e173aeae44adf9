"""What a figure is: a chart with its two sentences, or the reason why there is none."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tracknoise.report.evidence import Evidence
from tracknoise.report.figures.layout import Spec
from tracknoise.report.tables import Cells


@dataclass(frozen=True, slots=True)
class Figure:
    """A chart and what the reader is told about it.

    Attributes
    ----------
    id
        File name without extension, and anchor in the page.
    title
        What it is called.
    shows
        One sentence or two: what is drawn.
    look_for
        What to look for, written from the numbers.
    spec
        The chart, as a Vega-Lite specification.
    """

    id: str
    title: str
    shows: str
    look_for: str
    spec: Spec


@dataclass(frozen=True, slots=True)
class Absence:
    """A figure with nothing to show.

    Attributes
    ----------
    id, title
        Of the figure that would have been here.
    why
        One sentence: why it is not.
    """

    id: str
    title: str
    why: str


def no_tables(evidence: Evidence) -> Sequence[Cells]:
    """The tables of a family that has none."""
    return []


@dataclass(frozen=True, slots=True)
class Family:
    """A section of the report: figures of one kind.

    Attributes
    ----------
    id, title
        Anchor and heading of the section.
    lead
        A sentence or two that open it, true of any data.
    figures
        Makes the figures of a run, in order.
    tables
        Makes the tables that stand below them.
    """

    id: str
    title: str
    lead: str
    figures: Callable[[Evidence], Sequence[Figure | Absence]]
    tables: Callable[[Evidence], Sequence[Cells]] = no_tables
