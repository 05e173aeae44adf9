"""Error of long-lived tracks, compared with that of all tracks."""

from collections.abc import Sequence

import polars as pl

from tracknoise.findings.wording import number
from tracknoise.report import style
from tracknoise.report.axis import FRAME
from tracknoise.report.figures.curve_grid import describe_bands, grid
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.message import apart
from tracknoise.report.figures.readings import Reading, readings, when
from tracknoise.report.figures.series import Series
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import LONG_LIVED_AGES
from tracknoise.tables.enumerations import Aspect

_ALL = "all"
_NAMES = {age: f"to age {age}" for age in LONG_LIVED_AGES}
"""Name of the tracks that live to each age."""


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, at the lowest speed."""
    return [_figure_of(data, tracker) for tracker in data.trackers]


def _figure_of(data: ReportData, tracker: str) -> Figure | Absence:
    points = _points(data, tracker)
    series = _series(points, data.colour[tracker])
    name, title = f"survivorship-bias-{data.slug(tracker)}", f"{tracker}, by track lifetime"
    found = _longest_beside_all(data, points)
    if not found:
        why = f"No {data.axis.name} has enough features whose tracks reach age {LONG_LIVED_AGES[0]}"
        return Absence(name, title, f"{why}, so there is nothing to compare.")
    chart = grid(points, series, data.axis)
    shows = f"{_shows(data, tracker)} {describe_bands(points, series)}"
    return Figure(name, title, shows, _look_for(data, points, found), chart, _message(tracker, points, found))


def _message(tracker: str, points: pl.DataFrame, found: Sequence[Reading]) -> str:
    """How much smaller the RMS of the longest-lived tracks is in u, where the intervals lie apart."""
    rows = [points.filter(tracks=one.name, since=one.since, role="second").row(0, named=True) for one in found]
    every, longest = rows
    if not apart(every, longest, "u"):
        return ""
    share = longest["u"] / every["u"]
    return f"Tracks of {tracker} living {found[1].name} have {number(share)} times the RMS of all in u"


def _points(data: ReportData, tracker: str) -> pl.DataFrame:
    """Curves of visible features, by `tracks`. Moments about the mean are left out: there are many curves."""
    every = data.points.filter(population="visible").with_columns(tracks=pl.lit(_ALL))
    chosen = data.aspect_points.filter(aspect=Aspect.long_lived)
    chosen = chosen.with_columns(tracks=pl.col("at_least").replace_strict(_NAMES, return_dtype=pl.String))
    both = pl.concat([every, chosen.select(every.columns)])
    return data.nominal(both).filter(pl.col("role") != "central", tracker=tracker, trimming=data.trimming)


def _series(points: pl.DataFrame, colour: str) -> Series:
    """The groups that have a curve, in shades that differ as much as their number allows."""
    present = [name for name in (_ALL, *_NAMES.values()) if name in points["tracks"].unique()]
    return Series("tracks", dict(zip(present, style.levels(colour, len(present)), strict=True)))


def _longest_beside_all(data: ReportData, points: pl.DataFrame) -> list[Reading]:
    """All tracks and those that live longest, at an age that other tracks reach too. Empty where there is none."""
    for age in reversed(LONG_LIVED_AGES):
        pair = Series("tracks", dict.fromkeys((_ALL, _NAMES[age]), ""))
        younger = points if data.axis is FRAME else points.filter(pl.col("since") < age)
        found = readings(younger, pair)
        if len(found) == 2 and found[0].since == found[1].since:
            return found
    return []


def _shows(data: ReportData, tracker: str) -> str:
    joined = "" if data.axis is FRAME else " From that age on, the curve is the same as that of all tracks."
    return (
        f"{data.errors_shown} of {tracker} at speed {data.slowest}{data.where}, of visible features. One curve is "
        "for all tracks. The others are for tracks that reach the stated age, in frames of the sequence."
        f"{joined}"
    )


def _look_for(data: ReportData, points: pl.DataFrame, found: Sequence[Reading]) -> str:
    every, longest = found
    n, n_all = (int(points.filter(tracks=one.name, since=one.since, role="second")["n"].sum()) for one in found[::-1])
    return (
        f"{when(found, data.axis)} the root second moment of all tracks is {every.describe('second')}. For tracks that "
        f"live {longest.name} it is {longest.describe('second')}. These are {number(n)} of {number(n_all)} features. "
        "Long-lived tracks may have smaller errors than all tracks at the same age. The curve of all tracks then "
        "flattens partly because bad tracks were lost. The error of a single track need not flatten."
    )
