"""Headlines about ratios: the sentence that the catalogue declares for each, at the reference age."""

from dataclasses import replace
from typing import Any

import polars as pl

from tracknoise.analysis.ratio_intervals import (
    POINT_TRACKING_METRICS,
    RATIO_VALUES,
    point_tracking_metrics,
    ratio_intervals,
)
from tracknoise.inference.estimates import Estimate
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.yardstick import shared_places
from tracknoise.tables.quantities import QUANTITIES, RATIOS
from tracknoise.topics.headline import Headline, Part, ReportedConditions, RunTables, by_tracker
from tracknoise.topics.measures import first
from tracknoise.topics.topic import NO_ROWS, Topic, pooled
from tracknoise.words import bounds_text, format_estimate

_LEAST = 100
"""With fewer features than this, a ratio is not reported."""
_NAMED = 2
"""The sentence in one line names this many trackers."""


def ratios(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Every ratio of every tracker, of the tracks that verdicts are about."""
    enough = tables["ratios"].filter(pl.col("n") >= _LEAST, trimming=conditions.trimming, axis=conditions.axis)
    near = conditions.reported(enough).filter((pl.col("at") - conditions.at_zero).abs() <= REFERENCE_AGE)
    rows = near.join(shared_places(near, ["quantity"], "at"), on=["quantity", "at"], how="semi", maintain_order="left")
    headline = by_tracker(
        conditions.trackers,
        lambda tracker: _ratios_of(rows, conditions, tracker),
        opening=f"Shares of features {conditions.where(tables['summary'])}.",
        topic="ratios",
        figure="error-by-tracker",
        table="ratios",
    )
    return None if headline is None else replace(headline, brief=_brief(rows, conditions))


def _ratios_of(rows: pl.DataFrame, conditions: ReportedConditions, tracker: str) -> Part | None:
    ratio_rows = [(name, row) for name in RATIOS if (row := _at_reference(rows, conditions, tracker, name)) is not None]
    estimates = [_estimate(name, row) for name, row in ratio_rows]
    sentences = [
        f"{conditions.opening_place(row['at'])}, {_within(name).format(value=_plain(estimate), tracker=tracker)}"
        f"{_bounds(estimate)}"
        for (name, row), estimate in zip(ratio_rows, estimates, strict=True)
    ]
    return Part(" ".join(sentences), estimates) if ratio_rows else None


def _plain(estimate: Estimate) -> str:
    """The value without its interval."""
    return format_estimate(replace(estimate, low=None, high=None))


def _bounds(estimate: Estimate) -> str:
    """The interval as a sentence after a space; empty where there is none."""
    bounds = bounds_text(estimate)
    return f" The interval is {bounds}." if bounds else ""


def _within(name: str) -> str:
    """The sentence of a ratio as it follows the age; the braces of a name at its start stay."""
    sentence = QUANTITIES[name].sentence
    return sentence[0].lower() + sentence[1:]


def _at_reference(rows: pl.DataFrame, conditions: ReportedConditions, tracker: str, name: str) -> dict[str, Any] | None:
    """The row of a tracker at the place that trackers share."""
    return first(conditions.of(rows, tracker).filter(quantity=name))


def _estimate(name: str, row: dict[str, Any]) -> Estimate:
    return Estimate.of_row(row, "value", "low", "high", QUANTITIES[name].unit or "")


def _brief(rows: pl.DataFrame, conditions: ReportedConditions) -> str:
    """The first ratio of the first trackers, without intervals."""
    name = RATIOS[0]
    at_reference = {tracker: _at_reference(rows, conditions, tracker, name) for tracker in conditions.trackers}
    values = [
        f"{_plain(_estimate(name, row))} of {tracker}" for tracker, row in at_reference.items() if row is not None
    ]
    return f"{QUANTITIES[name].title}: {' and '.join(values[:_NAMED])}."


RATIOS_OF_SUMS = Topic(
    "ratios",
    (
        pooled(RATIO_VALUES, "ratio_sums", ratio_intervals, if_fitted=NO_ROWS),
        pooled(POINT_TRACKING_METRICS, "point_tracking", point_tracking_metrics),
    ),
    headline=ratios,
    of_these_scenes=True,
)
