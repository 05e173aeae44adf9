"""The truth floor in panels of curves: how large errors would be that come from the truth alone."""

from collections.abc import Mapping

import altair as alt
import polars as pl

from tracknoise.findings.floor_cover import SIGMAS
from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.statistics.truth.floor import FLOOR_COLUMNS

NAME = "truth floor"
_LIMITS: Mapping[str, tuple[float, ...]] = {"mean": (SIGMAS, -SIGMAS), "second": (1.0,)}
"""Multiples of the floor that are drawn beside each statistic."""
_DASH = [6, 4]
_WIDTH, _SYMBOL = 1.5, 500
"""Width of lines, px, and size of the one in the legend, px^2."""


def floor_lines(table: pl.DataFrame, role: str, coordinate: str, x: alt.X, y: alt.Y) -> list[alt.Chart]:
    """The floor in one panel of curves; both limits of a mean. Empty where nothing is known, or the truth is exact.

    Parameters
    ----------
    table
        Points of curves, with `FLOOR_COLUMNS`.
    role
        Of the statistic.
    coordinate
        u or v.
    x, y
        Axes of the panel.
    """
    known = _pooled(table, coordinate) if role in _LIMITS else table.clear()
    if known.is_empty():
        return []
    legend = alt.Legend(
        title=None, symbolType="stroke", symbolDash=_DASH, symbolStrokeColor=style.QUIET, symbolSize=_SYMBOL
    )
    width = alt.StrokeWidth("line:N", scale=alt.Scale(domain=[NAME], range=[_WIDTH]), legend=legend)
    tips = [alt.Tooltip("line:N"), alt.Tooltip("at:Q"), alt.Tooltip("floor:Q", title="px")]
    ends = [known.select("at", line=pl.lit(NAME), floor=limit * pl.col("floor")) for limit in _LIMITS[role]]
    return [
        alt.Chart(marks.rows(end))
        .mark_line(strokeDash=_DASH, color=style.QUIET, clip=True)
        .encode(x=x, y=_on(y), strokeWidth=width, tooltip=tips)
        for end in ends
    ]


def floor_ends(table: pl.DataFrame, role: str) -> pl.Series:
    """Values of the floor in both panels of one row of curves, for the bounds of their axis."""
    limits = _LIMITS.get(role, ())
    values = [limit * table[name] for limit in limits for name in FLOOR_COLUMNS]
    return pl.concat([pl.Series("floor", [], dtype=pl.Float64), *(value.rename("floor") for value in values)])


def _on(y: alt.Y) -> alt.Y:
    """The vertical axis, for the column of the floor."""
    same = y.copy(deep=False)
    same.shorthand = "floor:Q"
    return same


def _pooled(table: pl.DataFrame, coordinate: str) -> pl.DataFrame:
    """One floor for all curves, which differ little: the mean, weighted by features. Empty if all are 0."""
    column = FLOOR_COLUMNS["uv".index(coordinate)]
    known = table.filter(pl.col("role") != "central").drop_nulls(column)
    weighted = (pl.col(column) * pl.col("n")).sum() / pl.col("n").sum()
    found = known.filter(pl.col("n") > 0).group_by("at").agg(floor=weighted).sort("at")
    return found if (found["floor"] > 0).any() else found.clear()


def describe_floor(points: pl.DataFrame) -> str:
    """Describe the lines that `floor_lines` draws of points, with a space before; empty if there are none."""
    if not any((points[name].drop_nulls() > 0).any() for name in FLOOR_COLUMNS):
        return ""
    return (
        " Grey dashed lines: the truth floor. It is the root second moment that the known errors of the truth cause "
        f"without any error of a tracker. In the row of the mean error, the lines are at {SIGMAS:g} standard "
        "deviations of what these errors add to the mean."
    )
