"""What several claims need of a run: its trackers by kind, and points of its curves."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_estimate
from tracknoise.findings.sampling.groups import MIN_WITHIN
from tracknoise.findings.sampling.multiplicity import chosen_among
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import NAMES, POOLED
from tracknoise.tables.enumerations import Aspect, Resampled, Weighting

Point = Mapping[str, Any]
"""A row of `ReportData.points`."""


def tracker_named(data: ReportData, kind: str) -> str | None:
    """The tracker of a kind that the run names first. None if there is none."""
    entries = data.settings["trackers"]
    named = [entry.get("name") or entry["kind"] for entry in entries if entry["kind"] == kind]
    return next((name for name in named if name in data.trackers), None)


def curve(
    data: ReportData, tracker: str, role: str, *, speed: int | None = None, direction: str | None = None
) -> pl.DataFrame:
    """Points of one curve beyond the place where errors are zero, as the reading trims it, sorted by `since`.

    Parameters
    ----------
    data
        Of the run. Its trimming and population are used.
    tracker, role
        Of the curve.
    speed
        By default the nominal one.
    direction
        By default that of the view that figures show.
    """
    points = data.across(data.points, "direction")
    return points.filter(
        pl.col("since") > 0,
        pl.col("speed") == (speed or data.slowest),
        direction=direction or data.view["direction"],
        tracker=tracker,
        role=role,
        trimming=data.trimming,
        population=data.population,
    ).sort("since")


def last(points: pl.DataFrame) -> Point | None:
    """The point farthest from where errors are zero. None where there is no point."""
    return points.row(-1, named=True) if points.height else None


def estimate(point: Point, coordinate: str) -> Estimate:
    """A coordinate of a point with its interval, px."""
    return Estimate(point[coordinate], point[f"{coordinate}_low"], point[f"{coordinate}_high"], unit="px")


def mean_chosen_among(data: ReportData, point: Point, coordinate: str, choices: int) -> Estimate:
    """Mean error of a point in one of its coordinates, px, with an interval that allows for the choice of it.

    Parameters
    ----------
    data
        Of the run.
    point
        Of a curve of mean errors.
    coordinate
        u or v.
    choices
        Of how many coordinates this is one that stands out.
    """
    found = estimate(point, coordinate)
    if choices == 1 or found.low is None:
        return found
    here = {name: point[name] for name in (*POOLED, "population", "trimming", "at")}
    rows = data.intervals.filter(
        aspect=Aspect.all,
        weighting=Weighting.features,
        statistic=NAMES[data.axis.name]["mean"],
        axis=data.axis.name,
        coordinate=coordinate,
        **here,
    )
    row = rows.row(0, named=True)
    return chosen_among(replace(found, level=row["level"]), choices, degrees=_degrees(row))


def _degrees(row: Mapping[str, Any]) -> int:
    """Degrees of freedom of an interval of units that hold the same: the least possible ones within groups."""
    if row["resampled"] == Resampled.within:
        return MIN_WITHIN
    strata = row["n_scenes"] if row["resampled"] == Resampled.blocks else 1
    return int(row["n_units"] - strata)


def excludes_zero(one: Estimate) -> bool:
    """Whether an interval is known and does not contain zero."""
    return one.low is not None and one.high is not None and one.low * one.high > 0


def is_within(one: Estimate, most: float) -> bool:
    """Whether an interval is known and all of it is at most so far from zero."""
    return one.low is not None and one.high is not None and max(-one.low, one.high) <= most


def overlap(one: Estimate, other: Estimate) -> bool | None:
    """Whether two intervals overlap. None where one is unknown."""
    if one.low is None or one.high is None or other.low is None or other.high is None:
        return None
    return one.low <= other.high and other.low <= one.high


def at_place(data: ReportData, one: Estimate, since: int) -> str:
    """An estimate with the place that it is of."""
    return f"{format_estimate(one)} {data.axis.place(since)}"
