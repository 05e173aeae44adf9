"""What a topic is: the tables that it adds to a run, how they are made, and what is said about them.

`tracknoise.topics.catalogue` lists all topics. What makes, stores, words and shows a run goes through that list.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TypeAlias

import polars as pl

from tracknoise.analysis.condition_units import Sampling
from tracknoise.analysis.estimand import Estimand
from tracknoise.analysis.run_inputs import RunInputs
from tracknoise.tables.run_table import ALL_ROWS, RunTable
from tracknoise.topics.answer_summary import Measure
from tracknoise.topics.headline import Headline, ReportedConditions, RunTables
from tracknoise.topics.measures import Subject
from tracknoise.topics.run_data import RunData

Pool: TypeAlias = Callable[[Iterator[pl.DataFrame], Sampling], pl.DataFrame]
NO_ROWS = pl.lit(value=False)


class Basis(StrEnum):
    """What errors of a run are about: a truth of its own, positions fitted to the tracks, or none (wrong tracks)."""

    truth = "truth"
    fitted = "fitted"
    none = "none"


ABOUT_ERRORS = (Basis.truth,)
ABOUT_TRACKS = (Basis.truth, Basis.fitted)


@dataclass(frozen=True)
class Analysis:
    """Tables of a run, and how they are made.

    Attributes
    ----------
    tables
        That it makes.
    make
        Returns them, in this order.
    needs
        Tables of the run that it is made of.
    if_fitted, if_wrong
        Rows that remain where positions are fitted to the tracks, and where tracks do not follow the images.
    """

    tables: tuple[RunTable, ...]
    make: Callable[[RunInputs], Sequence[pl.DataFrame]]
    needs: tuple[RunTable, ...] = ()
    if_fitted: pl.Expr = ALL_ROWS
    if_wrong: pl.Expr = ALL_ROWS

    def remaining(self, basis: Basis) -> pl.Expr:
        """Rows of its tables that remain in a run."""
        return {Basis.truth: ALL_ROWS, Basis.fitted: self.if_fitted, Basis.none: self.if_wrong}[basis]


def pooled(
    table: RunTable, name: str, pool: Pool, *, if_fitted: pl.Expr = ALL_ROWS, if_wrong: pl.Expr = ALL_ROWS
) -> Analysis:
    """An analysis that pools one table of each sequence that has it, and nothing else."""
    return Analysis(
        (table,),
        lambda inputs: [pool(inputs.run.stored_tables(name), inputs.sampling)],
        if_fitted=if_fitted,
        if_wrong=if_wrong,
    )


def make_tables(analyses: Iterable[Analysis], inputs: RunInputs) -> list[Analysis]:
    """Make the tables of analyses, each after what it needs. Returns those that need a table that nothing made."""
    waiting = list(analyses)
    while ready := [analysis for analysis in waiting if all(table in inputs.made for table in analysis.needs)]:
        for analysis in ready:
            inputs.made.update(zip(analysis.tables, analysis.make(inputs), strict=True))
        waiting = [analysis for analysis in waiting if analysis not in ready]
    return waiting


@dataclass(frozen=True)
class Curve:
    """A figure of a number of each tracker by age, with its interval."""

    quantity: str  # with its title
    table: RunTable  # columns at, n (features), value, low, high, and what intervals are of
    section: str  # of the report
    rows: Mapping[str, str] = field(default_factory=dict)  # values of columns of the table in its rows
    combined: str = "features pooled"  # how features or scenes are


@dataclass(frozen=True)
class Column:
    """A column of the table of verdicts, which has a row for each tracker and speed."""

    heading: str
    cell: Callable[[Subject], str]
    above: str = ""  # heading over it and its neighbours
    note: str = ""  # a sentence of the caption


@dataclass(frozen=True)
class Topic:
    """What a run says about one thing.

    Attributes
    ----------
    name
        One or two words: of its findings.
    analyses
        Make its tables.
    headline
        Its finding; none where the tables have no rows about it.
    holds
        In which runs there is such a finding.
    measure
        A row of the card of a tracker; None where it has none there.
    in_cards
        Runs in which cards have this row.
    rows_of_card
        Names of the rows of cards whose sentences are those of the finding.
    sentence
        The finding in a short sentence about one tracker. Where there is none, the brief text of the finding is used.
    of_these_scenes
        Whether the brief text has numbers of the measured scenes.
    compared
        Statistics of it that runs are compared by.
    curves
        Its figures.
    columns
        Its columns of the table of verdicts on a run.
    """

    name: str
    analyses: tuple[Analysis, ...] = ()
    headline: Callable[[RunTables, ReportedConditions], Headline | None] | None = None
    holds: Sequence[Basis] = ABOUT_ERRORS
    measure: Callable[[Subject], Measure | None] | None = None
    in_cards: Sequence[Basis] = ABOUT_ERRORS
    rows_of_card: Sequence[str] = ()
    sentence: Callable[[RunData, str], str] | None = None
    of_these_scenes: bool = False
    compared: Sequence[Estimand] = ()
    curves: Sequence[Curve] = ()
    columns: Callable[[RunData], Sequence[Column]] = lambda _: ()
