"""Findings that are withheld, because the errors of the truth can explain what was measured.

Where the truth floor is above the whole error, it is stated too large: as much of it counts as the whole error has.
"""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.analysis.truth_shares import (
    AuditCover,
    FloorCover,
    audited_growth,
    audited_mean,
    cover_of_mean,
    cover_of_second,
    covered_by_floor,
)
from tracknoise.statistics.definitions import NAMES
from tracknoise.tables.enumerations import FloorSource, Trimming, Weighting
from tracknoise.tables.truth_audit import AuditTables
from tracknoise.topics.headline import ReportedConditions, RunTables
from tracknoise.topics.measures import first
from tracknoise.topics.sentences import joined
from tracknoise.words import listing, px, sentence_case


def bias_covers(summary: Mapping[str, Any], means: Mapping[str, Any]) -> dict[str, FloorCover | None]:
    """Mean errors at the reference age beside their floor, by coordinate.

    Parameters
    ----------
    summary
        Row of a condition, schema `SUMMARY`.
    means
        Row of the means there, with mean_u_px and mean_v_px.
    """
    return {
        axis: cover_of_mean(
            means[f"mean_{axis}_px"], _times(summary[f"floor_mean_{axis}_px"], _largest_floor(summary, axis))
        )
        for axis in "uv"
    }


def _times(size: float | None, factor: float) -> float | None:
    return None if size is None else factor * size


def _largest_floor(summary: Mapping[str, Any], axis: str, trimming: str = Trimming.untrimmed) -> float:
    """The whole error relative to the floor, at most 1: errors of the truth are no larger than the whole error."""
    floor, error = summary[f"floor_{axis}_px"], summary[f"{trimming}_rms_{axis}_px"]
    return 1.0 if not floor or error is None else min(error / floor, 1.0)


def withheld_bias(tracker: str, place: str, covers: Mapping[str, FloorCover | None]) -> str | None:
    """The sentence that replaces a finding of bias; None where a coordinate is not covered.

    Parameters
    ----------
    tracker
        Its name.
    place
        The age, as the start of a sentence.
    covers
        By coordinate; empty where nothing is known.
    """
    if not covered_by_floor(*covers.values()):
        return None
    claim = f"No bias of {tracker} is claimed: errors of the truth can cause its mean error."
    return joined([claim, *_sizes(f"{place}, the mean error is", only_covered(covers))])


def audited_bias(tables: RunTables, conditions: ReportedConditions, tracker: str, at: int) -> str | None:
    """The sentence that replaces a finding of bias where faults that the audit found explain most of it; else None.

    Parameters
    ----------
    tables
        With the curves of the audit.
    conditions
        The condition that was audited.
    tracker
        Its name.
    at
        Reference age or frame.
    """
    cover = audited_mean(AuditTables.of(tables).audit_curves, tracker, abs(conditions.since(at)))
    if cover is None or not cover.is_covered:
        return None
    claim = f"No bias of {tracker} is claimed: faults of the truth explain most of its mean error."
    return f"{claim} {_left(conditions.opening_distance(cover.age), 'the mean error', cover)}"


def audited_rise(
    tables: RunTables, conditions: ReportedConditions, tracker: str, coordinate: str, at: int
) -> str | None:
    """The sentence that replaces a finding of growth in a coordinate: see `audited_bias`."""
    cover = audited_growth(AuditTables.of(tables).audit_curves, tracker, coordinate, abs(conditions.since(at)))
    if cover is None or not cover.is_covered:
        return None
    claim = f"No growth of {tracker} in {coordinate} is claimed: faults of the truth explain most of it."
    return f"{claim} {_left(conditions.opening_distance(cover.age), 'the growth of the error', cover)}"


def _left(where: str, what: str, cover: AuditCover) -> str:
    """How much the correction of faults leaves."""
    return f"{where}, {what} is {px(cover.error_px)}, and {px(cover.left_px)} after these faults are corrected."


def covered_coordinates(covers: Mapping[str, FloorCover | None]) -> str:
    """Sentences about coordinates whose mean is covered where that of another is not; else empty."""
    covered = only_covered(covers)
    if not covered:
        return ""
    return joined([f"Errors of the truth can cause the mean in {listing(covered)}.", *_sizes("The mean is", covered)])


def excessive_floor(summary: Mapping[str, Any], trimming: str) -> str:
    """Sentences where the truth floor is larger than the whole error, which has it as a part; else empty.

    `summary`: row of a condition, schema `SUMMARY`.
    """
    pairs = {axis: (summary[f"floor_{axis}_px"], summary[f"{trimming}_rms_{axis}_px"]) for axis in "uv"}
    larger = {axis: pair for axis, pair in pairs.items() if _largest_floor(summary, axis, trimming) < 1.0}
    if not larger:
        return ""
    claim = f"Errors of the truth are smaller than stated: the truth floor is above the error of {summary['tracker']}."
    sizes = (
        f"In {axis} the floor is {px(floor)}, and the error is {px(error)}." for axis, (floor, error) in larger.items()
    )
    return joined([claim, *sizes])


def growth_cover(
    tables: RunTables, conditions: ReportedConditions, tracker: str, coordinate: str, at: int
) -> FloorCover | None:
    """Growth of a second moment, from the first age after birth to another, beside that of its floor.

    Parameters
    ----------
    tables
        With curves and floor.
    conditions
        Say which errors.
    tracker
        Its name.
    coordinate
        u or v.
    at
        The age.
    """
    axis = conditions.axis
    second = conditions.of(tables["curves"], tracker).filter(
        population=conditions.population,
        trimming=conditions.trimmings[0],
        weighting=Weighting.features,
        statistic=NAMES[axis]["second"],
        axis=axis,
    )
    floor = conditions.of(tables["floor"], tracker).filter(source=FloorSource.all, axis=axis)
    summary = first(conditions.of(tables["summary"], tracker)) or {}
    largest = _largest_floor(summary, coordinate, conditions.trimmings[0]) if summary else 1.0
    of_floor = _rise(floor, f"floor_{coordinate}{coordinate}", at)
    return cover_of_second(_rise(second, coordinate, at), _times(of_floor, largest**2))


def _rise(table: pl.DataFrame, column: str, at: int) -> float | None:
    """Growth of a column up to `at`; None where it is unknown there."""
    rows = table.filter(pl.col("at").is_between(1, at)).drop_nulls(column).sort("at")
    if rows.height < 2 or rows["at"][-1] != at:
        return None
    return float(rows[column][-1] - rows[column][0])


def withheld_growth(tracker: str, place: str, covers: Mapping[str, FloorCover | None]) -> str | None:
    """The sentence that replaces a finding of growth in the covered coordinates; None where none is covered."""
    covered = only_covered(covers)
    if not covered:
        return None
    claim = f"No growth of {tracker} in {listing(covered)} is claimed: errors of the truth can cause it."
    return joined([claim, *_sizes(f"{sentence_case(place)}, the error has grown by", covered)])


def only_covered(covers: Mapping[str, FloorCover | None]) -> dict[str, FloorCover]:
    """Those of the coordinates that errors of the truth alone can explain."""
    return {axis: cover for axis, cover in covers.items() if cover is not None and cover.is_covered}


def _sizes(opening: str, covers: Mapping[str, FloorCover]) -> list[str]:
    """A sentence for each coordinate: the size, and what errors of the truth can cause."""
    return [
        f"{opening} {px(cover.error_px)} in {axis}; errors of the truth can cause {px(cover.limit_px)}."
        for axis, cover in covers.items()
    ]
