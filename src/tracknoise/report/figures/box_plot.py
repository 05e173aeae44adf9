"""Box plots of values summarised before: orange median, green triangle mean, whiskers at 1.5 interquartile ranges."""

from collections.abc import Mapping

import altair as alt
import polars as pl

from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.report.figures.layout import Chart

_VALUES = ("upper_whisker", "upper_quartile", "mean", "median", "lower_quartile", "lower_whisker")
_WIDEST, _LETTER = 34, 7


def box_plot(
    table: pl.DataFrame, *, field: str, colours: Mapping[str, str], y: alt.Y, width: int, height: int
) -> Chart:
    """A box for each row of a table.

    Parameters
    ----------
    table
        Columns mean, median, lower_quartile, upper_quartile, lower_whisker, upper_whisker and `field`.
    field, colours
        Column that tells the boxes apart, and the colour of each of its values, in order.
    y
        Axis of the values, for any of the columns.
    width, height
        Of the panel, px.
    """
    tips = [alt.Tooltip(f"{name}:Q", format=".4~g", title=name.replace("_", " ")) for name in _VALUES]
    upright = sum(map(len, colours)) * _LETTER > width
    x = alt.X(f"{field}:N", sort=list(colours), title=field, axis=alt.Axis(labelAngle=-90 if upright else 0))
    base = alt.Chart(marks.rows(table)).encode(x=x, tooltip=[alt.Tooltip(f"{field}:N"), *tips])
    across = min(_WIDEST, 0.6 * width / max(1, table.height))
    box = base.mark_bar(size=across, fillOpacity=0.25, strokeWidth=1.2).encode(
        y=_at(y, "lower_quartile"),
        y2="upper_quartile:Q",
        fill=alt.Fill(f"{field}:N", scale=marks.scale(colours), legend=None),
        stroke=alt.Stroke(f"{field}:N", scale=marks.scale(colours), legend=None),
    )
    layers = alt.layer(*_whiskers(base, y, across), box, *_middles(base, y, across))
    return layers.properties(width=width, height=height)


def _whiskers(base: alt.Chart, y: alt.Y, across: float) -> list[alt.Chart]:
    """Lines from the box to both ends, with a cap on each."""
    line = base.mark_rule(color=style.QUIET)
    cap = base.mark_tick(color=style.QUIET, thickness=1, size=across / 2, orient="horizontal")
    return [
        line.encode(y=_at(y, "lower_whisker"), y2="lower_quartile:Q"),
        line.encode(y=_at(y, "upper_quartile"), y2="upper_whisker:Q"),
        cap.encode(y=_at(y, "lower_whisker")),
        cap.encode(y=_at(y, "upper_whisker")),
    ]


def _middles(base: alt.Chart, y: alt.Y, across: float) -> list[alt.Chart]:
    median = base.mark_tick(color=style.MEDIAN, thickness=2.5, size=across, orient="horizontal", opacity=1)
    mean = base.mark_point(shape="triangle-up", color=style.MEAN, size=36, opacity=1)
    return [median.encode(y=_at(y, "median")), mean.encode(y=_at(y, "mean"))]


def _at(y: alt.Y, column: str) -> alt.Y:
    """The same axis for another column."""
    placed = y.copy()
    placed.shorthand = f"{column}:Q"
    return placed
