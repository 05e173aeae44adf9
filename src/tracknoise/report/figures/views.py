"""Error in rotated images, and in sequences played backward."""

from collections.abc import Sequence

import polars as pl

from tracknoise.findings.wording import listing
from tracknoise.report import style
from tracknoise.report.bands import upright_bounds
from tracknoise.report.figures.comparison import comparison
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.message import effect
from tracknoise.report.figures.series import Series
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import Trimming

_ROTATED = {0: "upright", 90: "sideways", 180: "upside down", 270: "sideways (270°)"}
"""Name of each counter-clockwise rotation of the images, degrees."""


def rotations(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, one colour per rotation. None where there is only one rotation."""
    if len(data.rotations) < 2:
        return []
    return [_rotations_of(data, tracker) for tracker in data.trackers]


def directions(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, one colour per direction; where errors are trimmed, another one of untrimmed errors.

    None where there is only one direction.
    """
    if len(data.directions) < 2:
        return []
    return [_directions_of(data, tracker, trimming) for tracker in data.trackers for trimming in _trimmings(data)]


def _trimmings(data: ReportData) -> Sequence[Trimming]:
    """Trimming may hide a drift, so that untrimmed errors are always shown."""
    is_trimmed = data.trimming == Trimming.trimmed and data.percentile is not None
    return [Trimming.trimmed, Trimming.untrimmed] if is_trimmed else [data.trimming]


def _rotations_of(data: ReportData, tracker: str) -> Figure | Absence:
    points = data.across(data.points, "rotation").filter(tracker=tracker, speed=data.slowest)
    names = [_ROTATED[angle] for angle in data.rotations]
    angles = listing(f"{_ROTATED[angle]} means {angle}° counter-clockwise" for angle in data.rotations if angle)
    return comparison(
        data,
        upright_bounds(points, signed=pl.col("role") == "mean").with_columns(
            rotation=pl.col("rotation").replace_strict(_ROTATED, return_dtype=pl.String)
        ),
        Series("rotation", _two(data, tracker, names), "in {} images"),
        id=f"error-by-rotation-{data.slug(tracker)}",
        title=f"{tracker}, {listing(names, joint='and')}",
        shows=f"{data.errors_shown} of {tracker} at speed {data.slowest}{data.elsewhere('rotation')} in "
        f"images of each rotation ({angles}). Errors are rotated back, so u and v are those of the upright image in "
        "all curves.",
        advice="Where curves coincide, the orientation of the image makes no difference. Where they differ, part of "
        "the error depends on the image axes.",
        message=effect(data, "rotation", tracker, speed=data.slowest),
    )


def _directions_of(data: ReportData, tracker: str, trimming: Trimming) -> Figure | Absence:
    other = trimming != data.trimming
    errors = f"{trimming.capitalize()} errors" if other else data.errors_shown
    return comparison(
        data,
        data.across(data.points, "direction").filter(tracker=tracker, speed=data.slowest),
        Series("direction", _two(data, tracker, data.directions), "when played {}"),
        id=f"error-by-direction-{data.slug(tracker)}{f'-{trimming}' if other else ''}",
        title=f"{tracker}, {listing(data.directions, joint='and')}{f', {trimming}' if other else ''}",
        shows=f"{errors} of {tracker} at speed {data.slowest}{data.elsewhere('direction')} with "
        "the frames in recorded order and in reverse order.",
        advice="A mean error that changes its sign with the direction follows the motion in the image. One that keeps "
        "its sign does not.",
        role="mean",
        trimming=trimming,
        message="" if other else effect(data, "direction", tracker, speed=data.slowest, roles=("mean",)),
    )


def _two(data: ReportData, tracker: str, names: Sequence[str]) -> dict[str, str]:
    return dict(zip(names, style.levels(data.colour[tracker], len(names)), strict=True))
