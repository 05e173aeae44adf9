"""Bias, absolute error and spread by age or frame, for all trackers at the lowest speed."""

from collections.abc import Sequence

from tracknoise.findings.wording import number
from tracknoise.report.axis import FRAME
from tracknoise.report.figures.curve_grid import describe_bands, grid
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.readings import readings, when
from tracknoise.report.figures.series import Series
from tracknoise.report.report_data import ReportData

_LAYOUT = (
    "Rows: mean error, mean absolute error, and root of the second moment. In the third row, the second moment is "
    "about zero for solid lines and about the mean for dashed lines. Columns: u and v."
)


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """Trimmed curves, and the same untrimmed: ``error-by-age`` and ``error-by-age-untrimmed``, or ``-frame``."""
    return [_trimmed(data), _untrimmed(data)]


def _trimmed(data: ReportData) -> Figure | Absence:
    title, kept = f"{_title(data)}, trimmed", "the tracks that trimming kept"
    if data.percentile is None:
        title, kept = _title(data), "all tracks (nothing was trimmed in this run)"
    shows = f"Errors of {kept}{data.where}, {_along(data)}. {_LAYOUT}"
    advice = (
        f"A mean error that moves away from zero with {data.axis.distance} is a drift. Where the dashed line is below "
        "the solid one, a bias is part of the error."
    )
    return _figure(data, "trimmed", _id(data), title, shows, advice)


def _untrimmed(data: ReportData) -> Figure | Absence:
    name, title = f"{_id(data)}-untrimmed", f"{_title(data)}, untrimmed"
    if data.percentile is None:
        return Absence(name, title, "Nothing was trimmed in this run, so this figure would be the same.")
    shows = f"The same for all tracks{data.where}, without trimming. The vertical axes have a different scale."
    advice = "The difference from the figure above comes from the dropped tracks. An estimator meets these tracks too."
    return _figure(data, "untrimmed", name, title, shows, advice)


def _id(data: ReportData) -> str:
    return f"error-by-{data.axis.name}"


def _title(data: ReportData) -> str:
    return f"Error by {data.axis.name} at speed {data.slowest}"


def _along(data: ReportData) -> str:
    if data.axis is not FRAME:
        return "by age"
    return "by frame, before and after the key frame. Only tracks alive in the key frame have true positions"


def _figure(data: ReportData, trimming: str, name: str, title: str, shows: str, advice: str) -> Figure | Absence:
    points = data.nominal(data.points).filter(trimming=trimming, population=data.population)
    series = Series("tracker", data.colour)
    found = readings(points, series)
    if not found:
        return Absence(name, title, _nothing(data))
    parts = [
        f"{one.name} has a mean error of {one.describe('mean')}. Its root second moment is {one.describe('second')}."
        for one in found
    ]
    look_for = f"{when(found, data.axis)} {' '.join(parts)} {advice}"
    shows = f"{shows} {describe_bands(points, series)}"
    return Figure(name, title, shows, look_for, grid(points, series, data.axis))


def _nothing(data: ReportData) -> str:
    return (
        f"At speed {data.slowest} no {data.axis.name} other than {data.axis.zero} has {number(data.min_features)} "
        "features with a known error, so there is no curve."
    )
