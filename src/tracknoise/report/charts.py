"""The figures of a run by name, as Altair charts."""

from collections.abc import Mapping, Sequence

import altair as alt
import polars as pl
from altair.utils.schemapi import debug_mode

from tracknoise.exceptions import FigureError, UnknownNameError
from tracknoise.report.evidence import Evidence
from tracknoise.report.export import specification
from tracknoise.report.figures import FAMILIES
from tracknoise.report.figures.figure import Absence, Family, Figure

Chart = alt.ConcatChart
"""A chart that displays itself in a notebook, and that can be changed and saved."""

FIGURES = dict.fromkeys(("figure", "section", "title", "shows", "look_for", "absent"), pl.String)
"""One row per figure: its id, the section of the report that has it, and its texts.

`shows` and `look_for` are null where there is no chart; `absent` then says why, and is null otherwise.
"""


class Charts:
    """The figures of a run, made when they are asked for.

    Parameters
    ----------
    evidence
        The run.
    """

    def __init__(self, evidence: Evidence) -> None:
        self._evidence = evidence
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
        figure = self._find(self._aliases.get(name, name))
        if isinstance(figure, Absence):
            raise FigureError(f"figure {name!r} cannot be drawn: {figure.why}")
        with debug_mode(False):  # no checks of every part, which take half of the time: tests check all figures
            return Chart.from_dict(specification(figure), validate=False)

    def _find(self, name: str) -> Figure | Absence:
        families = [family for family in FAMILIES if family.id == name] or FAMILIES
        figures = [figure for family in families for figure in self._figures(family)]
        if exact := [figure for figure in figures if figure.id == name]:
            return exact[0]
        if len(families) > 1:
            raise UnknownNameError("figure", name, self._known())
        drawn = [figure for figure in figures if isinstance(figure, Figure)]
        nothing = Absence(name, families[0].title, "this run has nothing to compare there.")
        return [*drawn, *figures, nothing][0]

    def _figures(self, family: Family) -> Sequence[Figure | Absence]:
        if family.id not in self._made:
            self._made[family.id] = family.figures(self._evidence)
        return self._made[family.id]

    @property
    def _aliases(self) -> Mapping[str, str]:
        """Names of sections that say along what the curves of this run go."""
        return {f"error-by-{self._evidence.axis.name}": "curves"}

    def _known(self) -> set[str]:
        listed = self.table()
        return {*listed["figure"], *listed["section"], *self._aliases}


def _row(family: Family, figure: Figure | Absence) -> tuple[str | None, ...]:
    if isinstance(figure, Absence):
        return figure.id, family.id, figure.title, None, None, figure.why
    return figure.id, family.id, figure.title, figure.shows, figure.look_for, None
