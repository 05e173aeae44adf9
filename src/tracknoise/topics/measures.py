"""What cards and headlines have in common: one tracker in one condition, its numbers, and how they are written."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.inference.units import MIN_SCENES, Resampled
from tracknoise.tables.enumerations import Verdict
from tracknoise.topics.answer_summary import Answer, Number
from tracknoise.topics.headline import ReportedConditions
from tracknoise.topics.run_data import RunData
from tracknoise.words import DASH, SPACE, bounds_text, format_estimate, sentence_case


def first(rows: pl.DataFrame) -> dict[str, Any] | None:
    """The first row; None where there is none."""
    return rows.row(0, named=True) if rows.height else None


def trimmed_word(conditions: ReportedConditions) -> str:
    """Which errors are meant, before their name; empty where nothing was trimmed."""
    return "" if conditions.percentile is None else f"{conditions.trimming} "


POOLED_WORDS = "features pooled over scenes"
"""How curves are made."""


@dataclass(frozen=True)
class Subject:
    """A tracker of a run at one speed.

    Attributes
    ----------
    data
        The run.
    tracker
        Its name.
    speed
        None for the lowest.
    """

    data: RunData
    tracker: str
    speed: int | None = None

    @cached_property
    def conditions(self) -> ReportedConditions:
        """Which condition."""
        return self.data.conditions(self.speed)

    @cached_property
    def row(self) -> dict[str, Any] | None:
        """Row of the summary; None where the tracker was not measured."""
        return self.first("summary")

    @cached_property
    def intervals(self) -> pl.DataFrame:
        """Intervals of the condition."""
        return self.conditions.intervals(self.data.tables, self.tracker)

    @property
    def limits(self) -> str:
        """What sentences hold for, where intervals do not resample scenes: ``in this scene``; else empty."""
        n_scenes = 0 if self.row is None else self.row["n_scenes"] or 0
        resampled = self.intervals["resampled"].drop_nulls()
        if n_scenes >= MIN_SCENES and not (resampled.len() and (resampled == Resampled.blocks).all()):
            return ""
        return "in this scene" if n_scenes == 1 else "in these scenes"

    def said(self, sentence: str) -> str:
        """A sentence that begins with what it holds for, where that is these scenes only."""
        if not self.limits or not sentence:
            return sentence
        clause = sentence if sentence.startswith(self.tracker) else f"{sentence[0].lower()}{sentence[1:]}"
        return f"{sentence_case(self.limits)}, {clause}"

    @property
    def at(self) -> int | None:
        """The reference age or frame; None where no age has enough features."""
        return None if self.row is None else self.row["at"]

    @property
    def shared_at(self) -> int | None:
        """The reference age or frame of the run; None where no tracker has one."""
        places = self.conditions.reported(self.data["summary"])["at"].drop_nulls()
        return int(places[0]) if places.len() else None

    def of(self, table: str) -> pl.DataFrame:
        """Rows of the condition in a table of the run."""
        return self.conditions.of(self.data[table], self.tracker)

    def first(self, table: str, *filters: pl.Expr, **values: object) -> dict[str, Any] | None:
        """First row of the condition that has some values; None where there is none."""
        return first(self.of(table).filter(*filters, **values))


SIZES = ("core", "rms")
"""Sizes of errors that trackers may be compared by, the first that all have."""


def shown_size(data: RunData) -> tuple[str, str]:
    """The size of errors, one of `SIZES`, and the coordinate that the cards of all trackers show.

    It is the coordinate in which the error of the first tracker is larger.
    """
    rows = [row for tracker in data.trackers if (row := Subject(data, tracker).row) and row["at"] is not None]
    for name in SIZES:
        columns = {axis: f"{data.trimming}_{name}_{axis}_px" for axis in "uv"}
        axes = [axis for axis, column in columns.items() if rows and all(row[column] is not None for row in rows)]
        if axes:
            return name, max(axes, key=lambda axis: rows[0][columns[axis]])
    return SIZES[-1], "u"


def card_number(estimate: Estimate | None) -> Number:
    """An estimate as plain data."""
    value = None if estimate is None else _finite(estimate.value)
    if estimate is None or value is None:
        return Number(None, None, None, "unknown", "")
    low, high = _finite(estimate.low), _finite(estimate.high)
    bounded = replace(estimate, low=low, high=high)
    text = format_estimate(replace(estimate, low=None, high=None))
    return Number(value, low, high, text, bounds_text(bounded))


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def short(estimate: Estimate | None) -> str:
    """An estimate as part of a short sentence."""
    return with_interval(card_number(estimate))


def estimate_cell(estimate: Estimate) -> str:
    """An estimate as a cell of a table whose heading says which numbers are in px."""
    return DASH if estimate.value is None else format_estimate(estimate).replace(f"{SPACE}px", "")


def with_interval(found: Number) -> str:
    """A number as part of a sentence."""
    return f"{found.text} ({found.interval})" if found.interval else found.text


def answer(question: str, verdict: str, *, wished: Verdict) -> Answer:
    """Answer a question, and say whether the answer is the one that is wished for."""
    outcome = Verdict(verdict)
    return Answer(question, outcome, None if outcome == Verdict.undecided else outcome == wished)


def larger(found: dict[str, Estimate | None]) -> tuple[str, Estimate] | None:
    """The coordinate whose estimate is the farthest from zero, and the estimate; None where none is known."""
    estimates = {
        name: estimate for name, estimate in found.items() if estimate is not None and estimate.value is not None
    }
    if not estimates:
        return None
    name = max(estimates, key=lambda axis: abs(estimates[axis].value or 0.0))
    return name, estimates[name]
