"""Growth of errors: changes from frame to frame, their autocorrelation, and fitted models.

- Changes of errors from one frame that the tracker saw to the next: by age, and their autocorrelation.
- Error growth: the second moment by age with the fitted model, and the autocorrelation of the changes.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import altair as alt
import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.curve_intervals import AUTOCORRELATION
from tracknoise.inference.estimates import Estimate
from tracknoise.report import style
from tracknoise.report.cells import Cells
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure, Sections, SectionTables
from tracknoise.report.figures.panels import COORDINATES, Panel, arranged, curves, layered
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import LAGS, NAMES, REFERENCE_AGE
from tracknoise.tables.enumerations import Aspect
from tracknoise.topics import bands
from tracknoise.topics.bands import BOUNDS
from tracknoise.topics.growth_topic import behaviour
from tracknoise.topics.sentences import because
from tracknoise.words import DASH, MINUS, format_estimate, listing, number, px, sentence_case

_NAME, _CHANGE_TITLE = "changes", "Changes from frame to frame"
_MEAN, _SPREAD = "mean", "spread"
_ROWS: Mapping[str, str] = {
    _MEAN: "mean change (px)",
    _SPREAD: "its standard deviation (px)",
    AUTOCORRELATION: "autocorrelation",
}
"""Statistics in the rows of the figure, and what their axes say."""
_STATISTICS = {NAMES["age"]["mean"]: _MEAN, NAMES["age"]["central"]: _SPREAD, AUTOCORRELATION: AUTOCORRELATION}
"""Statistic of the figure, by its name in the table of intervals."""
_WHITE = pl.DataFrame({"at": range(1, LAGS + 1), "white": [-0.5, *[0.0] * (LAGS - 1)]})
"""Autocorrelation of the changes of white noise, by lag."""
_CHANGE_REFERENCES = pl.DataFrame({"at": [1, 1], "value": [0.0, -0.5], "of": ["random walk", "white noise"]})
"""Labels of the two reference values."""


def change_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: all trackers at the lowest speed."""
    points = _points(data)
    if points.is_empty():
        why = f"No age has {data.min_features} features with a known error in the previous frame too."
        return [Absence(_NAME, _CHANGE_TITLE, why)]
    panels = [_panel(data, points, name, coordinate) for name in _ROWS for coordinate in COORDINATES]
    shows = (
        f"Change of {data.errors_shown.lower()} of visible features at speed {data.slowest}{data.where}, from one "
        "frame that the tracker saw to the next. Top and middle: mean and standard deviation of the change, by the age "
        f"at which it ends. Bottom: correlation of a change with those up to {number(LAGS)} steps before it, over all "
        f"ages. {bands.describe_intervals(points, of='the curves')}"
    )
    spec = arranged(panels, columns=2, independent=["fill"])
    return [Figure(_NAME, _CHANGE_TITLE, shows, _look_for_changes(data, points), spec, _change_message(data, points))]


def _change_message(data: ReportData, points: pl.DataFrame) -> str:
    """Trackers whose successive changes have opposite signs in u and v, more often than by chance."""
    negative = points.filter(pl.col("u_high") < 0, pl.col("v_high") < 0, statistic=AUTOCORRELATION, at=1)
    names = [name for name in data.trackers if name in negative["tracker"]]
    return f"Successive changes of {listing(names)} tend to have opposite signs" if names else ""


def _points(data: ReportData) -> pl.DataFrame:
    """One row per tracker, statistic and age or lag: `at`, n, u and v with `BOUNDS`, and the kind of interval."""
    table = data.nominal(data["changes"]).filter(trimming=data.trimming)
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
    intervals = data.nominal(data.intervals).filter(aspect=Aspect.change, trimming=data.trimming)
    intervals = intervals.filter(pl.col("weighting").is_null() | (pl.col("weighting") == "features"))
    intervals = intervals.filter(
        pl.col("statistic").is_in(list(_STATISTICS)), pl.col("coordinate").is_in(list(COORDINATES))
    )
    named = intervals.with_columns(statistic=pl.col("statistic").replace_strict(_STATISTICS, return_dtype=pl.String))
    root = pl.col("statistic") == _SPREAD
    ends = {end: pl.when(root).then(pl.col(end).clip(lower_bound=0.0).sqrt()).otherwise(end) for end in ("low", "high")}
    return bands.side_by_side(named.with_columns(**ends), ["tracker", "statistic", "at"]).drop_nulls(list(BOUNDS))


def _panel(data: ReportData, points: pl.DataFrame, statistic: str, coordinate: str) -> Panel:
    table = points.filter(statistic=statistic)
    correlation = statistic == AUTOCORRELATION
    title = COORDINATES[coordinate] if statistic == _MEAN else ""
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
    tips = [alt.Tooltip("tracker:N"), alt.Tooltip("at:Q"), alt.Tooltip("n:Q"), alt.Tooltip(f"{coordinate}:Q")]
    above = [marks.zero_line(), *(_references(x, y) if correlation else [])]
    return curves(table, "tracker", coordinate, x, y, data.colour, tips, title=title, above=above)


def _references(x: alt.X, y: alt.Y) -> list[alt.Chart]:
    """Expected values for white noise and, at zero, for a random walk."""
    white = alt.Chart(marks.rows(_WHITE)).mark_line(color=style.QUIET, strokeDash=[3, 3], clip=True)
    names = alt.Chart(marks.rows(_CHANGE_REFERENCES)).mark_text(
        color=style.QUIET, fontSize=12, align="left", dx=14, dy=-6
    )
    return [white.encode(x=x, y=marks.on(y, "white")), names.encode(x=x, y=marks.on(y, "value"), text=alt.Text("of:N"))]


def _domain(table: pl.DataFrame, *, references: bool) -> list[float]:
    """Bounds that include both coordinates, and the reference values if they are drawn."""
    least = pl.Series(_WHITE["white"] if references else [], dtype=pl.Float64)
    return marks.holding(pl.concat([table["u"], table["v"], least]), pl.concat(table[name] for name in BOUNDS))


def _look_for_changes(data: ReportData, points: pl.DataFrame) -> str:
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


_TIME_STRUCTURE_TITLE = "Error growth"
_PARTS = {
    "white_px_geometric": ("constant", "px"),
    "walk_px_per_sqrt_frame_geometric": ("random walk", "px/√frame"),
    "drift_px_per_frame_geometric": ("drift", "px/frame"),
    "saturating_px": ("saturating part", "px"),
    "saturating_frames": ("time constant", "frames"),
}
"""Names and units of the parts of the fit: of the polynomial in a typical scene, which the verdict is about."""
_BEHAVES = {
    "white": "constant",
    "random walk": "a random walk",
    "drift": "a drift",
    "saturating": "saturating",
    "none": "other",
    "undecided": "undecided",
}
"""Words for each verdict."""
_SENTENCES = {
    "white": "the error of {} is constant",
    "random walk": "the error of {} is a random walk",
    "drift": "the error of {} is a drift",
    "saturating": "the error of {} grows towards a limit",
    "none": "the error of {} fits none of the models",
    "undecided": "how the error of {} grows is undecided",
}
"""How a sentence states each verdict."""
_POLYNOMIAL = ("white_px", "walk_px_per_sqrt_frame", "drift_px_per_frame")
_SATURATING = ("saturating_white_px", "saturating_px", "saturating_frames")
_EXPLAINED = ("random walk", "drift", "saturating")
"""Verdicts whose reason is in the columns before them."""
_TIME_STRUCTURE_SIZE = {"width": 395, "height": 200}
_MOST_PLACES = 200
_TIME_STRUCTURE_REFERENCES = pl.DataFrame({"at": [0.0, -0.5], "of": ["random walk", "white noise"]})
"""Autocorrelation of the changes at one step, for pure errors of each kind."""


def time_structure_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: all trackers at the lowest speed, and the autocorrelation at every speed."""
    table = _fitted(data)
    if table.is_empty():
        why = "No condition has enough errors to judge their growth."
        return [Absence("time-structure", _TIME_STRUCTURE_TITLE, why)]
    points = data.nominal(data.points).filter(pl.col("since") != 0, population=data.population, role="second")
    points = points.filter(pl.col("trimming").is_in(data.trimmings)).with_columns(distance=pl.col("since").abs())
    nominal = table.filter(speed=data.slowest)
    panels = [
        panel(coordinate, trimming)
        for panel in (partial(_growth, data, points, nominal), partial(_correlation, data, table))
        for coordinate in COORDINATES
        for trimming in data.trimmings
    ]
    figure = Figure(
        id="time-structure",
        title=_TIME_STRUCTURE_TITLE,
        shows=f"Top: the second moment about zero by {data.axis.distance} at speed {data.slowest}"
        f"{data.where} (dots) and the fitted model (lines). The model has a constant part, a part that grows with the "
        "number of frames, and a part that grows with its square. Where this model fails, one with a part that grows "
        "towards a limit is drawn, if it fits. Bottom: the correlation of successive changes of "
        "the error, from one frame that the tracker saw to the next, at every speed. "
        f"{bands.describe_intervals(points, of='the second moments', marks='Thin lines at')}",
        look_for=_look_for_time_structure(data, nominal),
        spec=arranged(panels, columns=2),
        message=_time_structure_message(data),
    )
    return [figure]


def _time_structure_message(data: ReportData) -> str:
    """The verdict of the first tracker whose error behaves alike in u and v; empty where none is established."""
    kinds = ((tracker, kind) for tracker in data.trackers if (kind := behaviour(data, tracker)))
    return next((sentence_case(_SENTENCES[kind].format(tracker)) for tracker, kind in kinds), "")


def tables(data: ReportData) -> Sequence[Cells]:
    """The fitted model: one row per tracker, speed and coordinate."""
    rows = [
        [
            row["tracker"],
            str(row["speed"]),
            row["coordinate"],
            row["trimming"],
            *(_size(row, name, unit) for name, (_, unit) in _PARTS.items()),
            _size(row, "autocorrelation", ""),
            _BEHAVES[row["verdict"]],
            "" if row["verdict"] in _EXPLAINED else row["why"] or "",
        ]
        for row in _fitted(data).to_dicts()
    ]
    parts = [name for name, _ in _PARTS.values()]
    headings = ["tracker", "speed", "coordinate", "trimming", *parts, "autocorrelation", "verdict", "why"]
    numeric = [False, True, False, False, *[True] * (1 + len(parts)), False, False]
    return [Cells(f"Fitted error growth{data.where}: in a typical scene", headings, rows, numeric)] if rows else []


def _fitted(data: ReportData) -> pl.DataFrame:
    table = data.reference(data["time_structure"]).filter(pl.col("trimming").is_in(data.trimmings))
    return table.sort(data.tracker_place, "speed", "coordinate", "trimming")


def _titled(data: ReportData, title: str, trimming: str) -> str:
    """Title of an axis, with the trimming where there are two."""
    return title if data.percentile is None else f"{trimming}, {title}"


def _growth(data: ReportData, all_points: pl.DataFrame, fits: pl.DataFrame, coordinate: str, trimming: str) -> Panel:
    """Measured second moments, and the fit over the same distances."""
    points = all_points.filter(trimming=trimming)
    measured = points.select(
        "tracker", "distance", "n", moment=pl.col(coordinate) ** 2, low=pl.col(f"{coordinate}_low") ** 2,
        high=pl.col(f"{coordinate}_high") ** 2,
    )  # fmt: skip
    fitted = _curves(fits.filter(coordinate=coordinate, trimming=trimming), points)
    values = pl.concat([measured["moment"], fitted["moment"]])
    largest = float(values.max() or 1.0)  # type: ignore[arg-type]
    highest = measured["high"].clip(upper_bound=2 * largest)
    ends = marks.domain(pl.concat([values, highest]), zero=True)
    reach = float(points["distance"].max() or 1)  # type: ignore[arg-type]
    x = alt.X(
        "distance:Q",
        title=f"{data.axis.distance} (frames of the sequence)",
        axis=alt.Axis(tickMinStep=1),
        scale=alt.Scale(domain=[0, 1.03 * reach], nice=False),
    )
    y = alt.Y(
        "moment:Q",
        title=_titled(data, f"{COORDINATES[coordinate]}: second moment (px²)", trimming),
        scale=alt.Scale(domain=ends, nice=False),
    )
    hue, opacity = marks.colour("tracker", data.colour, "tracker"), marks.opacity("tracker")
    tips = [
        alt.Tooltip("tracker:N"),
        alt.Tooltip("distance:Q"),
        alt.Tooltip("n:Q", title="features"),
        alt.Tooltip("moment:Q", title="px²"),
    ]
    dots = alt.Chart(marks.rows(measured)).encode(x=x, y=y, color=hue, opacity=opacity, tooltip=tips)
    lines = alt.Chart(marks.rows(fitted)).mark_line().encode(x=x, y=y, color=hue, opacity=opacity)
    whiskers = alt.Chart(marks.rows(measured.drop_nulls(["low", "high"])))
    whiskers = whiskers.mark_rule(strokeWidth=1, clip=True).encode(
        x=x, y=marks.on(y, "low"), y2=alt.Y2("high:Q"), color=hue, opacity=opacity
    )
    chart = layered(dots.mark_point(size=16, clip=True), lines, whiskers).properties(**_TIME_STRUCTURE_SIZE)
    return Panel(chart, (marks.shown("tracker", data.colour),))


def _curves(fits: pl.DataFrame, points: pl.DataFrame) -> pl.DataFrame:
    """The fitted second moment of every tracker, over its measured distances."""
    parts = [pl.DataFrame(schema={"tracker": pl.String, "distance": pl.Float64, "moment": pl.Float64})]
    for row in fits.drop_nulls(_POLYNOMIAL).to_dicts():
        reach = points.filter(tracker=row["tracker"])["distance"].max()
        k = np.linspace(0.0, float(reach or 0), _MOST_PLACES)  # type: ignore[arg-type]
        columns = {"distance": k, "moment": _fitted_moment(row, k)}
        parts.append(pl.DataFrame(columns).select(pl.lit(row["tracker"]).alias("tracker"), "distance", "moment"))
    return pl.concat(parts)


def _fitted_moment(row: Mapping[str, Any], k: NDArray[np.float64]) -> NDArray[np.float64]:
    """white^2 + walk^2 k + drift^2 k^2 or, if errors are saturating, white^2 + size^2 (1 - exp(-k / tau))."""
    if row["verdict"] == "saturating":
        white, size, tau = (row[name] for name in _SATURATING)
        return np.asarray(white**2 - size**2 * np.expm1(-k / tau))
    white, walk, drift = (row[name] ** 2 for name in _POLYNOMIAL)
    return np.asarray(white + walk * k + drift * k**2)


def _correlation(data: ReportData, table: pl.DataFrame, coordinate: str, trimming: str) -> Panel:
    """Autocorrelation of the changes at every speed, with those of a random walk and of white noise."""
    names = ["autocorrelation", "autocorrelation_low", "autocorrelation_high"]
    rows = table.filter(coordinate=coordinate, trimming=trimming).drop_nulls("autocorrelation")
    rows = rows.select("tracker", pl.col("speed").cast(pl.String), value=names[0], low=names[1], high=names[2])
    ends = pl.concat([rows["value"], rows["low"], rows["high"], pl.Series([-0.55, 0.1])])
    x = alt.X("speed:N", sort=[str(speed) for speed in data.speeds], axis=alt.Axis(labelAngle=0))
    y = alt.Y(
        "value:Q",
        title=_titled(data, f"{COORDINATES[coordinate]}: autocorrelation", trimming),
        scale=alt.Scale(domain=marks.domain(ends), nice=False),
    )
    hue, opacity = marks.colour("tracker", data.colour, "tracker"), marks.opacity("tracker")
    offset = alt.XOffset("tracker:N", sort=data.trackers)
    tips = [
        alt.Tooltip("tracker:N"),
        alt.Tooltip("speed:N"),
        *(alt.Tooltip(f"{name}:Q", format=".3f") for name in ("value", "low", "high")),
    ]
    base = alt.Chart(marks.rows(rows)).encode(x=x, xOffset=offset, color=hue, opacity=opacity, tooltip=tips)
    dots = base.mark_point(size=40).encode(y=y)
    bars = base.transform_filter("isValid(datum.low) && isValid(datum.high)").mark_rule(strokeWidth=1.5)
    references = alt.Chart(marks.rows(_TIME_STRUCTURE_REFERENCES))
    rules = references.mark_rule(color=style.QUIET, strokeDash=[3, 3]).encode(y=marks.on(y, "at"))
    labels = references.mark_text(color=style.QUIET, fontSize=12, align="left", dx=3, dy=-6).encode(
        y=marks.on(y, "at"), x=alt.value(0), text=alt.Text("of:N")
    )
    chart = layered(dots, bars.encode(y=marks.on(y, "low"), y2=alt.Y2("high:Q")), rules, labels)
    return Panel(chart.properties(**_TIME_STRUCTURE_SIZE), (marks.shown("tracker", data.colour),))


def _look_for_time_structure(data: ReportData, nominal: pl.DataFrame) -> str:
    shown = nominal.filter(trimming=data.trimming)
    parts = [_sentences(row) for tracker in data.trackers for row in shown.filter(tracker=tracker).to_dicts()]
    trimming = "" if data.percentile is None else f", {data.trimming}"
    numbers = (
        f"At speed {data.slowest}{trimming}, {' '.join([*parts[:1], *map(sentence_case, parts[1:])])} " if parts else ""
    )
    return (
        f"{numbers}A flat line is a constant error. It is white noise if the autocorrelation of its changes is near "
        f"{MINUS}0.5, and a filter can average it out. Otherwise it is an offset. A straight rise is a random walk, "
        "and a rise that bends upwards is a drift. Averaging removes neither. A rise that levels off is saturating."
    )


def _sentences(row: Mapping[str, Any]) -> str:
    parts = [
        f"{name} {format_estimate(_estimate(row, part, unit))}" for part, (name, unit) in _PARTS.items() if row[part]
    ]
    verdict = _SENTENCES[row["verdict"]].format(f"{row['tracker']} in {row['coordinate']}")
    if row["verdict"] in ("none", "undecided"):
        return because(verdict, row["why"])
    fitted = f"Its fitted parts in a typical scene: {listing(parts)}." if parts else "No model was fitted."
    return f"{verdict}. {fitted}"


def _size(row: Mapping[str, Any], name: str, unit: str) -> str:
    return DASH if row[name] is None else format_estimate(_estimate(row, name, unit)).strip()


def _estimate(row: Mapping[str, Any], name: str, unit: str) -> Estimate:
    return Estimate.of_row(row, name, f"{name}_low", f"{name}_high", unit)


FIGURES: Sections = {"time-structure": (time_structure_figures,), "changes": (change_figures,)}
"""What this module draws, by the section of the report."""
TABLES: SectionTables = {"time-structure": tables}
"""Tables below the figures of a section."""
