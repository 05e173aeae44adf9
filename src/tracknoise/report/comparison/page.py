"""A comparison as one HTML page that needs no network."""

from collections.abc import Sequence
from dataclasses import dataclass

from tracknoise.findings.comparison.estimands import ESTIMANDS, Estimand
from tracknoise.findings.comparison.result import Comparison, Row
from tracknoise.report.cells import Cells
from tracknoise.report.comparison.plot import Plot, plot_of
from tracknoise.report.comparison.tables import gate_cells
from tracknoise.report.comparison.words import (
    answers,
    by_run,
    clearest,
    condition_words,
    effect_words,
    gate_sentences,
    intervals_words,
    varying,
    where_words,
)
from tracknoise.report.templates import template

_MOST_OPEN = 4
"""Conditions whose tables are unfolded."""


@dataclass(frozen=True, slots=True)
class _Line:
    """One statistic of a condition, as the page shows it."""

    row: Row
    estimand: Estimand
    effect: str
    where: str
    plot: Plot | None


@dataclass(frozen=True, slots=True)
class _Condition:
    title: str
    intervals: str
    lines: Sequence[_Line]


def comparison_page(comparison: Comparison) -> str:
    """The page: the answer first, then every statistic with its interval, and what the runs differ in."""
    parts = [
        (side, answers(rows), clearest(rows), _conditions(comparison, rows))
        for side, rows in zip(comparison.others, by_run(comparison).values(), strict=True)
    ]
    gate = None if comparison.gate is None else (gate_sentences(comparison.gate), gate_cells(comparison.gate))
    return template("compare.html.j2").render(
        comparison=comparison,
        parts=parts,
        gate=gate,
        most_open=_MOST_OPEN,
        estimands=_estimands(comparison.rows),
        differences=[_differences(side.name, side.differs) for side in comparison.others],
    )


def _conditions(comparison: Comparison, rows: Sequence[Row]) -> list[_Condition]:
    named = varying(rows)
    conditions = []
    for of in dict.fromkeys(row.of for row in rows):
        shown = [row for row in rows if row.of == of]
        lines = [_Line(row, row.estimand, effect_words(row), where_words(row), plot_of(row)) for row in shown]
        conditions.append(_Condition(condition_words(of, named), intervals_words(shown, comparison.level), lines))
    return conditions


def _estimands(rows: Sequence[Row]) -> list[Estimand]:
    statistics = {row.statistic for row in rows}
    return [estimand for name, estimand in ESTIMANDS.items() if name in statistics]


def _differences(run: str, differs: Sequence[tuple[str, str, str]]) -> Cells:
    return Cells(f"What differs in {run}", ["setting", "first run", run], differs, [False] * 3)
