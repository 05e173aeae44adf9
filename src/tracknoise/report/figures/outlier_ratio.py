"""What share of its features a tracker rejects, frame by frame, as box plots."""

from collections.abc import Mapping, Sequence
from typing import Any

import altair as alt
import polars as pl

from tracknoise.findings.wording import percent
from tracknoise.report.bands import of_scalar, told
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures import light_sweeps
from tracknoise.report.figures.box_plot import box_plot
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.figures.layout import Panel, arranged
from tracknoise.report.sentences import listing

_TITLE = "Outlier ratio"
_INTERVAL = ("pooled_ratio", "low", "high")


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """By speed, and by lighting where there are several."""
    table = evidence.reference(_entered(evidence))
    if table.is_empty():
        why = "No tracker ever carried a feature from one frame to the next, so no share of them was rejected."
        return [Absence("outlier-ratio", _TITLE, why)]
    return [_by_speed(evidence, table), *_by_lighting(evidence)]


def _entered(evidence: Evidence) -> pl.DataFrame:
    """Conditions that carried a feature into some frame, and so have a ratio."""
    return of_scalar(evidence.outliers.filter(pl.col("n_frames") > 0), evidence.intervals, "outlier_ratio")


def _by_speed(evidence: Evidence, table: pl.DataFrame) -> Figure:
    panels = [
        _panel(
            evidence,
            table.filter(tracker=tracker).with_columns(pl.col("speed").cast(pl.String)),
            "speed",
            evidence.speed_colours(tracker),
            tracker,
        )
        for tracker in evidence.trackers
    ]
    return Figure(
        id="outlier-ratio",
        title=_TITLE,
        shows=f"The share of features that a tracker rejected in a frame, over all frames{evidence.where}: box from "
        "the first to the third quartile, orange line the median, green triangle the mean, whiskers to the last frame "
        f"within 1.5 interquartile ranges. {_intervals(table)}",
        look_for=_look_for(evidence, table),
        spec=arranged(panels, columns=3, independent=["fill", "stroke"]),
    )


def _by_lighting(evidence: Evidence) -> list[Figure]:
    """One figure; none where there is one lighting."""
    if len(evidence.lightings) < 2:
        return []
    table = evidence.across(_entered(evidence), "lighting")
    parts = [_range(tracker, table.filter(tracker=tracker, speed=evidence.slowest)) for tracker in evidence.trackers]
    figure = Figure(
        id="outlier-ratio-by-lighting",
        title=f"{_TITLE} by lighting",
        shows=f"The same under every lighting{evidence.elsewhere('lighting')}, {light_sweeps.legend(evidence)}. "
        f"{_intervals(table)}",
        look_for=f"At speed {evidence.slowest}, of all features carried into a frame, "
        f"{'; '.join(part for part in parts if part)}.",
        spec=light_sweeps.boxes(evidence, table, _ratio(evidence), interval=_INTERVAL),
    )
    return [figure]


def _look_for(evidence: Evidence, table: pl.DataFrame) -> str:
    parts = []
    for tracker in evidence.trackers:
        rows = table.filter(tracker=tracker).sort("speed").to_dicts()
        shares = [f"{_with_interval(row)} at speed {row['speed']}" for row in rows]
        parts += [f"{tracker} rejected {listing(shares)}"] if shares else []
    return (
        f"Of all features carried into a frame, {'; '.join(parts)}. A mean above the median tells of a few bad frames."
    )


def _with_interval(row: Mapping[str, Any]) -> str:
    ratio = percent(row["pooled_ratio"])
    return ratio if row["low"] is None else f"{ratio} ({percent(row['low'])} to {percent(row['high'])})"


def _intervals(table: pl.DataFrame) -> str:
    return told(table, of="the share of all features carried into a frame", marks="Heavy line, bead:")


def _range(tracker: str, table: pl.DataFrame) -> str:
    if table.is_empty():
        return ""
    ordered = table.sort("pooled_ratio")
    low, high = ordered.row(0, named=True), ordered.row(-1, named=True)
    ends = [f"{percent(row['pooled_ratio'])} under {row['lighting']}" for row in (low, high)]
    return f"{tracker} rejected from {ends[0]} to {ends[1]}"


def _panel(evidence: Evidence, table: pl.DataFrame, field: str, colours: Mapping[str, str], tracker: str) -> Panel:
    width = 780 // min(3, max(2, len(evidence.trackers)))
    chart = box_plot(
        table, field=field, colours=colours, y=_ratio(evidence), width=width, height=230, interval=_INTERVAL
    )
    return Panel(chart.properties(title=alt.Title(tracker, color=evidence.colour[tracker])))


def _ratio(evidence: Evidence) -> alt.Y:
    """One axis for all panels."""
    table = _entered(evidence)
    largest = max(value for name in ("upper_whisker", "mean", "high") for value in table[name].drop_nulls())
    scale = alt.Scale(domain=[0, 1.05 * largest or 1.0], nice=False)
    return alt.Y("median:Q", scale=scale, title="outlier ratio (share of features)")


FAMILY = Family(
    id="outlier-ratio",
    title=_TITLE,
    lead="Before a tracker reports a frame it rejects the features that do not move like the others. The outlier ratio "
    "is the share it rejects of those it carried over from the previous frame.",
    figures=figures,
)
