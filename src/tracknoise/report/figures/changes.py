"""Changes of errors from one frame that the tracker saw to the next: by age, and their autocorrelation."""

from collections.abc import Mapping, Sequence

import altair as alt
import polars as pl

from tracknoise.findings.intervals.change_bounds import AUTOCORRELATION
from tracknoise.findings.wording import MINUS, listing, number, px
from tracknoise.report import bands, style
from tracknoise.report.bands import BOUNDS
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import LAGS, NAMES, REFERENCE_AGE
from tracknoise.tables.enumerations import Aspect

_NAME, _TITLE = "changes", "Changes from frame to frame"
_MEAN, _SPREAD = "mean", "spread"
_ROWS: Mapping[str, str] = {
    _MEAN: "mean change (px)",
    _SPREAD: "its standard deviation (px)",
    AUTOCORRELATION: "autocorrelation",
}
"""Statistics in the rows of the figure, and what their axes say."""
_STATISTICS = {NAMES["age"]["mean"]: _MEAN, NAMES["age"]["central"]: _SPREAD, AUTOCORRELATION: AUTOCORRELATION}
"""Statistic of the figure, by its name in the table of intervals."""
_SIZE = {"width": 395, "height": 165}
_COORDINATES = {"u": "u (horizontal)", "v": "v (vertical)"}
_WHITE = pl.DataFrame({"at": range(1, LAGS + 1), "white": [-0.5, *[0.0] * (LAGS - 1)]})
"""Autocorrelation of the changes of white noise, by lag."""
_REFERENCES = pl.DataFrame({"at": [1, 1], "value": [0.0, -0.5], "of": ["random walk", "white noise"]})
"""Labels of the two reference values."""


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: all trackers at the lowest speed."""
    points = _points(data)
    if points.is_empty():
        why = f"No age has {data.min_features} features with a known error in the previous frame too."
        return [Absence(_NAME, _TITLE, why)]
    panels = [_panel(data, points, name, coordinate) for name in _ROWS for coordinate in _COORDINATES]
    shows = (
        f"Change of {data.errors_shown.lower()} of visible features at speed {data.slowest}{data.where}, from one "
        "frame that the tracker saw to the next. Top and middle: mean and standard deviation of the change, by the age "
        f"at which it ends. Bottom: correlation of a change with those up to {number(LAGS)} steps before it, over all "
        f"ages. {bands.describe_intervals(points, of='the curves')}"
    )
    spec = arranged(panels, columns=2, independent=["fill"])
    return [Figure(_NAME, _TITLE, shows, _look_for(data, points), spec, _message(data, points))]


def _message(data: ReportData, points: pl.DataFrame) -> str:
    """Trackers whose successive changes have opposite signs in u and v, more often than by chance."""
    known = points.filter(pl.col("u_high") < 0, pl.col("v_high") < 0, statistic=AUTOCORRELATION, at=1)
    names = [name for name in data.trackers if name in known["tracker"]]
    return f"Successive changes of {listing(names)} tend to have opposite signs" if names else ""


def _points(data: ReportData) -> pl.DataFrame:
    """One row per tracker, statistic and age or lag: `at`, n, u and v with `BOUNDS`, and the kind of interval."""
    table = data.nominal(data.changes).filter(trimming=data.trimming)
    alone = _uncut(table.filter(pl.col("lag") == 0), "age", data.min_features)
    pairs = _uncut(table.filter(pl.col("lag") > 0), "lag", data.min_features)
    parts = [
        _named(alone, _MEAN, {axis: pl.col(f"mean_{axis}_px") for axis in "uv"}),
        _named(alone, _SPREAD, {axis: pl.col(f"covariance_{axis}{axis}").sqrt() for axis in "uv"}),
        _named(pairs, AUTOCORRELATION, {axis: pl.col(f"autocorrelation_{axis}") for axis in "uv"}),
    ]
    values = pl.concat(parts).drop_nulls(["u", "v"])
    return values.join(_bounds(data), on=["tracker", "statistic", "at"], how="left", maintain_order="left")


def _uncut(table: pl.DataFrame, along: str, min_features: int) -> pl.DataFrame:
    """Rows along `at`, up to the first of each tracker that has too few features."""
    enough = (pl.col("n") >= min_features).cum_min().over("tracker")
    return table.with_columns(at=pl.col(along).cast(pl.Int64)).sort("tracker", "at").filter(enough)


def _named(table: pl.DataFrame, statistic: str, values: Mapping[str, pl.Expr]) -> pl.DataFrame:
    return table.select("tracker", pl.lit(statistic).alias("statistic"), "at", "n", **values)


def _bounds(data: ReportData) -> pl.DataFrame:
    """Bounds of all these. Those of the variance are roots."""
    found = data.nominal(data.intervals).filter(aspect=Aspect.change, trimming=data.trimming)
    found = found.filter(pl.col("weighting").is_null() | (pl.col("weighting") == "features"))
    found = found.filter(pl.col("statistic").is_in(list(_STATISTICS)), pl.col("coordinate").is_in(list(_COORDINATES)))
    named = found.with_columns(statistic=pl.col("statistic").replace_strict(_STATISTICS, return_dtype=pl.String))
    root = pl.col("statistic") == _SPREAD
    ends = {end: pl.when(root).then(pl.col(end).clip(lower_bound=0.0).sqrt()).otherwise(end) for end in ("low", "high")}
    return bands.side_by_side(named.with_columns(**ends), ["tracker", "statistic", "at"]).drop_nulls(list(BOUNDS))


def _panel(data: ReportData, points: pl.DataFrame, statistic: str, coordinate: str) -> Panel:
    table = points.filter(statistic=statistic)
    correlation = statistic == AUTOCORRELATION
    title = alt.Title(_COORDINATES[coordinate] if statistic == _MEAN else "")
    x = alt.X(
        "at:Q",
        title="steps from one change to the other" if correlation else "age (frames of the sequence)",
        axis=alt.Axis(tickMinStep=1),
        scale=alt.Scale(domain=marks.domain(pl.Series([1.0, LAGS]) if correlation else table["at"]), nice=False),
    )
    heading = _ROWS[statistic] if coordinate == "u" else None
    y = alt.Y(
        f"{coordinate}:Q", title=heading, scale=alt.Scale(domain=_domain(table, references=correlation), nice=False)
    )
    hue, opacity = marks.colour("tracker", data.colour, "tracker"), marks.opacity("tracker")
    tips = [alt.Tooltip("tracker:N"), alt.Tooltip("at:Q"), alt.Tooltip("n:Q"), alt.Tooltip(f"{coordinate}:Q")]
    lines = alt.Chart(marks.rows(table.select("tracker", "at", "n", coordinate)))
    lines = lines.mark_line(point=alt.OverlayMarkDef(size=14), clip=True).encode(
        x=x, y=y, color=hue, opacity=opacity, tooltip=tips
    )
    band = marks.band(table, "tracker", data.colour, coordinate, x, y)
    zero = alt.Chart(alt.InlineData(values=[{"zero": 0}])).mark_rule(color=style.QUIET, strokeWidth=0.8)
    chart = layered(*band, lines, zero.encode(y=alt.Y("zero:Q")), *(_references(x, y) if correlation else []))
    selections = (marks.shown("tracker", data.colour),)
    return Panel(chart.properties(title=title, **_SIZE), selections, layer=len(band))


def _references(x: alt.X, y: alt.Y) -> list[alt.Chart]:
    """Expected values for white noise and, at zero, for a random walk."""
    white = alt.Chart(marks.rows(_WHITE)).mark_line(color=style.QUIET, strokeDash=[3, 3], clip=True)
    names = alt.Chart(marks.rows(_REFERENCES)).mark_text(color=style.QUIET, fontSize=10, align="left", dx=14, dy=-6)
    return [white.encode(x=x, y=marks.on(y, "white")), names.encode(x=x, y=marks.on(y, "value"), text=alt.Text("of:N"))]


def _domain(table: pl.DataFrame, *, references: bool) -> list[float]:
    """Bounds that include both coordinates, and the reference values if they are drawn."""
    least = pl.Series(_WHITE["white"] if references else [], dtype=pl.Float64)
    return marks.holding(pl.concat([table["u"], table["v"], least]), pl.concat(table[name] for name in BOUNDS))


def _look_for(data: ReportData, points: pl.DataFrame) -> str:
    numbers = [_numbers(tracker, points.filter(tracker=tracker)) for tracker in data.trackers]
    sentences = " ".join(sentence for sentence in numbers if sentence)
    return (
        f"{sentences} A mean that stays away from zero is a drift. A standard deviation that rises with age means that "
        "tracks become less reliable as their features change. A constant one means that every frame adds the same "
        f"amount. An autocorrelation of {MINUS}0.5 at one step and 0 beyond is independent noise in every frame. An "
        "autocorrelation of 0 everywhere is a random walk."
    )


def _numbers(tracker: str, points: pl.DataFrame) -> str:
    """Mean, spread and correlation of a tracker's changes at the last age up to the reference age."""
    ages = points.filter(pl.col("statistic") == _SPREAD, pl.col("at") <= REFERENCE_AGE).sort("at")
    if ages.is_empty():
        return ""
    spread = ages.row(-1, named=True)
    mean = points.filter(statistic=_MEAN, at=spread["at"]).row(0, named=True)
    text = (
        f"For {tracker}, the mean change that ends at age {number(spread['at'])} is {px(mean['u'])} in u and "
        f"{px(mean['v'])} in v. Its standard deviation is {px(spread['u'])} in u and {px(spread['v'])} in v."
    )
    near = points.filter(statistic=AUTOCORRELATION, at=1)
    if near.is_empty():
        return text
    row = near.row(0, named=True)
    return (
        f"{text} Over all ages, the correlation with the previous change is {number(row['u'])} in u and "
        f"{number(row['v'])} in v."
    )
