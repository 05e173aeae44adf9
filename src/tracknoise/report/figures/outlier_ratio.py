"""The share of features that a tracker rejects per frame, as box plots."""

from collections.abc import Mapping, Sequence
from typing import Any

import altair as alt
import polars as pl

from tracknoise.findings.wording import listing, percent
from tracknoise.report.bands import describe_intervals, of_scalar
from tracknoise.report.figures import light_sweeps
from tracknoise.report.figures.box_plot import box_plot
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged
from tracknoise.report.figures.message import effect, values
from tracknoise.report.report_data import ReportData

_TITLE = "Outlier ratio"
_INTERVAL = ("pooled_ratio", "low", "high")


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """By speed, and by lighting where there are several."""
    table = data.reference(_entered(data))
    if table.is_empty():
        why = "No tracker that reports outliers carried a feature from one frame to the next."
        return [Absence("outlier-ratio", _TITLE, why)]
    return [_by_speed(data, table), *_by_lighting(data)]


def _entered(data: ReportData) -> pl.DataFrame:
    """Conditions with an outlier ratio: those that carried a feature into some frame, and report outliers."""
    return of_scalar(data.outliers.filter(pl.col("pooled_ratio").is_not_null()), data.intervals, "outlier_ratio")


def _by_speed(data: ReportData, table: pl.DataFrame) -> Figure:
    panels = [
        _panel(
            data,
            table.filter(tracker=tracker).with_columns(pl.col("speed").cast(pl.String)),
            "speed",
            data.speed_colours(tracker),
            tracker,
        )
        for tracker in data.trackers
    ]
    return Figure(
        id="outlier-ratio",
        title=_TITLE,
        shows=f"Share of features that a tracker rejected in a frame, over all frames{data.where}. The box spans the "
        "quartiles. The orange line is the median and the green triangle is the mean. Whiskers reach the last frame "
        f"within 1.5 interquartile ranges. {_intervals(table)}",
        look_for=_look_for(data, table),
        spec=arranged(panels, columns=3, independent=["fill", "stroke"]),
        message=values(_shares(data, table), "Rejected features"),
    )


def _shares(data: ReportData, table: pl.DataFrame) -> dict[str, str]:
    """Outlier ratio of each tracker at the lowest speed."""
    rows = data.in_order(table.filter(speed=data.slowest)).to_dicts()
    return {row["tracker"]: percent(row["pooled_ratio"]) for row in rows}


def _by_lighting(data: ReportData) -> list[Figure]:
    """One figure. None where there is only one lighting."""
    if len(data.lightings) < 2:
        return []
    table = data.across(_entered(data), "lighting")
    parts = [_range(tracker, table.filter(tracker=tracker, speed=data.slowest)) for tracker in data.trackers]
    figure = Figure(
        id="outlier-ratio-by-lighting",
        title=f"{_TITLE} by lighting",
        shows=f"The same for every lighting{data.elsewhere('lighting')}, {light_sweeps.legend(data)}. "
        f"{_intervals(table)}",
        look_for=f"Shares of all features carried into a frame at speed {data.slowest}: "
        f"{'; '.join(part for part in parts if part)}.",
        spec=light_sweeps.boxes(data, table, _ratio(data), interval=_INTERVAL),
        message=effect(data, "lighting", data.trackers[0], speed=data.slowest, roles=("outlier_ratio",)),
    )
    return [figure]


def _look_for(data: ReportData, table: pl.DataFrame) -> str:
    parts = []
    for tracker in data.trackers:
        rows = table.filter(tracker=tracker).sort("speed").to_dicts()
        shares = [f"{_with_interval(row)} at speed {row['speed']}" for row in rows]
        parts += [f"Of the features carried into a frame, {tracker} rejected {listing(shares)}."] if shares else []
    return f"{' '.join(parts)} A mean above the median indicates a few bad frames."


def _with_interval(row: Mapping[str, Any]) -> str:
    ratio = percent(row["pooled_ratio"])
    return ratio if row["low"] is None else f"{ratio} ({percent(row['low'])} to {percent(row['high'])})"


def _intervals(table: pl.DataFrame) -> str:
    return describe_intervals(table, of="the pooled outlier ratio", marks="Heavy lines and dots show")


def _range(tracker: str, table: pl.DataFrame) -> str:
    if table.is_empty():
        return ""
    ordered = table.sort("pooled_ratio")
    low, high = ordered.row(0, named=True), ordered.row(-1, named=True)
    ends = [f"{percent(row['pooled_ratio'])} under {row['lighting']}" for row in (low, high)]
    return f"{tracker} rejected between {ends[0]} and {ends[1]}"


def _panel(data: ReportData, table: pl.DataFrame, field: str, colours: Mapping[str, str], tracker: str) -> Panel:
    width = 780 // min(3, max(2, len(data.trackers)))
    chart = box_plot(table, field=field, colours=colours, y=_ratio(data), width=width, height=230, interval=_INTERVAL)
    return Panel(chart.properties(title=alt.Title(tracker, color=data.colour[tracker])))


def _ratio(data: ReportData) -> alt.Y:
    """One axis for all panels."""
    table = _entered(data)
    largest = max(value for name in ("upper_whisker", "mean", "high") for value in table[name].drop_nulls())
    scale = alt.Scale(domain=[0, 1.05 * largest or 1.0], nice=False)
    return alt.Y("median:Q", scale=scale, title="outlier ratio (share of features)")
