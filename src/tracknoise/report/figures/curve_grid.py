"""Mean, absolute error and second moment by age or frame, in u and v: a grid of panels that several figures share."""

from collections.abc import Callable, Sequence

import altair as alt
import polars as pl

from tracknoise.report import bands, style
from tracknoise.report.axis import AGE, FRAME, Axis
from tracknoise.report.bands import BOUNDS
from tracknoise.report.figures import marks
from tracknoise.report.figures.floor_line import describe_floor, floor_ends, floor_lines
from tracknoise.report.figures.layout import Panel, Spec, arranged, layered
from tracknoise.report.figures.series import MANY, Series

_ROWS = {
    "mean": "mean error {} (px)",
    "absolute": "mean absolute error {} (px)",
    "second": "root second moment {} (px)",
    "core": "core {} (px)",
}
"""Roles of the statistics in the rows of the grid, and the titles of their axes."""
_ABOUT = {"second": "about zero", "central": "about the mean"}
HEIGHT = 165
_WIDE = 395
Beside = Callable[[pl.DataFrame, str, Series, Sequence[float]], Panel]
"""Makes a panel to the right of curves, from their points, coordinate, series and bounds of the vertical axis."""


def grid(points: pl.DataFrame, series: Series, axis: Axis, *, beside: Beside | None = None, width: int = _WIDE) -> Spec:
    """Panels of `points` (see `ReportData.points`): rows are statistics, columns are u and v.

    Parameters
    ----------
    points
        Curves with one value of everything but `series.field`.
    series
        What has a colour of its own.
    axis
        Of the curves.
    beside
        Makes a panel to the right of each panel of curves. By default there is none.
    width
        Of the panels of curves, px.
    """
    named = points.with_columns(pl.col(series.field).cast(pl.String))
    chosen = series.present(named)
    shown = named.filter(pl.col(series.field).is_in(list(chosen.colours)))
    present = [role for role in _ROWS if role in shown["role"]]
    panels = [panel for role in present for panel in _row(shown, role, chosen, axis, beside, width)]
    return arranged(panels, columns=4 if beside else 2, independent=["fill", "stroke"])


def describe_bands(points: pl.DataFrame, series: Series) -> str:
    """Describe the bands, and the truth floor, that `grid` draws of the same points."""
    named = points.with_columns(pl.col(series.field).cast(pl.String)).filter(pl.col("role") != "central")
    chosen = series.present(named)
    of = "the solid curves" if len(chosen.colours) <= MANY else f"the curve {series.phrase.format(chosen.banded[0])}"
    intervals = bands.describe_intervals(named.filter(pl.col(series.field).is_in(chosen.banded)), of=of)
    return f"{intervals}{describe_floor(named)}"


def _row(points: pl.DataFrame, role: str, series: Series, axis: Axis, beside: Beside | None, width: int) -> list[Panel]:
    """Both coordinates of one statistic, on one scale."""
    table = _drawn(points, role, series)
    banded = table.filter(pl.col("role") == role, pl.col(series.field).is_in(series.banded))
    ends = pl.concat([*(banded[name] for name in BOUNDS), floor_ends(table, role)])
    bounds = marks.holding(pl.concat([table["u"], table["v"]]), ends)
    x = marks.along(_places(points), title=axis.title, from_zero=axis is AGE)
    panels = []
    for coordinate, label in zip("uv", series.columns, strict=True):
        title = alt.Title(label if role == "mean" else "")
        heading = _ROWS[role].format(axis.signs.get(role, "")).replace("  ", " ") if coordinate == "u" else None
        y = alt.Y(f"{coordinate}:Q", scale=alt.Scale(domain=bounds, nice=False), title=heading)
        band = marks.band(banded, series.field, series.colours, coordinate, x, y)
        floor = floor_lines(table, role, coordinate, x, y)
        chart = layered(*band, *_lines(table, series, axis, x, y), *floor)
        selections = marks.shown(series.field, series.colours), marks.zoom("x")
        panels.append(Panel(chart.properties(title=title, width=width, height=HEIGHT), selections, layer=len(band)))
        panels += [beside(table.filter(role=role), coordinate, series, bounds)] if beside else []
    return panels


def _places(points: pl.DataFrame) -> pl.Series:
    """Places of all points, whatever their statistic, and those where errors are zero by construction."""
    places = points["at"].cast(pl.Int64)
    return pl.concat([places, places - points["since"]]).unique()


def _drawn(points: pl.DataFrame, role: str, series: Series) -> pl.DataFrame:
    """The points of one row of panels. The first of the series comes last, so that it is drawn above the others."""
    roles = ["second", "central"] if role == "second" and len(series.colours) <= MANY else [role]
    place = {name: -place for place, name in enumerate(series.colours)}
    order = pl.col(series.field).replace_strict(place, return_dtype=pl.Int64)
    return points.filter(pl.col("role").is_in(roles)).sort("role", order, "at")


def _lines(table: pl.DataFrame, series: Series, axis: Axis, x: alt.X, y: alt.Y) -> list[alt.Chart]:
    labelled = table.with_columns(of=pl.col("role").replace(_ABOUT))
    tips = [
        alt.Tooltip(f"{series.field}:N"),
        alt.Tooltip("at:Q", title=axis.name),
        alt.Tooltip("n:Q", title="features"),
        alt.Tooltip("u:Q", title="u (px)"),
        alt.Tooltip("v:Q", title="v (px)"),
        alt.Tooltip("of:N", title="moment" if "central" in table["role"].unique() else "statistic"),
    ]
    dash = alt.StrokeDash("of:N", scale=alt.Scale(domain=[*_ABOUT.values()], range=[[1, 0], [3, 3]]), legend=None)
    lines = alt.Chart(marks.rows(labelled.select(series.field, "at", "n", "u", "v", "of"))).encode(
        x=x,
        y=y,
        color=marks.colour(series.field, series.colours, series.field),
        opacity=marks.opacity(series.field),
        tooltip=tips,
    )
    curve = lines.mark_line(strokeWidth=1.4 if len(series.colours) > MANY else 1.8).encode(strokeDash=dash)
    size = 6 if len(series.colours) > MANY else 14
    dots = lines.mark_point(size=size, opacity=1).transform_filter("datum.of != 'about the mean'")
    zero = alt.Chart(alt.InlineData(values=[{"zero": 0}])).mark_rule(color="#9aa5b1").encode(y=alt.Y("zero:Q"))
    frames = set(table["at"].cast(pl.Int64) - table["since"])
    vertical = marks.key_frames(frames, style.QUIET) if axis is FRAME else []
    return [curve, dots, zero, *vertical]
