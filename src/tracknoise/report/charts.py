"""The figures of a run by name, as Altair charts."""

from collections.abc import Sequence
from typing import Any

import altair as alt
import polars as pl
from altair.utils.schemapi import debug_mode

from tracknoise.exceptions import FigureError, UnknownNameError
from tracknoise.report.figure_files import render, specification
from tracknoise.report.figures.families import FAMILIES, Family
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData


class Chart(alt.ConcatChart):
    """A chart that displays itself in a notebook without network, and that can be changed and saved."""

    def _repr_mimebundle_(self, *args: Any, **kwargs: Any) -> Any:
        """A picture, in place of scripts from the network; another renderer only if it was enabled in Altair.

        Altair's own data for JupyterLab and VS Code have a type ``...v6.json``, which notebook files cannot hold.
        """
        if alt.renderers.active in _OF_NOTEBOOKS:
            spec = self.to_dict(validate=False)
            return {
                "image/svg+xml": render(spec, ("svg",))["svg"].decode(),
                "text/plain": f"<Chart: {spec['description'].partition('. ')[0]}>",
            }
        return super()._repr_mimebundle_(*args, **kwargs)


_OF_NOTEBOOKS = ("default", "mimetype", "jupyterlab", "nteract")
"""Renderers of Altair that need the network, or whose data a notebook file cannot hold."""

FIGURES = dict.fromkeys(("figure", "section", "title", "shows", "look_for", "absent"), pl.String)
"""One row per figure: its id, the section of the report that has it, and its texts.

`shows` and `look_for` are null where there is no chart; `absent` then says why, and is null otherwise.
"""


class Charts:
    """The figures of a run, made when they are asked for.

    Parameters
    ----------
    data
        The run.
    """

    def __init__(self, data: ReportData) -> None:
        self._data = data
        self._made: dict[str, Sequence[Figure | Absence]] = {}

    def table(self) -> pl.DataFrame:
        """List the figures, in the order of the report; columns are those of `FIGURES`."""
        rows = [_row(family, figure) for family in FAMILIES for figure in self._figures(family)]
        return pl.DataFrame(rows, schema=FIGURES, orient="row")

    def chart(self, name: str) -> Chart:
        """Draw a figure.

        Parameters
        ----------
        name
            Id of a figure, or of a section, which stands for its first figure that can be drawn.

        Raises
        ------
        UnknownNameError
            If there is no such figure.
        FigureError
            If there is nothing to draw, with the reason.
        """
        figure = self._find(name)
        if isinstance(figure, Absence):
            raise FigureError(f"figure {name!r} cannot be drawn: {figure.why}")
        with debug_mode(False):  # no checks of every part, which take half of the time: tests check all figures
            return Chart.from_dict(specification(figure), validate=False)

    def _find(self, name: str) -> Figure | Absence:
        families = [family for family in FAMILIES if family.id == name] or FAMILIES
        for family in families:
            for figure in self._figures(family):
                if figure.id == name:
                    return figure
        if len(families) > 1:
            raise UnknownNameError("figure", name, self._known())
        return self._first(families[0])

    def _first(self, family: Family) -> Figure | Absence:
        """The first figure of a section that can be drawn."""
        figures = self._figures(family)
        drawn = [figure for figure in figures if isinstance(figure, Figure)]
        return [*drawn, *figures, Absence(family.id, family.title, "this run has nothing to compare there.")][0]

    def _figures(self, family: Family) -> Sequence[Figure | Absence]:
        if family.id not in self._made:
            self._made[family.id] = family.figures(self._data)
        return self._made[family.id]

    def _known(self) -> set[str]:
        listed = self.table()
        return {*listed["figure"], *listed["section"]}


def _row(family: Family, figure: Figure | Absence) -> tuple[str | None, ...]:
    if isinstance(figure, Absence):
        return figure.id, family.id, figure.title, None, None, figure.why
    return figure.id, family.id, figure.title, figure.shows, figure.look_for, None
