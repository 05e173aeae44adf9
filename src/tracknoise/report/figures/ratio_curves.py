"""Ratios of sums over features by age: one figure for each quantity that the catalogue declares."""

from collections.abc import Sequence

import altair as alt
import polars as pl

from tracknoise.report.figures import marks
from tracknoise.report.figures.error_curves import no_curve
from tracknoise.report.figures.figure import Absence, Figure, Sections
from tracknoise.report.figures.panels import Panel, arranged, curves
from tracknoise.report.report_data import ReportData
from tracknoise.tables.quantities import QUANTITIES, RATIOS, Quantity
from tracknoise.topics.bands import AGE, describe_bounds


def ratio_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per quantity: a curve per tracker at the lowest speed."""
    return [_figure(data, name) for name in RATIOS]


def _figure(data: ReportData, name: str) -> Figure | Absence:
    quantity, id = QUANTITIES[name], name.replace("_", "-")
    enough = pl.col("n") >= data.min_features
    table = data.nominal(data["ratios"]).filter(enough, quantity=name, trimming=data.trimming).sort("tracker", "at")
    if table.is_empty():
        return Absence(id, quantity.title, no_curve(data))
    shows = (
        f"{quantity.estimand} At speed {data.slowest}{data.where}, by {data.axis.name}, features pooled, of "
        f"{data.tracks_shown}. {describe_bounds(table, of='the curves')}"
    )
    better = f"A {quantity.better} value is better." if quantity.better != "neither" else ""
    return Figure(
        id, quantity.title, shows, better, arranged([_panel(data, table, quantity)], columns=1, independent=["fill"])
    )


def _panel(data: ReportData, table: pl.DataFrame, quantity: Quantity) -> Panel:
    columns = table.select("tracker", "at", "n", u="value", u_low="low", u_high="high")
    x = marks.along(table["at"], title=data.axis.title, from_zero=data.axis is AGE)
    domain = marks.holding(table["value"], pl.concat([table["low"], table["high"]]))
    form = alt.Axis(format=".1%") if quantity.unit == "share" else alt.Axis()
    y = alt.Y("u:Q", title=quantity.title, scale=alt.Scale(domain=domain, nice=False), axis=form)
    tips = [alt.Tooltip("tracker:N"), alt.Tooltip("at:Q", title=data.axis.name), alt.Tooltip("n:Q", title="features")]
    colours = {name: data.colour[name] for name in data.trackers if name in table["tracker"]}
    tips.append(alt.Tooltip("u:Q"))
    return curves(columns, "tracker", "u", x, y, colours, tips, height=190, point=20, clip=False)


FIGURES: Sections = {"error-by-tracker": (ratio_figures,)}
"""What this module draws, by the section of the report."""
