"""How errors change from one frame that the tracker saw to the next: by age, and from one change to those after it."""

from collections.abc import Mapping, Sequence

import altair as alt
import polars as pl

from tracknoise.findings.intervals.change_bounds import AUTOCORRELATION
from tracknoise.findings.wording import MINUS, number, px
from tracknoise.report import bands, style
from tracknoise.report.bands import BOUNDS
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.figures.layout import Panel, arranged
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
_TOLD_AS = {NAMES["age"]["mean"]: _MEAN, NAMES["age"]["central"]: _SPREAD, AUTOCORRELATION: AUTOCORRELATION}
"""What the table of intervals calls them."""
_SIZE = {"width": 395, "height": 165}
_COORDINATES = {"u": "u (horizontal)", "v": "v (vertical)"}
_WHITE = pl.DataFrame({"at": range(1, LAGS + 1), "white": [-0.5, *[0.0] * (LAGS - 1)]})
"""Autocorrelation of the changes of white noise, by lag."""
_YARDSTICKS = pl.DataFrame({"at": [1, 1], "value": [0.0, -0.5], "of": ["random walk", "white noise"]})
"""Where the two yardsticks are named."""


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """One figure: all trackers at the lowest speed."""
    points = _points(evidence)
    if points.is_empty():
        why = f"No age has {evidence.min_features} errors that were known in the frame before, too."
        return [Absence(_NAME, _TITLE, why)]
    panels = [_panel(evidence, points, name, coordinate) for name in _ROWS for coordinate in _COORDINATES]
    shows = (
        f"By how much {evidence.errors_kept.lower()} at speed {evidence.slowest}{evidence.where}, of features that "
        "could be seen, change from one frame that the tracker saw to the next. Top and middle: the mean and the "
        "standard deviation of the change, by the age at which it ends. Bottom: how much a change of any age is like "
        f"those up to {number(LAGS)} steps before it. {bands.told(points, of='the curves')}"
    )
    return [
        Figure(_NAME, _TITLE, shows, _look_for(evidence, points), arranged(panels, columns=2, independent=["fill"]))
    ]


def _points(evidence: Evidence) -> pl.DataFrame:
    """A row a tracker, statistic and age or lag: `at`, n, u and v with `BOUNDS`, and the kind of interval."""
    table = evidence.nominal(evidence.changes).filter(trimming="trimmed")
    alone = _uncut(table.filter(pl.col("lag") == 0), "age", evidence.min_features)
    pairs = _uncut(table.filter(pl.col("lag") > 0), "lag", evidence.min_features)
    parts = [
        _named(alone, _MEAN, {axis: pl.col(f"mean_{axis}_px") for axis in "uv"}),
        _named(alone, _SPREAD, {axis: pl.col(f"covariance_{axis}{axis}").sqrt() for axis in "uv"}),
        _named(pairs, AUTOCORRELATION, {axis: pl.col(f"autocorrelation_{axis}") for axis in "uv"}),
    ]
    values = pl.concat(parts).drop_nulls(["u", "v"])
    return values.join(_bounds(evidence), on=["tracker", "statistic", "at"], how="left", maintain_order="left")


def _uncut(table: pl.DataFrame, along: str, min_features: int) -> pl.DataFrame:
    """Rows up to the first of a tracker that rests on too few, along `at`."""
    enough = (pl.col("n") >= min_features).cum_min().over("tracker")
    return table.with_columns(at=pl.col(along).cast(pl.Int64)).sort("tracker", "at").filter(enough)


def _named(table: pl.DataFrame, statistic: str, values: Mapping[str, pl.Expr]) -> pl.DataFrame:
    return table.select("tracker", pl.lit(statistic).alias("statistic"), "at", "n", **values)


def _bounds(evidence: Evidence) -> pl.DataFrame:
    """Bounds of all these, those of the variance as roots."""
    found = evidence.nominal(evidence.intervals).filter(aspect=Aspect.change, trimming="trimmed")
    found = found.filter(pl.col("weighting").is_null() | (pl.col("weighting") == "features"))
    found = found.filter(pl.col("statistic").is_in(list(_TOLD_AS)), pl.col("coordinate").is_in(list(_COORDINATES)))
    named = found.with_columns(statistic=pl.col("statistic").replace_strict(_TOLD_AS, return_dtype=pl.String))
    root = pl.col("statistic") == _SPREAD
    ends = {end: pl.when(root).then(pl.col(end).clip(lower_bound=0.0).sqrt()).otherwise(end) for end in ("low", "high")}
    return bands.side_by_side(named.with_columns(**ends), ["tracker", "statistic", "at"]).drop_nulls(list(BOUNDS))


def _panel(evidence: Evidence, points: pl.DataFrame, statistic: str, coordinate: str) -> Panel:
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
        f"{coordinate}:Q", title=heading, scale=alt.Scale(domain=_domain(table, yardsticks=correlation), nice=False)
    )
    hue, opacity = marks.colour("tracker", evidence.colour, "tracker"), marks.opacity("tracker")
    tips = [alt.Tooltip("tracker:N"), alt.Tooltip("at:Q"), alt.Tooltip("n:Q"), alt.Tooltip(f"{coordinate}:Q")]
    lines = alt.Chart(marks.rows(table.select("tracker", "at", "n", coordinate)))
    lines = lines.mark_line(point=alt.OverlayMarkDef(size=14), clip=True).encode(
        x=x, y=y, color=hue, opacity=opacity, tooltip=tips
    )
    band = marks.band(table, "tracker", evidence.colour, coordinate, x, y)
    zero = (
        alt.Chart(alt.InlineData(values=[{"zero": 0}])).mark_rule(color=style.QUIET, strokeWidth=0.8).encode(y="zero:Q")
    )
    chart = alt.layer(*band, lines, zero, *(_yardsticks(x, y) if correlation else []))
    selections = (marks.shown("tracker", evidence.colour),)
    return Panel(chart.properties(title=title, **_SIZE), selections, layer=len(band))


def _yardsticks(x: alt.X, y: alt.Y) -> list[alt.Chart]:
    """What white noise would give, and, at zero, a random walk."""
    white = alt.Chart(marks.rows(_WHITE)).mark_line(color=style.QUIET, strokeDash=[3, 3], clip=True)
    names = alt.Chart(marks.rows(_YARDSTICKS)).mark_text(color=style.QUIET, fontSize=10, align="left", dx=14, dy=-6)
    return [white.encode(x=x, y=marks.on(y, "white")), names.encode(x=x, y=marks.on(y, "value"), text="of:N")]


def _domain(table: pl.DataFrame, *, yardsticks: bool) -> list[float]:
    """Bounds that hold both coordinates, and the yardsticks if they are drawn."""
    least = pl.Series(_WHITE["white"] if yardsticks else [], dtype=pl.Float64)
    return marks.holding(pl.concat([table["u"], table["v"], least]), pl.concat(table[name] for name in BOUNDS))


def _look_for(evidence: Evidence, points: pl.DataFrame) -> str:
    told = [_told(tracker, points.filter(tracker=tracker)) for tracker in evidence.trackers]
    sentences = " ".join(sentence for sentence in told if sentence)
    return (
        f"{sentences} A mean that stays away from zero is a drift. A standard deviation that rises with age says that "
        "tracks grow less reliable as their features change; the same at all ages, that each frame adds as much as the "
        f"one before. Changes that undo each other ({MINUS}0.5 at one step, 0 beyond) are noise of each frame by "
        "itself; changes that know nothing of each other (0 everywhere) are steps of a random walk."
    )


def _told(tracker: str, points: pl.DataFrame) -> str:
    """What a tracker's changes are like at the last age up to the reference age, and from one to the next."""
    ages = points.filter(pl.col("statistic") == _SPREAD, pl.col("at") <= REFERENCE_AGE).sort("at")
    if ages.is_empty():
        return ""
    spread = ages.row(-1, named=True)
    mean = points.filter(statistic=_MEAN, at=spread["at"]).row(0, named=True)
    text = (
        f"The change of an error of {tracker} that ends at age {number(spread['at'])} is {px(mean['u'])} in u and "
        f"{px(mean['v'])} in v on average, and varies by {px(spread['u'])} and {px(spread['v'])} (standard deviation)."
    )
    near = points.filter(statistic=AUTOCORRELATION, at=1)
    if near.is_empty():
        return text
    row = near.row(0, named=True)
    return (
        f"{text} Over all ages, a change correlates with the one before by {number(row['u'])} and {number(row['v'])}."
    )


FAMILY = Family(
    id=_NAME,
    title=_TITLE,
    lead="What a frame adds to an error is what a filter's process noise, or a factor between two frames, has to know.",
    figures=figures,
)
