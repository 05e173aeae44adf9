"""Numbers of trackers by age: one figure for each curve that a topic declares."""

from collections.abc import Sequence
from functools import partial

import altair as alt
import polars as pl

from tracknoise.report.figures import marks
from tracknoise.report.figures.error_curves import no_curve
from tracknoise.report.figures.figure import Absence, Figure, Sections
from tracknoise.report.figures.panels import Panel, arranged, curves
from tracknoise.report.report_data import ReportData
from tracknoise.tables.quantities import Quantity
from tracknoise.topics.bands import AGE, describe_bounds
from tracknoise.topics.catalogue import CURVES_OF_TOPICS, EVERY_QUANTITY
from tracknoise.topics.topic import Curve


def topic_figures(data: ReportData, *, section: str) -> Sequence[Figure | Absence]:
    """One figure per curve of a section: a line per tracker at the lowest speed."""
    return [_figure(data, curve) for curve in CURVES_OF_TOPICS if curve.section == section]


def _figure(data: ReportData, curve: Curve) -> Figure | Absence:
    quantity, id = EVERY_QUANTITY[curve.quantity], curve.quantity.replace("_", "-")
    chosen = {**curve.rows, **({"trimming": data.trimming} if "trimming" in curve.table else {})}
    table = data.nominal(data[curve.table.name]).filter(pl.col("n") >= data.min_features, **chosen)
    if table.is_empty():
        return Absence(id, quantity.title, no_curve(data))
    shows = (
        f"{quantity.estimand} At speed {data.slowest}{data.where}, by {data.axis.name}, {curve.combined}, of "
        f"{data.tracks_shown}. {describe_bounds(table, of='the curves')}"
    )
    better = f"A {quantity.better} value is better." if quantity.better != "neither" else ""
    panel = _panel(data, table.sort("tracker", "at"), quantity)
    return Figure(id, quantity.title, shows, better, arranged([panel], columns=1, independent=["fill"]))


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


FIGURES: Sections = {curve.section: (partial(topic_figures, section=curve.section),) for curve in CURVES_OF_TOPICS}
"""What this module draws, by the section of the report."""
