"""Box plots of summarised values: orange median, green triangle mean, whiskers at 1.5 interquartile ranges."""

from collections.abc import Mapping, Sequence

import altair as alt
import polars as pl

from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.report.figures.layout import Chart, layered

_VALUES = ("upper_whisker", "upper_quartile", "mean", "median", "lower_quartile", "lower_whisker")
_WIDEST, _BEAD, _LETTER = 34, 6.0, 7
"""Widths of a box and of the dot of an interval, at most, and of a letter, px."""
_BESIDE = " beside"
"""What is added to the name of a box for its interval."""


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
    """A box for each row of a table. Rows without a median have no box, and leave no room for one.

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
    table = table.drop_nulls("median")
    colours = {name: colour for name, colour in colours.items() if name in table[field]}
    column, order = places or (field, list(colours))
    order = [name for name in order if name in table[column]]
    tips = [alt.Tooltip(f"{name}:Q", format=".4~g", title=name.replace("_", " ")) for name in _VALUES]
    names = [alt.Tooltip(f"{name}:N") for name in dict.fromkeys((column, field))]
    base = alt.Chart(marks.rows(table)).encode(x=_across(column, order, width), tooltip=[*names, *tips])
    slot, beads = width / max(1, len(order)), base
    if places is not None:
        offsets = [name for colour in colours for name in _offsets(colour, with_interval=interval is not None)]
        base, beads = _side_by_side(base, field, offsets)
        slot /= max(1, len(offsets))
    across = min(_WIDEST, 0.6 * slot)
    box = base.mark_bar(size=across, fillOpacity=0.25, strokeWidth=min(1.2, across / 4)).encode(
        y=marks.on(y, "lower_quartile"),
        y2=alt.Y2("upper_quartile:Q"),
        fill=alt.Fill(f"{field}:N", scale=marks.scale(colours), legend=None),
        stroke=alt.Stroke(f"{field}:N", scale=marks.scale(colours), legend=None),
    )
    layers = [*_whiskers(base, y, across), box, *_middles(base, y, across)]
    if interval is not None:
        wide = min(_BEAD, 0.8 * (slot - across if places is None else slot))
        aside = -(across + 1.2 * wide) / 2 if places is None else 0.0
        layers += _interval(beads, y, wide, aside, *interval)
    return layered(*layers).properties(width=width, height=height)


def _offsets(name: str, *, with_interval: bool) -> list[str]:
    """The places of a box, and of its interval to the left of it."""
    return [name + _BESIDE, name] if with_interval else [name]


def _side_by_side(base: alt.Chart, field: str, offsets: Sequence[str]) -> tuple[alt.Chart, alt.Chart]:
    """Marks of the boxes at one place, and of the intervals, beside each other."""
    scale = alt.Scale(domain=list(offsets))
    boxes = base.encode(xOffset=alt.XOffset(f"{field}:N", scale=scale))
    named = base.transform_calculate(beside=f"datum[{field!r}] + {_BESIDE!r}")
    beads: alt.Chart = named.encode(xOffset=alt.XOffset("beside:N", scale=scale))
    return boxes, beads


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


def _interval(
    beads: alt.Chart, y: alt.Y, wide: float, aside: float, value: str, low: str, high: str
) -> list[alt.Chart]:
    """A heavy line between the ends of an interval, and a dot at its value.

    They are beside the box, where they hide neither the mean nor the median.
    """
    known = beads.transform_filter(f"isValid(datum[{low!r}]) && isValid(datum[{high!r}])")
    tips = [alt.Tooltip(f"{name}:Q", format=".4~g", title=name.replace("_", " ")) for name in (value, low, high)]
    line = known.mark_rule(color=style.INK, strokeWidth=wide / 2, opacity=1, xOffset=aside).encode(
        y=marks.on(y, low), y2=alt.Y2(f"{high}:Q"), tooltip=tips
    )
    dot = known.mark_point(color=style.INK, size=0.8 * wide**2, opacity=1, xOffset=aside).encode(
        y=marks.on(y, value), tooltip=tips
    )
    return [line, dot]
