"""Every headline of a run, the most important first."""

import json
import math
from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.exceptions import StoreError
from tracknoise.tables.findings_schema import FINDINGS
from tracknoise.tables.run_table import RunTable
from tracknoise.tables.schema import check
from tracknoise.tables.store import RunFolder
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
    makes = [(topic.name, topic.headline) for topic in TOPICS if topic.headline is not None and basis in topic.holds]
    headlines = [(name, headline) for name, make in makes if (headline := make(tables, conditions))]
    rows = [headline.row(name, rank) for rank, (name, headline) in enumerate(headlines, start=1)]
    return check(pl.DataFrame(rows, schema=dict(FINDINGS)), FINDINGS, FINDINGS.name)


def with_findings(
    tables: Mapping[RunTable, pl.DataFrame], cited: RunTables, conditions: ReportedConditions
) -> dict[RunTable, pl.DataFrame]:
    """Tables of a run with its findings. `cited`: those that sentences have numbers of, with the ids of their rows."""
    named = {table.name: rows for table, rows in tables.items()}
    return {**tables, FINDINGS: headline_table({**named, **cited}, conditions)}


def findings_of(tables: RunTables, *topics: str) -> pl.DataFrame:
    """Findings of a run about some topics, or all, the most important first: schema `FINDINGS`."""
    findings = tables[FINDINGS.name].sort("rank")
    return findings.filter(pl.col("topic").is_in(topics)) if topics else findings


def read_findings(run: RunFolder) -> pl.DataFrame:
    """All findings of a run folder, the most important first.

    Raises
    ------
    StoreError
        If the run has no findings, because an earlier version made it.
    """
    findings = findings_of({FINDINGS.name: run.statistics(FINDINGS)})
    if findings.is_empty():
        expected = "those of a finished run; `tracknoise run` computes them"
        raise StoreError(f"{run.path}: holds no findings, expected {expected}")
    return findings


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
