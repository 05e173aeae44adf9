"""Panels that figures share: their arrangement, lines by age, and box plots.

- Panels arranged in one Vega-Lite specification.
- Panels with lines and bands by age, one per coordinate, for tables whose rows are of single coordinates.
- Box plots of summarised values: orange median, green triangle mean, whiskers at 1.5 interquartile ranges.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self, TypeAlias

import altair as alt
import polars as pl

from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.topics.bands import BOUNDS

Spec: TypeAlias = dict[str, Any]
"""A Vega-Lite specification."""
Chart: TypeAlias = alt.Chart | alt.LayerChart | alt.FacetChart


@dataclass(frozen=True, slots=True)
class Panel:
    """A chart and its selections.

    Attributes
    ----------
    chart
        The chart, without parameters.
    selections
        Vega-Lite parameters without their views. Panels share a selection of the same name: what is muted in one is
        muted in all.
    layer
        The layer that has the selections, if the chart has several. It must have the scales and the legend.
    """

    chart: Chart
    selections: tuple[Mapping[str, Any], ...] = ()
    layer: int = 0


def arranged(panels: Sequence[Panel], *, columns: int, independent: Sequence[str] = ()) -> Spec:
    """Arrange panels in rows of `columns`. Each panel has its own scales for the channels in `independent`.

    Altair can do the same, but copies every chart at every level, which took half of the time of a report. Nor are
    specifications checked against the schema of Vega-Lite here, which took half of the rest. The tests check them.
    """
    parameters: dict[str, Spec] = {}
    datasets: Spec = {}
    specs = []
    for place, panel in enumerate(panels):
        spec = panel.chart.to_dict(validate=False)
        datasets |= spec.pop("datasets", {})
        _limit_title(spec)
        view = f"panel_{place}"
        unit = spec["layer"][panel.layer] if "layer" in spec else spec
        unit["name"] = view
        specs.append({key: value for key, value in spec.items() if key not in ("$schema", "config")})
        for selection in panel.selections:
            _join(parameters.setdefault(selection["name"], {**selection, "views": []}), selection, view)
    return {
        "$schema": alt.SCHEMA_URL,
        "columns": columns,
        "concat": specs,
        "datasets": datasets,
        "params": list(parameters.values()),
        "resolve": {"scale": dict.fromkeys(independent, "independent")},
    }


def _join(parameter: Spec, selection: Mapping[str, Any], view: str) -> None:
    """Add a view to a parameter, and what is selected there from the start: a legend may have other names there."""
    parameter["views"].append(view)
    if "value" in parameter:
        start = parameter["value"]
        parameter["value"] = [*start, *(entry for entry in selection["value"] if entry not in start)]


def _limit_title(spec: Spec) -> None:
    """Cut the title of a panel that is longer than the panel is wide: it would widen the figure."""
    title, width = spec.get("title"), spec.get("width")
    if title and isinstance(width, int | float):
        spec["title"] = {"limit": width, **(title if isinstance(title, dict) else {"text": title})}


class _Layers(alt.LayerChart):
    """Layers whose shallow copies share the charts. Altair copies every chart whenever a property is set."""

    def copy(self, deep: bool | Iterable[Any] = True, ignore: list[str] | None = None) -> Self:
        if deep:
            return super().copy(deep, ignore)
        copied = type(self)()
        for name, value in self._kwds.items():
            copied[name] = value
        return copied


def layered(*charts: alt.Chart) -> alt.LayerChart:
    """Draw charts above each other, the last on top. If all are of the same data, these belong to the whole.

    `altair.layer` gives the same, but copies every chart and its data four times.
    """
    layers = _Layers()
    if all(chart.data is charts[0].data for chart in charts):
        layers.data = charts[0].data
        charts = tuple(chart.copy(deep=False) for chart in charts)
        for chart in charts:
            chart.data = alt.Undefined
    layers.layer = list(charts)
    return layers


COORDINATES = {"u": "u (horizontal)", "v": "v (vertical)"}


def side_by_side(table: pl.DataFrame, value: str, keys: list[str]) -> pl.DataFrame:
    """Values in u and v in one row, sorted: the keys, `at`, n, u, v and `BOUNDS`, and the kind of interval.

    `table`: columns age, coordinate, n, low, high, level, resampled and n_scenes, the keys and the value. `value`: name
    of the column with the value. `keys`: columns that identify a line.
    """
    u, v = (
        table.filter(coordinate=axis).select(
            *keys, "age", pl.col(value).alias(axis), pl.col("low", "high").name.prefix(f"{axis}_")
        )
        for axis in "uv"
    )
    kinds = table.filter(coordinate="u").select(*keys, "age", "n", "level", "resampled", n_resampled="n_scenes")
    rows = u.join(v, on=[*keys, "age"]).join(kinds, on=[*keys, "age"])
    return rows.with_columns(at=pl.col("age").cast(pl.Int64)).drop("age").sort(*keys, "at")


def panels(table: pl.DataFrame, field: str, colours: Mapping[str, str], heading: str, *, titled: bool) -> list[Panel]:
    """A panel per coordinate with a line for each value of a field. `field`: column with the names of the lines."""
    return [
        _panel(table, field, colours, coordinate, heading if coordinate == "u" else None, title if titled else "")
        for coordinate, title in COORDINATES.items()
    ]


def _panel(
    table: pl.DataFrame, field: str, colours: Mapping[str, str], coordinate: str, heading: str | None, title: str
) -> Panel:
    values, ends = pl.concat([table["u"], table["v"]]), pl.concat(table[name] for name in BOUNDS)
    x = marks.along(table["at"], title="age (frames of the sequence)", from_zero=True)
    y = alt.Y(f"{coordinate}:Q", title=heading, scale=alt.Scale(domain=marks.holding(values, ends), nice=False))
    tips = [alt.Tooltip(f"{field}:N"), alt.Tooltip("at:Q"), alt.Tooltip("n:Q"), alt.Tooltip(f"{coordinate}:Q")]
    above = [marks.zero_line()]
    return curves(table, field, coordinate, x, y, colours, tips, above=above, title=title)


def curves(
    table: pl.DataFrame,
    field: str,
    column: str,
    x: alt.X,
    y: alt.Y,
    colours: Mapping[str, str],
    tips: Sequence[alt.Tooltip],
    *,
    title: str = "",
    width: int = 395,
    height: int = 165,
    hue: alt.Color | None = None,
    point: int = 14,
    clip: bool = True,
    below: Sequence[alt.Chart] = (),
    above: Sequence[alt.Chart] = (),
) -> Panel:
    """A panel with a line, its points and its band for each value of a field: columns at, n, `column` and its bounds.

    `hue`: `colours` with another legend than usual. `point`: size of points. `below, above`: what is drawn first, and
    last.
    """
    drawn = alt.Chart(marks.rows(table.select(field, "at", "n", column)))
    curve = drawn.mark_line(point=alt.OverlayMarkDef(size=point), clip=clip or alt.Undefined).encode(
        x=x, y=y, color=hue or marks.colour(field, colours, field), opacity=marks.opacity(field), tooltip=list(tips)
    )
    band = marks.band(table, field, colours, column, x, y)
    chart = layered(*below, *band, curve, *above).properties(width=width, height=height, title=alt.Title(title))
    return Panel(chart, (marks.shown(field, colours),), layer=len(below) + len(band))


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

    `table`: columns mean, median, lower_quartile, upper_quartile, lower_whisker, upper_whisker, `field`, and `places`.
    `field, colours`: column that distinguishes the boxes, and the colour of each of its values, in order.
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
        of_box = [""] if interval is None else [_BESIDE, ""]  # the interval is to the left of its box
        offsets = [name + place for name in colours for place in of_box]
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


def _side_by_side(base: alt.Chart, field: str, offsets: Sequence[str]) -> tuple[alt.Chart, alt.Chart]:
    """Marks of the boxes at one place, and of the intervals, beside each other."""
    scale = alt.Scale(domain=list(offsets))
    boxes = base.encode(xOffset=alt.XOffset(f"{field}:N", scale=scale))
    named = base.transform_calculate(beside=f"datum[{field!r}] + {_BESIDE!r}")
    beads: alt.Chart = named.encode(xOffset=alt.XOffset("beside:N", scale=scale))
    return boxes, beads


def _across(column: str, order: Sequence[str], width: int) -> alt.X:
    """Places in their order. Labels that do not fit are vertical, and left out where they would overlap."""
    upright = sum(map(len, order)) * _LETTER > width
    axis = alt.Axis(labelAngle=-90 if upright else 0, labelOverlap=True)
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
    bounded = beads.transform_filter(f"isValid(datum[{low!r}]) && isValid(datum[{high!r}])")
    tips = [alt.Tooltip(f"{name}:Q", format=".4~g", title=name.replace("_", " ")) for name in (value, low, high)]
    line = bounded.mark_rule(color=style.INK, strokeWidth=wide / 2, opacity=1, xOffset=aside).encode(
        y=marks.on(y, low), y2=alt.Y2(f"{high}:Q"), tooltip=tips
    )
    dot = bounded.mark_point(color=style.INK, size=0.8 * wide**2, opacity=1, xOffset=aside).encode(
        y=marks.on(y, value), tooltip=tips
    )
    return [line, dot]
