"""Box plots of summarised values: orange median, green triangle mean, whiskers at 1.5 interquartile ranges."""

from collections.abc import Mapping, Sequence

import altair as alt
import polars as pl

from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.report.figures.layout import Chart, layered

_VALUES = ("upper_whisker", "upper_quartile", "mean", "median", "lower_quartile", "lower_whisker")
_WIDEST, _LETTER = 34, 7


def box_plot(
    table: pl.DataFrame,
    *,
    field: str,
    colours: Mapping[str, str],
    y: alt.Y,
    width: int,
    height: int,
    places: tuple[str, Sequence[str]] | None = None,
    interval: tuple[str, str, str] | None = None,
) -> Chart:
    """A box for each row of a table.

    Parameters
    ----------
    table
        Columns mean, median, lower_quartile, upper_quartile, lower_whisker, upper_whisker, `field`, and `places`.
    field, colours
        Column that distinguishes the boxes, and the colour of each of its values, in order.
    y
        Axis of the values, for any of the columns.
    width, height
        Of the panel, px.
    places
        Column of the horizontal axis, and the order of its values. Each has one box per colour. By default each colour
        has its own place.
    interval
        Columns of one more value and of the ends of its interval. Null where there is none.
    """
    column, order = places or (field, list(colours))
    tips = [alt.Tooltip(f"{name}:Q", format=".4~g", title=name.replace("_", " ")) for name in _VALUES]
    names = [alt.Tooltip(f"{name}:N") for name in dict.fromkeys((column, field))]
    base = alt.Chart(marks.rows(table)).encode(x=_across(column, order, width), tooltip=[*names, *tips])
    if places is not None:
        base = base.encode(xOffset=alt.XOffset(f"{field}:N", sort=list(colours)))
    across = min(_WIDEST, 0.6 * width / max(1, len(order)) / (1 if places is None else len(colours)))
    box = base.mark_bar(size=across, fillOpacity=0.25, strokeWidth=min(1.2, across / 4)).encode(
        y=marks.on(y, "lower_quartile"),
        y2=alt.Y2("upper_quartile:Q"),
        fill=alt.Fill(f"{field}:N", scale=marks.scale(colours), legend=None),
        stroke=alt.Stroke(f"{field}:N", scale=marks.scale(colours), legend=None),
    )
    layers = [*_whiskers(base, y, across), box, *_middles(base, y, across)]
    if interval is not None:
        layers += _interval(base, y, across, *interval)
    return layered(*layers).properties(width=width, height=height)


def _across(column: str, order: Sequence[str], width: int) -> alt.X:
    """Places in their order. Labels that do not fit are vertical, and smaller if necessary."""
    upright = sum(map(len, order)) * _LETTER > width
    size = min(11.0, 0.95 * width / max(1, len(order)))
    axis = alt.Axis(labelAngle=-90 if upright else 0, labelFontSize=size, labelOverlap=False)
    return alt.X(f"{column}:N", sort=list(order), title=column, axis=axis)


def _whiskers(base: alt.Chart, y: alt.Y, across: float) -> list[alt.Chart]:
    """Lines from the box to both ends, with a cap on each."""
    line = base.mark_rule(color=style.QUIET)
    cap = base.mark_tick(color=style.QUIET, thickness=1, size=across / 2, orient="horizontal")
    return [
        line.encode(y=marks.on(y, "lower_whisker"), y2=alt.Y2("lower_quartile:Q")),
        line.encode(y=marks.on(y, "upper_quartile"), y2=alt.Y2("upper_whisker:Q")),
        cap.encode(y=marks.on(y, "lower_whisker")),
        cap.encode(y=marks.on(y, "upper_whisker")),
    ]


def _middles(base: alt.Chart, y: alt.Y, across: float) -> list[alt.Chart]:
    median = base.mark_tick(color=style.MEDIAN, thickness=2.5, size=across, orient="horizontal", opacity=1)
    mean = base.mark_point(shape="triangle-up", color=style.MEAN, size=min(36.0, 3 + across**2), opacity=1)
    return [median.encode(y=marks.on(y, "median")), mean.encode(y=marks.on(y, "mean"))]


def _interval(base: alt.Chart, y: alt.Y, across: float, value: str, low: str, high: str) -> list[alt.Chart]:
    """A heavy line between the ends of an interval, and a dot at its value, left of the middle of the box."""
    aside = -across / 3
    known = base.transform_filter(f"isValid(datum[{low!r}]) && isValid(datum[{high!r}])")
    tips = [alt.Tooltip(f"{name}:Q", format=".4~g", title=name.replace("_", " ")) for name in (value, low, high)]
    line = known.mark_rule(color=style.INK, strokeWidth=min(3.0, across / 3), opacity=1, xOffset=aside).encode(
        y=marks.on(y, low), y2=alt.Y2(f"{high}:Q"), tooltip=tips
    )
    dot = known.mark_point(color=style.INK, size=min(30.0, 3 + across**2), opacity=1, xOffset=aside).encode(
        y=marks.on(y, value), tooltip=tips
    )
    return [line, dot]
