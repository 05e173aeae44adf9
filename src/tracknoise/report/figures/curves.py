"""Bias, absolute error and spread by age or frame, for all trackers at the lowest speed."""

from collections.abc import Sequence

import polars as pl

from tracknoise.findings.wording import number, px
from tracknoise.report.axis import FRAME
from tracknoise.report.figures.curve_grid import describe_bands, grid
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.message import apart, trackers
from tracknoise.report.figures.readings import readings, when
from tracknoise.report.figures.series import Series
from tracknoise.report.growth import growth_message
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.tables.enumerations import Trimming

_LAYOUT = (
    "Rows: mean error, mean absolute error, and root of the second moment. In the third row, the second moment is "
    "about zero for solid lines and about the mean for dashed lines. Fourth row: core, the sigma of the Gaussian with "
    "the same median absolute error, as geometric mean over scenes. Columns: u and v."
)


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """Curves of the errors that the run is about, and of the others: ``error-by-age``, ``error-by-age-trimmed``."""
    other = Trimming.trimmed if data.trimming == Trimming.untrimmed else Trimming.untrimmed
    return [_shown(data), _other(data, other)]


def _shown(data: ReportData) -> Figure | Absence:
    title = _title(data) if data.percentile is None else f"{_title(data)}, {data.trimming}"
    shows = f"Errors of {data.tracks_shown}{data.where}, {_along(data)}. {_LAYOUT}"
    advice = (
        f"A mean error that moves away from zero with {data.axis.distance} is a drift. Where the dashed line is below "
        "the solid one, a bias is part of the error. Where the core is far below the root second moment, a few large "
        "errors make up most of it."
    )
    return _figure(data, data.trimming, _id(data), title, shows, advice, _message(data))


def _other(data: ReportData, trimming: Trimming) -> Figure | Absence:
    name, title = f"{_id(data)}-{trimming}", f"{_title(data)}, {trimming}"
    if data.percentile is None:
        return Absence(name, title, "Nothing was trimmed in this run, so this figure would be the same.")
    tracks = "all tracks" if trimming == Trimming.untrimmed else "the tracks that trimming kept"
    shows = f"The same for {tracks}{data.where}. The vertical axes have a different scale."
    advice = (
        "The difference from the figure above comes from the tracks that trimming drops. An estimator meets these "
        "tracks too. Trimmed errors depend on how many tracks are lost, and on the length of the sequences."
    )
    return _figure(data, trimming, name, title, shows, advice, _trimming_message(data))


def _id(data: ReportData) -> str:
    return f"error-by-{data.axis.name}"


def _title(data: ReportData) -> str:
    return f"Error by {data.axis.name} at speed {data.slowest}"


def _along(data: ReportData) -> str:
    if data.axis is not FRAME:
        return "by age"
    return "by frame, before and after the key frame. Only tracks alive in the key frame have true positions"


def _message(data: ReportData) -> str:
    """How errors grow; otherwise by how much one tracker is more accurate than another."""
    return growth_message(data) or trackers(data, "core", "The core error of {} is {} times that of {}")


def _trimming_message(data: ReportData) -> str:
    """How trimming changes the RMS of the first tracker, where the intervals lie apart."""
    points = data.nominal(data.points).filter(role="second", population=data.population, tracker=data.trackers[0])
    both = points.filter(pl.col("since").is_between(1, REFERENCE_AGE), pl.col("trimming").is_in(list(Trimming)))
    shared = both.filter(pl.len().over("since") == len(Trimming)).sort("since")
    if shared.is_empty():
        return ""
    rows = {row["trimming"]: row for row in shared.filter(since=shared["since"].max()).to_dicts()}
    before, after = rows[Trimming.untrimmed], rows[Trimming.trimmed]
    if not apart(before, after, "u"):
        return ""
    return f"Trimming lowers the RMS of {data.trackers[0]} in u from {px(before['u'])} to {px(after['u'])}"


def _figure(
    data: ReportData, trimming: str, name: str, title: str, shows: str, advice: str, message: str
) -> Figure | Absence:
    points = data.nominal(data.points).filter(trimming=trimming, population=data.population)
    series = Series("tracker", data.colour)
    found = readings(points, series)
    if not found:
        return Absence(name, title, no_curve(data))
    parts = [
        f"{one.name} has a mean error of {one.describe('mean')}. Its root second moment is {one.describe('second')}."
        for one in found
    ]
    look_for = f"{when(found, data.axis)} {' '.join(parts)} {advice}"
    shows = f"{shows} {describe_bands(points, series)}"
    return Figure(name, title, shows, look_for, grid(points, series, data.axis), message)


def no_curve(data: ReportData) -> str:
    """Say why no tracker has a curve."""
    """Say why no tracker has a curve."""
    return (
        f"At speed {data.slowest} no {data.axis.name} other than {data.axis.zero} has {number(data.min_features)} "
        "features with a known error, so there is no curve."
    )
