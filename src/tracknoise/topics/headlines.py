"""Every headline of a run, the most important first."""

import json
import math
from typing import Any

import polars as pl

from tracknoise.tables.findings_schema import FINDINGS
from tracknoise.tables.schema import check
from tracknoise.tables.trust import AssessedTruth, TruthVerdict
from tracknoise.topics.catalogue import RUN_TABLES, TOPICS
from tracknoise.topics.headline import ReportedConditions, RunTables
from tracknoise.topics.topic import Basis


def basis_of(truth: TruthVerdict, *, is_fitted: bool) -> Basis:
    """What the errors of a run are about. `is_fitted`: whether positions are fitted to the tracks."""
    return Basis.none if truth.are_tracks_wrong else Basis.fitted if is_fitted else Basis.truth


def headline_table(tables: RunTables, conditions: ReportedConditions) -> pl.DataFrame:
    """Sentences about what was found, the most important first.

    Parameters
    ----------
    tables
        All tables of the run, by their names. One without rows has no headline.
    conditions
        Which conditions the sentences are about.

    Returns
    -------
    polars.DataFrame
        Schema `FINDINGS`. value, low and high are those of the first number in the text that has an interval.
        `figure` names a section of the report; `table` the table that holds the numbers.
    """
    basis = basis_of(AssessedTruth.of(tables).verdict, is_fitted=conditions.fitted)
    makes = [topic.headline for topic in TOPICS if topic.headline is not None and basis in topic.holds]
    headlines = [headline for make in makes if (headline := make(tables, conditions))]
    rows = [headline.row(rank) for rank, headline in enumerate(headlines, start=1)]
    return check(pl.DataFrame(rows, schema=dict(FINDINGS)), FINDINGS, "findings")


FORMAT = 1


def findings_json(tables: RunTables) -> str:
    """The sentences, and the verdicts with the numbers behind them.

    Parameters
    ----------
    tables
        All tables of the run, by their names.

    Returns
    -------
    str
        An object with `format`, and the rows of each table: the findings, and the verdicts of every table that has any.
        A row is an object of its columns. What is missing is null, what is infinite the string ``Infinity`` or
        ``-Infinity``.
    """
    verdicts = {
        table.name: tables[table.name].filter(table.verdicts)
        for table in RUN_TABLES.values()
        if table.verdicts is not None
    }
    chosen = {FINDINGS.name: tables[FINDINGS.name], **verdicts}
    document = {"format": FORMAT, **{name: _rows(table) for name, table in chosen.items()}}
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _rows(table: pl.DataFrame) -> list[dict[str, Any]]:
    return [{name: _value(value) for name, value in row.items()} for row in table.iter_rows(named=True)]


def _value(value: object) -> object:
    if isinstance(value, float) and math.isinf(value):
        return "Infinity" if value > 0 else "-Infinity"
    return value
