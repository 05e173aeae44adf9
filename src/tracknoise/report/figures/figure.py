"""What a figure is: a chart with its two sentences, or the reason why there is none."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import altair as alt

from tracknoise.report.evidence import Evidence

Chart: TypeAlias = alt.Chart | alt.LayerChart | alt.HConcatChart | alt.VConcatChart | alt.ConcatChart


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
    chart
        The chart.
    """

    id: str
    title: str
    shows: str
    look_for: str
    chart: Chart


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


@dataclass(frozen=True, slots=True)
class Family:
    """A section of the report: figures of one kind.

    Attributes
    ----------
    id, title
        Anchor and heading of the section.
    lead
        A sentence or two that open it, true of any data.
    make
        Makes the figures.
    """

    id: str
    title: str
    lead: str
    make: Callable[[Evidence], Sequence[Figure | Absence]]

    def figures(self, evidence: Evidence) -> Sequence[Figure | Absence]:
        """Figures of a run, in order."""
        with warnings.catch_warnings():
            # One selection that many panels share is meant: a legend mutes a name in all of them.
            warnings.filterwarnings("ignore", message="Automatically deduplicated selection parameter")
            return self.make(evidence)
