"""The largest error of every track before trimming, the threshold of trimming, and the dropped tracks of one scene."""

from collections.abc import Sequence
from itertools import chain

import altair as alt
import polars as pl

from tracknoise.findings.wording import SPACE, count, number, percent, px
from tracknoise.report import style
from tracknoise.report.axis import FRAME
from tracknoise.report.figures import marks
from tracknoise.report.figures.dropped_tracks import TrimmedFrame, trimmed_frame
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, Spec, arranged, layered
from tracknoise.report.figures.message import values
from tracknoise.report.report_data import ReportData

_TITLE = "Errors before trimming"
_FRAME_EXPLAINED = (
    " The images show the features of one scene at the lowest speed. Lines connect dropped features with their true "
    "positions."
)
_DECADES = alt.Axis(values=[10.0**power for power in range(-3, 4)], format="~g")


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One histogram per tracker, with one line per speed, and the image of one scene beside it."""
    table = data.reference(data.errors)
    if not table["n"].sum():
        return [Absence("trimming", _TITLE, "No track has a known true position, so there are no errors.")]
    trackers = [name for name in data.trackers if table.filter(tracker=name)["n"].sum()]
    frame = trimmed_frame(data)
    figure = Figure(
        id="trimming",
        title=_TITLE,
        shows=f"{_shows(data, table)}{'' if frame is None else _FRAME_EXPLAINED}",
        look_for=_look_for(data, trackers),
        spec=_chart(data, trackers, table, frame),
        message=_message(data, trackers),
    )
    return [figure]


def _message(data: ReportData, trackers: Sequence[str]) -> str:
    """Median threshold of each tracker at the lowest speed; empty where nothing was trimmed."""
    cuts = {name: data.cuts(name).filter(speed=data.slowest)["cut"].to_list() for name in trackers}
    return values({name: px(cut[0]) for name, cut in cuts.items() if cut}, "Trimming drops tracks with errors above")


def _chart(data: ReportData, trackers: Sequence[str], table: pl.DataFrame, frame: TrimmedFrame | None) -> Spec:
    width = 385 if len(trackers) > 1 or data.percentile is not None else 700
    histograms = [_panel(data, tracker, table, width=width) for tracker in trackers]
    if frame is None:
        return arranged(histograms, columns=2, independent=["color"])
    rows = zip(histograms, map(frame.panel, trackers), strict=True)
    return frame.shown_in(arranged(list(chain.from_iterable(rows)), columns=2, independent=["color"]))


def _shows(data: ReportData, table: pl.DataFrame) -> str:
    return (
        f"Distribution of the largest error of each track{data.where}. The error is the distance between observed and "
        f"true position. Both axes are logarithmic. The leftmost bin contains all errors below {_first_bound(table)}. "
        f"{_cut_explained(data)}"
    )


def _first_bound(table: pl.DataFrame) -> str:
    return f"{table.filter(bin_low_px=0.0)['bin_high_px'][0]:g}{SPACE}px"


def _cut_explained(data: ReportData) -> str:
    if data.percentile is None:
        return "Nothing was trimmed in this run."
    return (
        f"Dashed lines mark the threshold of trimming. It is the {number(int(data.percentile))}th percentile in each "
        "scene. The line shows the median over scenes."
    )


def _look_for(data: ReportData, trackers: Sequence[str]) -> str:
    parts = [_sentences(data, tracker) for tracker in trackers]
    return (
        f"At speed {data.slowest}, {' '.join(parts)} "
        "A second peak on the right is a group of tracks that follow the wrong point."
    )


def _sentences(data: ReportData, tracker: str) -> str:
    lived = data.nominal(data.lifetimes).filter(tracker=tracker)
    total, once = (_tracks(lived), _tracks(lived.filter(lifetime=1)))
    trims = data.nominal(data.trims).filter(tracker=tracker)
    dropped, measured = int(trims["n_dropped"].sum()), int(trims["n_measured"].sum())
    counted = f"{tracker} has {count(total, 'track')}. "
    counted += (
        f"{number(measured)} of them are alive in the key frame and have a known error."
        if data.axis is FRAME
        else f"{number(once)} of them were seen only in their first frame, where the error is zero."
    )
    cuts = trims["threshold_px"].drop_nulls().sort().to_list()
    if data.percentile is None or not cuts:
        return counted
    low, high = px(cuts[0]), px(cuts[-1])
    where = low if low == high else f"between {low} and {high}, depending on the scene"
    share = percent(dropped / measured)
    return f"{counted} The threshold is {where}. Trimming drops {share} of the tracks with a known error."


def _tracks(lifetimes: pl.DataFrame) -> int:
    return int(lifetimes["n_ended"].sum()) + int(lifetimes["n_censored"].sum())


def _panel(data: ReportData, tracker: str, errors: pl.DataFrame, *, width: int) -> Panel:
    bins = errors.filter(tracker=tracker).with_columns(speed=pl.col("speed").cast(pl.String))
    hue = marks.colour("speed", data.speed_colours(tracker), "speed", legend=len(data.speeds) > 1)
    title = alt.Title(tracker, color=data.colour[tracker])
    chart = layered(_histogram(bins, hue), _cuts(data, tracker, hue))
    chart = chart.properties(width=width, height=230, title=title)
    return Panel(chart, (marks.shown("speed", data.speed_colours(tracker)),))


def _histogram(bins: pl.DataFrame, hue: alt.Color) -> alt.Chart:
    """Steps from bin to bin. The first and the last bin are infinite and are drawn a tenth of a decade wide."""
    tenth = 10**0.1
    low = pl.when(pl.col("bin_low_px") > 0).then("bin_low_px").otherwise(pl.col("bin_high_px") / tenth)
    last = bins.filter(pl.col("n") > 0)["bin_high_px"].fill_null(float("inf")).max()
    table = bins.filter(pl.col("bin_low_px") <= last).select(
        "tracker", "speed", "n", marks.drawn_count(pl.col("n")), low=low, to="bin_high_px", of="bin_low_px"
    )
    x = alt.X("low:Q", scale=alt.Scale(type="log", nice=False), title="largest error of the track (px)", axis=_DECADES)
    tips = [
        alt.Tooltip("speed:N"),
        alt.Tooltip("of:Q", title="from (px)"),
        alt.Tooltip("to:Q", title="to (px)"),
        alt.Tooltip("n:Q", title="tracks"),
    ]
    y = marks.log_count("tracks (count)", table["drawn"])
    chart = alt.Chart(marks.rows(table)).mark_line(interpolate="step-after")
    encoded: alt.Chart = chart.encode(x=x, y=y, color=hue, opacity=marks.opacity("speed"), tooltip=tips)
    return encoded


def _cuts(data: ReportData, tracker: str, hue: alt.Color) -> alt.Chart:
    """A line at the threshold of each speed. One at 0 px is left out, because the axis is logarithmic."""
    table = data.cuts(tracker).filter(pl.col("cut") > 0).with_columns(pl.col("speed").cast(pl.String))
    tips = [alt.Tooltip("speed:N"), alt.Tooltip("cut:Q", title="threshold (px)")]
    chart = alt.Chart(marks.rows(table)).mark_rule(strokeDash=[5, 3], strokeWidth=1.5, color=style.INK)
    encoded: alt.Chart = chart.encode(x=alt.X("cut:Q"), color=hue, opacity=marks.opacity("speed"), tooltip=tips)
    return encoded
