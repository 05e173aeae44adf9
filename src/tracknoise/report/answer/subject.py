"""One tracker in the condition that a card is about, and its tables."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_estimate
from tracknoise.findings.headlines.reported_conditions import ReportedConditions
from tracknoise.report.answer.summary import Answer, Number
from tracknoise.report.report_data import ReportData
from tracknoise.report.reported import reported_conditions
from tracknoise.tables.enumerations import Verdict


@dataclass(frozen=True)
class Subject:
    """A tracker of a run at the lowest speed.

    Attributes
    ----------
    data
        The run.
    tracker
        Its name.
    """

    data: ReportData
    tracker: str

    @cached_property
    def conditions(self) -> ReportedConditions:
        """Which condition."""
        return reported_conditions(self.data, self.data.slowest)

    @cached_property
    def row(self) -> dict[str, Any] | None:
        """Row of the summary; None where the tracker was not measured."""
        return self.first("summary")

    @cached_property
    def intervals(self) -> pl.DataFrame:
        """Intervals of the condition."""
        return self.of("intervals")

    @property
    def at(self) -> int | None:
        """The reference age or frame; None where no age has enough features."""
        return None if self.row is None else self.row["at"]

    def of(self, table: str) -> pl.DataFrame:
        """Rows of the condition in a table of the run."""
        return self.conditions.of(getattr(self.data, table), self.tracker)

    def first(self, table: str, *filters: pl.Expr, **values: object) -> dict[str, Any] | None:
        """First row of the condition that has some values; None where there is none."""
        rows = self.of(table).filter(*filters, **values)
        return rows.row(0, named=True) if rows.height else None


def number(estimate: Estimate | None) -> Number:
    """An estimate as plain data."""
    value = None if estimate is None else _finite(estimate.value)
    if estimate is None or value is None:
        return Number(None, None, None, "unknown", "")
    low, high = _finite(estimate.low), _finite(estimate.high)
    text, _, interval = format_estimate(replace(estimate, low=low, high=high)).partition(" (")
    return Number(value, low, high, text, interval.removesuffix(")"))


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def with_interval(found: Number) -> str:
    """A number as part of a sentence."""
    return f"{found.text} ({found.interval})" if found.interval else found.text


def answer(question: str, verdict: str, *, wished: Verdict) -> Answer:
    """Answer a question, and say whether the answer is the one that is wished for."""
    found = Verdict(verdict)
    return Answer(question, found, None if found == Verdict.undecided else found == wished)


def larger(found: dict[str, Estimate | None]) -> tuple[str, Estimate] | None:
    """The coordinate whose estimate is the farthest from zero, and the estimate; None where none is known."""
    known = {name: one for name, one in found.items() if one is not None and one.value is not None}
    if not known:
        return None
    name = max(known, key=lambda each: abs(known[each].value or 0.0))
    return name, known[name]
