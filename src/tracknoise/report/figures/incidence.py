"""Causes of track ends: cumulative incidence by lifetime."""

from collections.abc import Mapping, Sequence

import altair as alt
import polars as pl

from tracknoise.findings.wording import listing, percent
from tracknoise.report import style
from tracknoise.report.bands import describe_intervals
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.figures.message import values
from tracknoise.report.report_data import ReportData
from tracknoise.tables.schema import CAUSES

_NAMES = {"lost": "lost", "outlier": "rejected as an outlier", "displaced": "displaced", "masked": "masked"}
_COLOURS = dict(zip((_NAMES[cause] for cause in CAUSES), style.colours(CAUSES), strict=True))
_LIFETIME = alt.X("lifetime:Q", title="lifetime (frames that the tracker saw)", axis=alt.Axis(tickMinStep=1))
_SHARE = alt.Y("incidence:Q", scale=alt.Scale(domain=[0, 1]), title="share of tracks that have ended")
_ID, _TITLE = "ends-by-cause", "Causes of track ends"


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """Each tracker at the lowest speed."""
    table = data.nominal(data.incidence)
    if table.is_empty():
        return [Absence(_ID, _TITLE, "No tracker of this run reports why tracks end.")]
    table = table.with_columns(
        series=pl.col("cause").cast(pl.String).replace_strict(_NAMES), n_resampled=pl.col("n_scenes")
    )
    trackers = [tracker for tracker in data.trackers if tracker in table["tracker"]]
    panels = [_panel(table.filter(tracker=tracker), tracker, data.colour[tracker]) for tracker in trackers]
    bands = describe_intervals(table.filter(pl.col("low").is_not_null()), of="the curves")
    figure = Figure(
        id=_ID,
        title=_TITLE,
        shows=f"Cumulative incidence (Aalen and Johansen) at speed {data.slowest}{data.where}: share of tracks that "
        "have ended by each cause up to a lifetime. A track ends by one cause only. At every lifetime, the four "
        "curves and the share of tracks that live longer add up to 1. Masked tracks moved into the border or onto "
        f"another feature. Displaced tracks moved farther in one step than the tracker allows. {bands}",
        look_for=" ".join(_sentence(tracker, table.filter(tracker=tracker)) for tracker in trackers)
        + " Only lost tracks and outliers are failures of a tracker. The other causes follow from its rules.",
        spec=arranged(panels, columns=2, independent=["fill"]),
        message=_message(table, trackers),
    )
    return [figure]


def _message(table: pl.DataFrame, trackers: Sequence[str]) -> str:
    """The most frequent cause of each tracker, where this is established."""
    last = table.filter(pl.col("lifetime") == pl.col("lifetime").max().over("tracker"), pl.col("incidence") > 0)
    causes = {name: cause for name in trackers if (cause := _most_frequent(last.filter(tracker=name)))}
    return values(causes, "Most frequent cause of ends")


def _most_frequent(causes: pl.DataFrame) -> str:
    """The cause whose interval is above those of all others, or the only one; empty if there is none."""
    ranked = causes.sort("incidence", descending=True)
    low, highs = ranked["low"].head(1), ranked["high"].slice(1)
    if ranked.is_empty() or highs.null_count() or not (highs < low.fill_null(0.0)).all():
        return ""
    return str(ranked["series"][0])


def _sentence(tracker: str, table: pl.DataFrame) -> str:
    last = table.filter(pl.col("lifetime") == pl.col("lifetime").max()).to_dicts()
    shares: Mapping[str, float] = {row["series"]: row["incidence"] for row in last if row["incidence"]}
    ranked = sorted(shares, key=lambda name: (-shares[name], name))[:2]
    if not ranked:
        return f"No track of {tracker} ended before its sequence did."
    parts = listing(f"{percent(shares[name])} are {name}" for name in ranked)
    return f"Of the tracks of {tracker}, {parts} by lifetime {last[0]['lifetime']}."


def _panel(table: pl.DataFrame, tracker: str, colour: str) -> Panel:
    hue, opacity = marks.colour("series", _COLOURS, "cause"), marks.opacity("series")
    tips = [alt.Tooltip("series:N", title="cause"), alt.Tooltip("lifetime:Q"), alt.Tooltip("incidence:Q", format=".3f")]
    known = table.select("series", "lifetime", "incidence", "low", "high").sort("series", "lifetime")
    line = alt.Chart(marks.rows(known.drop("low", "high"))).mark_line(interpolate="step-after")
    line = line.encode(x=_LIFETIME, y=_SHARE, tooltip=tips, color=hue, opacity=opacity)
    band = _band(known.drop_nulls())
    chart = layered(*band, line).properties(width=385, height=240, title=alt.Title(tracker, color=colour))
    return Panel(chart, (marks.shown("series", _COLOURS),), layer=len(band))


def _band(known: pl.DataFrame) -> list[alt.Chart]:
    """Areas between the bounds. Empty where there are none."""
    if known.is_empty():
        return []
    area = alt.Chart(marks.rows(known)).mark_area(interpolate="step-after", tooltip=None)
    fill, opacity = marks.fill("series", _COLOURS), marks.faint("series")
    encoded: alt.Chart = area.encode(
        x=_LIFETIME, y=marks.on(_SHARE, "low"), y2=alt.Y2("high:Q"), fill=fill, opacity=opacity
    )
    return [encoded]
