"""Mean error along and across the image motion, by how fast the image moves."""

from collections.abc import Sequence

import altair as alt
import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_estimate
from tracknoise.findings.wording import SPACE, count, number, px
from tracknoise.report import style
from tracknoise.report.bands import describe_intervals
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.figures.message import values
from tracknoise.report.report_data import ReportData

_NAME, _TITLE = "error-by-image-speed", "Error along the image motion, by its speed"
_TICKS = alt.Axis(values=[step * 10.0**power for power in range(-4, 4) for step in (1, 2, 5)], format="~g")
_GUIDE = (
    "An error along the motion that grows in proportion to the speed has several possible causes. A wrong focal "
    "length, or a wrong scale of depths or poses, makes the true motion too long or too short; the error then grows "
    "with age too. A clock offset gives an error of the same size at every age. If all trackers have the same curve, "
    "suspect the truth. Otherwise the tracker lags. Errors across the motion are the comparison: none of these causes "
    "affects them."
)
_DIRECTIONS = {"along": "along the motion", "across": "across it, to the right"}


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: all trackers at the lowest speed."""
    points = data.nominal(data.speed_errors).filter(pl.col("n") >= data.min_features)
    if points.is_empty():
        why = f"No speed of the image has {data.min_features} features with a known error."
        return [Absence(_NAME, _TITLE, why)]
    ages = points["at"].unique().sort().to_list()
    bounded = points.drop_nulls(["low", "high"]).rename({"n_scenes": "n_resampled"})
    panels = [_panel(data, points, at, coordinate) for at in ages for coordinate in _DIRECTIONS]
    shows = (
        f"Mean untrimmed error of visible features at speed {data.slowest}{data.where}, by the speed of the true "
        "position in the image. Left: along its motion, negative if the feature lags behind. Right: across it. "
        f"Classes with fewer than {count(data.min_features, 'feature')} are left out. "
        f"{describe_intervals(bounded, of='the curves')}"
    )
    spec = arranged(panels, columns=2, independent=["fill"])
    return [Figure(_NAME, _TITLE, shows, _look_for(data, points), spec, _message(data, points))]


def _message(data: ReportData, points: pl.DataFrame) -> str:
    """Trackers that lag behind the fastest motion at the first age, where the interval does not contain zero."""
    first = points.filter(pl.col("at") == pl.col("at").min(), coordinate="along")
    fastest = first.filter(pl.col("class_low") == pl.col("class_low").max().over("tracker"))
    lagging = dict(fastest.filter(pl.col("high") < 0).select("tracker", "mean_px").iter_rows())
    found = {name: px(-lagging[name]) for name in data.trackers if name in lagging}
    return values(found, "Lag behind the fastest motion")


def _look_for(data: ReportData, points: pl.DataFrame) -> str:
    """The mean error along the motion of each tracker at the first age, at its highest speed, and what causes it."""
    first = points.filter(pl.col("at") == pl.col("at").min(), pl.col("coordinate") == "along").sort("class_low")
    parts = []
    for tracker in data.trackers:
        for row in first.filter(tracker=tracker).tail(1).to_dicts():
            estimate = format_estimate(Estimate.of_row(row, "mean_px", "low", "high", "px"))
            speeds = f"{number(row['class_low'])} to {number(row['class_high'])}{SPACE}px per frame"
            place = data.axis.opening_place(data.since_zero(row["at"]))
            parts.append(f"{place}, the mean error of {tracker} along the motion is {estimate} at {speeds}.")
    return " ".join([*parts, _GUIDE])


def _panel(data: ReportData, points: pl.DataFrame, at: int, coordinate: str) -> Panel:
    table = points.filter(at=at, coordinate=coordinate).select(
        "tracker", "n", at=(pl.col("class_low") * pl.col("class_high")).sqrt(), u="mean_px", u_low="low", u_high="high"
    )
    title = alt.Title(f"{_DIRECTIONS[coordinate]}, {data.axis.place(data.since_zero(at))}")
    speeds = alt.Scale(type="log", domain=_range(points), nice=False)
    x = alt.X("at:Q", title="speed of the image (px per frame)", scale=speeds, axis=_TICKS)
    both = points.filter(at=at)
    domain = marks.holding(both["mean_px"], pl.concat([both["low"], both["high"]]))
    y = alt.Y(
        "u:Q",
        title="mean error (px)" if coordinate == "along" else None,
        scale=alt.Scale(domain=domain, nice=False),
        axis=alt.Axis(tickCount=5),
    )
    tips = [alt.Tooltip("tracker:N"), alt.Tooltip("at:Q", title="px per frame"), alt.Tooltip("n:Q"), alt.Tooltip("u:Q")]
    line = alt.Chart(marks.rows(table.select("tracker", "at", "n", "u"))).mark_line(
        point=alt.OverlayMarkDef(size=16), clip=True
    )
    hue, opacity = marks.colour("tracker", data.colour, "tracker"), marks.opacity("tracker")
    band = marks.band(table, "tracker", data.colour, "u", x, y)
    zero = alt.Chart(alt.InlineData(values=[{"zero": 0}])).mark_rule(color=style.QUIET, strokeWidth=0.8)
    chart = layered(
        *band, line.encode(x=x, y=y, color=hue, opacity=opacity, tooltip=tips), zero.encode(y=alt.Y("zero:Q"))
    )
    return Panel(
        chart.properties(width=400, height=130, title=title), (marks.shown("tracker", data.colour),), layer=len(band)
    )


def _range(points: pl.DataFrame) -> list[float]:
    return [float(bound) for bound in points.select(pl.col("class_low").min(), pl.col("class_high").max()).row(0)]
