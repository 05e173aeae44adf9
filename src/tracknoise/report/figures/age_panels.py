"""Panels with lines and bands by age, one per coordinate, for tables whose rows are of single coordinates."""

from collections.abc import Mapping

import altair as alt
import polars as pl

from tracknoise.report import style
from tracknoise.report.bands import BOUNDS
from tracknoise.report.figures import marks
from tracknoise.report.figures.layout import Panel, layered

_COORDINATES = {"u": "u (horizontal)", "v": "v (vertical)"}
_SIZE = {"width": 395, "height": 165}


def side_by_side(table: pl.DataFrame, value: str, keys: list[str]) -> pl.DataFrame:
    """Values in u and v in one row, sorted: the keys, `at`, n, u, v and `BOUNDS`, and the kind of interval.

    Parameters
    ----------
    table
        Columns age, coordinate, n, low, high, level, resampled and n_scenes, the keys and the value.
    value
        Name of the column with the value.
    keys
        Columns that identify a line.
    """
    u, v = (
        table.filter(coordinate=axis).select(
            *keys, "age", pl.col(value).alias(axis), pl.col("low", "high").name.prefix(f"{axis}_")
        )
        for axis in "uv"
    )
    kinds = table.filter(coordinate="u").select(*keys, "age", "n", "level", "resampled", n_resampled="n_scenes")
    both = u.join(v, on=[*keys, "age"]).join(kinds, on=[*keys, "age"])
    return both.with_columns(at=pl.col("age").cast(pl.Int64)).drop("age").sort(*keys, "at")


def panels(table: pl.DataFrame, field: str, colours: Mapping[str, str], heading: str, *, titled: bool) -> list[Panel]:
    """A panel per coordinate with a line for each value of a field.

    Parameters
    ----------
    table
        From `side_by_side`.
    field
        Column with the names of the lines.
    colours
        Colour of each name.
    heading
        Title of the vertical axis.
    titled
        Whether the panels name their coordinates.
    """
    return [
        _panel(table, field, colours, coordinate, heading if coordinate == "u" else None, title if titled else "")
        for coordinate, title in _COORDINATES.items()
    ]


def _panel(
    table: pl.DataFrame, field: str, colours: Mapping[str, str], coordinate: str, heading: str | None, title: str
) -> Panel:
    values, ends = pl.concat([table["u"], table["v"]]), pl.concat(table[name] for name in BOUNDS)
    x = marks.along(table["at"], title="age (frames of the sequence)", from_zero=True)
    y = alt.Y(f"{coordinate}:Q", title=heading, scale=alt.Scale(domain=marks.holding(values, ends), nice=False))
    tips = [alt.Tooltip(f"{field}:N"), alt.Tooltip("at:Q"), alt.Tooltip("n:Q"), alt.Tooltip(f"{coordinate}:Q")]
    lines = alt.Chart(marks.rows(table.select(field, "at", "n", coordinate)))
    lines = lines.mark_line(point=alt.OverlayMarkDef(size=14), clip=True).encode(
        x=x, y=y, color=marks.colour(field, colours, field), opacity=marks.opacity(field), tooltip=tips
    )
    band = marks.band(table, field, colours, coordinate, x, y)
    zero = alt.Chart(alt.InlineData(values=[{"zero": 0}])).mark_rule(color=style.QUIET, strokeWidth=0.8)
    chart = layered(*band, lines, zero.encode(y=alt.Y("zero:Q")))
    return Panel(chart.properties(title=alt.Title(title), **_SIZE), (marks.shown(field, colours),), layer=len(band))
