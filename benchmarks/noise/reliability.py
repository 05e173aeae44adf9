"""Predicted and measured standard deviations of errors, by class of what was predicted."""

import altair as alt
import polars as pl

from benchmarks.noise.calibration import Calibration
from tracknoise.inference.conventions import LEVEL
from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Figure
from tracknoise.report.figures.panels import Panel, arranged, layered
from tracknoise.text import significant
from tracknoise.words import interval_text

_SIZE = 320
_SHOWS = (
    "Errors in {n_classes} classes of predicted variance. A point compares the standard "
    "deviation of one coordinate that was predicted with the one that was measured. {bounds}The line is where the two "
    "are equal."
)
_LOOK_FOR = "Above the line, errors are larger than predicted. The mean distance from it is the ENCE, {ence}."


def reliability(found: Calibration, *, title: str) -> Figure:
    """The reliability plot of predicted covariances.

    Parameters
    ----------
    found
        The comparison with errors.
    title
        Of the plot.
    """
    table = pl.DataFrame(
        [(one.predicted_px, one.measured_px, one.low_px, one.high_px, one.n) for one in found.reliability],
        schema=dict.fromkeys(("predicted", "measured", "low", "high"), pl.Float64) | {"n": pl.Int64},
        orient="row",
    )
    ends = pl.concat([table[name] for name in ("predicted", "measured", "low", "high")])
    chart = layered(_diagonal(ends), *_bars(table, ends), _points(table, ends))
    panel = Panel(chart.properties(width=_SIZE, height=_SIZE, title=alt.Title(title)))
    return Figure(
        id="reliability",
        title=title,
        shows=_SHOWS.format(n_classes=table.height, bounds=_intervals(found)),
        look_for=_LOOK_FOR.format(ence=significant(found.ence, 3)),
        spec=arranged([panel], columns=1),
    )


def _intervals(found: Calibration) -> str:
    """What the bars are; empty where there are none."""
    if found.resampled is None or all(one.low_px is None for one in found.reliability):
        return ""
    return f"Bars are {interval_text(LEVEL, found.resampled, [found.n_scenes])}. "


def _axes(ends: pl.Series, y: str) -> tuple[alt.X, alt.Y]:
    scale = alt.Scale(domain=marks.domain(ends), nice=False)
    return (
        alt.X("predicted:Q", title="predicted standard deviation (px)", scale=scale),
        alt.Y(f"{y}:Q", title="measured standard deviation (px)", scale=scale),
    )


def _diagonal(ends: pl.Series) -> alt.Chart:
    low, high = marks.domain(ends)
    line = pl.DataFrame({"predicted": [low, high], "measured": [low, high]})
    x, y = _axes(ends, "measured")
    chart: alt.Chart = alt.Chart(marks.rows(line)).mark_line(color=style.QUIET, strokeWidth=1).encode(x=x, y=y)
    return chart


def _bars(table: pl.DataFrame, ends: pl.Series) -> list[alt.Chart]:
    """A bar between the bounds of each class; empty without any."""
    known = table.drop_nulls(["low", "high"])
    if known.is_empty():
        return []
    bar = alt.Chart(marks.rows(known)).mark_rule(color=style.PALETTE[0], strokeWidth=1.2)
    x, y = _axes(ends, "low")
    return [bar.encode(x=x, y=y, y2=alt.Y2("high:Q"))]


def _points(table: pl.DataFrame, ends: pl.Series) -> alt.Chart:
    point = alt.Chart(marks.rows(table)).mark_point(filled=True, size=45, color=style.PALETTE[0], opacity=1.0)
    tips = [alt.Tooltip("predicted:Q"), alt.Tooltip("measured:Q"), alt.Tooltip("n:Q", title="errors")]
    x, y = _axes(ends, "measured")
    chart: alt.Chart = point.encode(x=x, y=y, tooltip=tips)
    return chart
