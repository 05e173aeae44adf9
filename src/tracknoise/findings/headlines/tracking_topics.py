"""Headlines about outliers and lifetimes."""

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_estimate
from tracknoise.findings.headlines.headline import Headline, Part, RunTables, by_tracker
from tracknoise.findings.headlines.reported_conditions import ReportedConditions, scalar_bounds


def outliers(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """What share of its features each tracker rejects."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _outliers_of(tables, conditions, tracker),
        opening=f"Outlier ratio {conditions.where(tables['summary'])}.",
        topic="outliers",
        figure="outlier-ratio",
        table="intervals",
    )


def _outliers_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    ratio = _value(conditions.of(tables["summary"], tracker), "outlier_ratio")
    if ratio is None:
        return None
    bounds = scalar_bounds(conditions.of(tables["intervals"], tracker), "outlier_ratio")
    estimate = Estimate.of(ratio, bounds, "share")
    return f"{tracker} rejects {format_estimate(estimate)} of the features carried into a frame.", [estimate]


def lifetimes(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Median lifetime of tracks."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _lifetime_of(tables, conditions, tracker),
        opening=f"Median lifetime {conditions.where(tables['summary'])} (Kaplan-Meier).",
        topic="lifetimes",
        figure="lifetimes",
        table="intervals",
    )


def _lifetime_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = conditions.of(tables["summary"], tracker)
    if not _value(rows, "n_tracks"):
        return None
    median = _value(rows, "median_lifetime")
    if median is None:
        return f"{tracker}: unknown, because more than half of the tracks are alive at the end of the data.", []
    bounds = scalar_bounds(conditions.of(tables["intervals"], tracker), "median_lifetime")
    estimate = Estimate.of(median, bounds, "frames")
    return f"{tracker}: {format_estimate(estimate)}.", [estimate]


def _value(rows: pl.DataFrame, column: str) -> float | None:
    value: float | None = rows[column][0] if rows.height else None
    return value
