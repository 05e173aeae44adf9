"""The second moment of errors about zero, as the paper plots it: not its root, and with the part between u and v."""

from collections.abc import Sequence

import altair as alt
import polars as pl

from tracknoise.findings.wording import SPACE, number, ratio
from tracknoise.report import style
from tracknoise.report.axis import AGE
from tracknoise.report.figures import marks
from tracknoise.report.figures.curve_grid import HEIGHT
from tracknoise.report.figures.curves import no_curve
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.figures.message import apart
from tracknoise.report.figures.series import Series
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE

_TITLE = "Second moment by {}"
_ELEMENTS = {"u": "uu", "uv": "uv", "v": "vv"}
_WIDTH = 245
_SYMBOL_WIDTH, _CHARACTER_WIDTH = 28, 7


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: trackers at the lowest speed, then the speeds of each tracker if there are several."""
    name, title = f"second-moment-by-{data.axis.name}", _TITLE.format(data.axis.name)
    points = _points(data)
    if points.filter(pl.col("since") != 0, speed=str(data.slowest)).is_empty():
        return [Absence(name, title, no_curve(data))]
    panels = _row(data, points.filter(speed=str(data.slowest)), Series("tracker", data.colour), f"speed {data.slowest}")
    if len(data.speeds) > 1:
        for tracker in data.trackers:
            panels += _row(data, points.filter(tracker=tracker), Series("speed", data.speed_colours(tracker)), tracker)
    spec = arranged(panels, columns=3, independent=["color"])
    return [Figure(name, title, _shows(data), _look_for(data, points), spec, _message(data))]


def _message(data: ReportData) -> str:
    """The tracker whose u and v differ most at the last age up to the reference age, if their intervals lie apart."""
    near = data.nominal(data.points).filter(
        pl.col("since").is_between(1, REFERENCE_AGE), role="second", trimming=data.trimming, population=data.population
    )
    last = near.filter(pl.col("since") == pl.col("since").max().over("tracker")).to_dicts()
    found = [(row, *pair) for row in last for pair in ("uv", "vu") if row[pair[1]] and apart(row, row, *pair)]
    if not found:
        return ""
    row, larger, smaller = max(found, key=lambda one: one[0][one[1]] / one[0][one[2]])
    times = ratio((row[larger] / row[smaller]) ** 2)
    return f"The second moment of {row['tracker']} is {times} times as large in {larger} as in {smaller}"


def _points(data: ReportData) -> pl.DataFrame:
    """Second moments about zero, px²: columns tracker, speed, at, since, u, v, uv and others."""
    roles = pl.col("statistic").replace_strict(data.axis.roles, default=None)
    chosen = data.reference(data.curves).filter(
        roles == "second",
        ~pl.col("cut"),
        weighting="features",
        axis=data.axis.name,
        population=data.population,
        trimming=data.trimming,
    )
    known = chosen.drop_nulls(["u", "v"]).sort("tracker", "speed", "at")
    since = pl.col("at").cast(pl.Int64) + data.since_zero(0)
    return known.with_columns(pl.col("speed").cast(pl.String), since=since)


def _shows(data: ReportData) -> str:
    sign = _sign(data)
    return (
        f"Second moment {sign} of {data.tracks_shown}{data.where}, about zero and in px², as the paper plots it. Its "
        f"root, with intervals, is in the figures above. Columns: {sign} in u, between u and v, and in v. First row: "
        f"every tracker at speed {data.slowest}. Other rows: every speed of a tracker."
    )


def _look_for(data: ReportData, points: pl.DataFrame) -> str:
    parts = [_sentence(data, name, points.filter(tracker=name, speed=str(data.slowest))) for name in data.trackers]
    return (
        f"{' '.join(part for part in parts if part)} An element between u and v that differs from zero means that "
        "errors in u and v are correlated."
    )


def _sentence(data: ReportData, tracker: str, points: pl.DataFrame) -> str:
    """The elements at the last age up to the reference age."""
    near = points.filter(pl.col("since").is_between(1, REFERENCE_AGE)).sort("since")
    if near.is_empty():
        return ""
    row = near.row(-1, named=True)
    u, uv, v = (f"{number(row[name])}{SPACE}px²" for name in _ELEMENTS)
    return f"{data.axis.opening_place(row['since'])}, {tracker} has {u} in u, {v} in v and {uv} between them."


def _row(data: ReportData, points: pl.DataFrame, series: Series, title: str) -> list[Panel]:
    """One panel per element. Those in u and v have one scale."""
    present = series.present(points)
    shown = points.filter(pl.col(series.field).is_in(list(present.colours)))
    both, none = pl.concat([shown["u"], shown["v"]]), pl.Series([], dtype=pl.Float64)
    bounds = {"u": marks.holding(both, none), "uv": marks.holding(shown["uv"], none), "v": marks.holding(both, none)}
    return [_panel(data, shown, present, name, bounds[name], title) for name in _ELEMENTS]


def _panel(
    data: ReportData, points: pl.DataFrame, series: Series, element: str, bounds: Sequence[float], title: str
) -> Panel:
    first = element == "u"
    y = alt.Y(
        f"{element}:Q",
        title=f"{_sign(data)} {_ELEMENTS[element]} (px²)",
        scale=alt.Scale(domain=list(bounds), nice=False),
    )
    lines = alt.Chart(marks.rows(points.select(series.field, "at", element)))
    lines = lines.mark_line(point=alt.OverlayMarkDef(size=10), clip=True).encode(
        x=marks.along(points["at"], title=data.axis.title, from_zero=data.axis is AGE),
        y=y,
        color=marks.colour(series.field, series.colours, series.field, legend=first, columns=_columns(series)),
        opacity=marks.opacity(series.field),
        tooltip=[alt.Tooltip(f"{series.field}:N"), alt.Tooltip("at:Q", title=data.axis.name), f"{element}:Q"],
    )
    zero = alt.Chart(alt.InlineData(values=[{"zero": 0}])).mark_rule(color=style.QUIET, strokeWidth=0.8)
    chart = layered(lines, zero.encode(y=alt.Y("zero:Q")))
    chart = chart.properties(width=_WIDTH, height=HEIGHT, title=title if first else "")
    return Panel(chart, (marks.shown(series.field, series.colours),))


def _sign(data: ReportData) -> str:
    return data.axis.signs["second"].removeprefix("√")


def _columns(series: Series) -> int:
    """Columns of a legend that is no wider than its panel."""
    longest = max((len(name) for name in series.colours), default=1)
    return max(1, int(_WIDTH / (_SYMBOL_WIDTH + _CHARACTER_WIDTH * longest)))
