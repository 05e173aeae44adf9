"""Error along and across the motion and the image gradient, compared with that in u and v."""

from collections.abc import Sequence

import polars as pl

from tracknoise.findings.wording import SPACE, listing, number, px
from tracknoise.report import style
from tracknoise.report.figures.curve_grid import describe_bands, grid
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.message import apart
from tracknoise.report.figures.readings import Reading, readings, when
from tracknoise.report.figures.series import Series
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import LEAST_MOTION_PX
from tracknoise.statistics.truth.floor import FLOOR_COLUMNS
from tracknoise.tables.enumerations import Aspect

_LEAST = f"{number(LEAST_MOTION_PX, digits=1)}{SPACE}px"
_IMAGE = "u and v"
_PHRASES = {
    _IMAGE: "{} in u and {} in v",
    Aspect.motion: "{} along the motion and {} across it",
    Aspect.gradient: "{} along the gradient and {} across it",
}
"""How a sentence states the two values of each curve."""


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, at the lowest speed."""
    return [_along_and_across(data, tracker) for tracker in data.trackers]


def _along_and_across(data: ReportData, tracker: str) -> Figure | Absence:
    name, title = f"along-and-across-{data.slug(tracker)}", f"{tracker}, along and across"
    points, series = _points(data, tracker), _series(data, tracker)
    found = readings(points, series)
    if not {one.name for one in found} - {_IMAGE}:
        why = f"No {data.axis.name} has enough features with a known error and a known motion or gradient"
        return Absence(name, title, f"{why}, so there is no curve.")
    shows = f"{_shows(data, tracker)} {describe_bands(points, series)}"
    chart = grid(points, series, data.axis)
    return Figure(name, title, shows, _look_for(data, points, found), chart, _message(tracker, points, found))


def _message(tracker: str, points: pl.DataFrame, found: Sequence[Reading]) -> str:
    """Where the RMS along the motion or gradient differs from that across it, and the intervals lie apart."""
    for one in found:
        row = points.filter(axes=one.name, since=one.since, role="second").row(0, named=True)
        if one.name != _IMAGE and apart(row, row, "v", "u"):
            return f"Errors of {tracker} are larger across the {one.name} than along it"
        if one.name != _IMAGE and apart(row, row, "u", "v"):
            return f"Errors of {tracker} are larger along the {one.name} than across it"
    return ""


def _points(data: ReportData, tracker: str) -> pl.DataFrame:
    """Curves of visible features, by `axes`."""
    image = data.points.filter(population="visible").with_columns(
        *(pl.lit(None, dtype=pl.Float64).alias(name) for name in FLOOR_COLUMNS),  # unknown along and across
        aspect=pl.lit(_IMAGE),
    )
    aspects = data.aspect_points.filter(pl.col("aspect").is_in([Aspect.motion, Aspect.gradient]))
    aspects = aspects.with_columns(pl.col("aspect").cast(pl.String))
    both = pl.concat([image, aspects.select(image.columns)]).rename({"aspect": "axes"})
    return data.nominal(both).filter(tracker=tracker, trimming=data.trimming)


def _series(data: ReportData, tracker: str) -> Series:
    colours = dict(zip(_PHRASES, style.shades(data.colour[tracker], len(_PHRASES)), strict=True))
    return Series("axes", colours, "for {}", ("u, or along", "v, or across"))


def _shows(data: ReportData, tracker: str) -> str:
    return (
        f"{data.errors_shown} of {tracker} at speed {data.slowest}{data.where}, of visible features. Three pairs of "
        "directions are compared. The first is u and v. The second is along and across the motion of the true position "
        f"since the previous frame that the tracker saw, if it moved by {_LEAST} or more. Along the motion, an error "
        "is negative if the feature lags behind. Across it, an error to the right is positive. The third is along and "
        "across the dominant image gradient where the feature was first seen, if there was one. A gradient has no "
        "sign, so there is no mean error along it. Dashed: covariance about the mean."
    )


def _look_for(data: ReportData, points: pl.DataFrame, found: Sequence[Reading]) -> str:
    means = ". It is ".join(_values(one, "mean") for one in found if "mean" in one.values)
    roots = ". It is ".join(_values(one, "second") for one in found)
    counts = listing(f"{number(_features(points, one))} for {one.name}" for one in found)
    return (
        f"{when(found, data.axis)} the mean error is {means}. The root second moment is {roots}. Number of "
        f"features: {counts}. A mean error that follows the motion is visible along the motion. In u and v it may "
        "average out if the motion changes direction. Where errors across the gradient are larger than along it, "
        "features slide along edges."
        f"{_caution(data)}"
    )


def _caution(data: ReportData) -> str:
    """Recorded true positions have errors, which affect the direction of motion too."""
    if all(entry.truth == "raycast" for entry in data.sequences.values()):
        return ""
    return " Caution: noise of the true positions looks like a lag too, and more so for slow motion."


def _values(reading: Reading, role: str) -> str:
    return _PHRASES[reading.name].format(*(px(value) for value in reading.values[role]))


def _features(points: pl.DataFrame, reading: Reading) -> int:
    return int(points.filter(axes=reading.name, since=reading.since, role="second")["n"].sum())
