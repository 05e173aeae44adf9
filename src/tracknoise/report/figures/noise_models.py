"""Noise models over what they were fitted to, and what they claim of depths.

- The noise models of a run over the errors that they were fitted to.
- The noise to give to an estimator, by the length of its windows.
- How many claimed intervals of depths hold the true depth, by what noise is assumed.
- Whether covariances that trackers predict are right: coverage, and NEES by age.
"""

from collections.abc import Mapping, Sequence
from typing import Any, cast

import altair as alt
import polars as pl

from tracknoise.analysis.condition_units import groups_of_run
from tracknoise.estimators.fitted_curve import fitted_curve
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.run_models import run_models
from tracknoise.inference.track_noise import COMPONENTS
from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure, Sections
from tracknoise.report.figures.panels import Panel, arranged, curves, layered
from tracknoise.report.report_data import ReportData
from tracknoise.topics.bands import AGE, describe_bounds, describe_intervals
from tracknoise.topics.covariance_topic import covariance_message, covariance_sentence, own_covariances
from tracknoise.topics.depth_topic import LEVELS, depth_shares
from tracknoise.topics.window_topic import estimator_sentence, sigma_message
from tracknoise.words import SPACE, number, sentence_case

_LOOKS: dict[str, Any] = {"height": 230, "point": 20, "clip": False}
"""Of panels of curves."""
_MODEL_FIT_ID, _MODEL_FIT_TITLE = "model-fit", "The noise model over the errors that it was fitted to"
_MODEL_FIT_COLOURS = dict(zip(("measured", "model"), style.PALETTE[:2], strict=True))


def model_fit_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: a panel per tracker at the lowest speed."""
    models = run_models(data.run).models
    if not models:
        return [Absence(_MODEL_FIT_ID, _MODEL_FIT_TITLE, "This run has no noise model.")]
    fits = _curves(data, models)
    panels = [_model_fit_panel(tracker, fit) for tracker, fit in fits.items()]
    table = pl.concat(list(fits.values()))
    shows = (
        f"Root mean square of a coordinate of the errors about the first position at speed {data.slowest}, by age, all "
        "views together. Errors beyond the limit of the model are left out. The line of the model is that of its "
        f"components, at the magnifications of these tracks. {describe_bounds(table, of='the measured errors')}"
    )
    look_for = " ".join(
        [*(_sentence(tracker, models[tracker], fit) for tracker, fit in fits.items()), _MODEL_FIT_ADVICE]
    )
    spec = arranged(panels, columns=2, independent=["fill"])
    return [Figure(_MODEL_FIT_ID, _MODEL_FIT_TITLE, shows, look_for, spec, _model_fit_message(fits))]


def _model_fit_message(curves: Mapping[str, pl.DataFrame]) -> str:
    """At how many ages the model that fits worst lies outside the intervals; empty where a tracker has no interval."""
    bounded = {tracker: curve.drop_nulls(["modelled", "low", "high"]) for tracker, curve in curves.items()}
    if any(curve.is_empty() for curve in bounded.values()):
        return ""
    inside = pl.col("modelled").is_between("low", "high")
    outside = {tracker: curve.filter(~inside).height for tracker, curve in bounded.items()}
    worst = max(outside, key=lambda tracker: outside[tracker])
    if outside[worst]:
        return f"The model of {worst} is outside the intervals at {outside[worst]} of {bounded[worst].height} ages"
    return f"{'The model is' if len(curves) == 1 else 'All models are'} inside the intervals of the measured errors"


_MODEL_FIT_ADVICE = "Where the line leaves the band, one set of components does not describe tracks of all ages."


def _curves(data: ReportData, models: Mapping[str, NoiseModel]) -> dict[str, pl.DataFrame]:
    """Measured and modelled errors of each tracker. The sums of all trackers are read together."""
    chosen = pl.col("tracker").is_in(list(models)) & (pl.col("speed") == data.slowest) & (pl.col("product") == "error")
    sums = pl.concat([table.filter(chosen) for table in data.run.stored_tables("noise_sums")])
    groups = groups_of_run(data.run)
    return {
        tracker: fitted_curve(sums.filter(tracker=tracker), model.components, groups=groups)
        for tracker, model in models.items()
    }


def _sentence(tracker: str, model: NoiseModel, curve: pl.DataFrame) -> str:
    """Components of the model, and how far it is off."""
    parts = [(component, getattr(model, component.name)) for component in COMPONENTS]
    kept = [(component, part.sigma.value) for component, part in parts if part.why_dropped is None]
    stated = ", ".join(f"{component.phrase} {number(value)}{SPACE}{component.unit}" for component, value in kept)
    compared = curve.drop_nulls(["measured", "modelled"]).filter(pl.col("measured") > 0.0)
    if compared.is_empty():
        return f"{tracker}: {stated}."
    off = (compared["modelled"] / compared["measured"] - 1.0).abs().max()
    return f"{tracker}: {stated}; at most {100.0 * float(off):.0f}{SPACE}% off the measured errors."  # type: ignore[arg-type]


def _model_fit_panel(tracker: str, curve: pl.DataFrame) -> Panel:
    columns = curve.select(line=pl.lit("measured"), at="age", n="n", u="measured", u_low="low", u_high="high")
    modelled = curve.select(line=pl.lit("model"), at="age", u="modelled")
    x = marks.along(curve["age"], title="age (frames)", from_zero=True)
    shown = pl.concat([columns["u"], modelled["u"]])
    y = alt.Y("u:Q", title="error (px)", scale=alt.Scale(domain=marks.holding(shown, columns["u_high"]), nice=False))
    hue = marks.colour("line", _MODEL_FIT_COLOURS, "errors")
    tips = [alt.Tooltip("at:Q", title="age"), alt.Tooltip("n:Q", title="errors"), alt.Tooltip("u:Q", title="px")]
    points = alt.Chart(marks.rows(columns.select("line", "at", "n", "u"))).mark_point(filled=True, size=22)
    measured = points.encode(x=x, y=y, color=hue, opacity=marks.opacity("line"), tooltip=tips)
    drawn = alt.Chart(marks.rows(modelled)).mark_line()
    line = drawn.encode(x=x, y=y, color=hue, opacity=marks.opacity("line"))
    band = marks.band(columns, "line", _MODEL_FIT_COLOURS, "u", x, y)
    chart = layered(*band, measured, line).properties(width=395, height=210, title=alt.Title(tracker))
    return Panel(chart, (marks.shown("line", _MODEL_FIT_COLOURS),), layer=len(band))


_WINDOW_SIGMA_ID, _WINDOW_SIGMA_TITLE = "window-sigmas", "Sigma for the depths of points, by length of the window"
_LINES = {"consistent_sigma": "for depths", "residual_core": "residual core"}
_WINDOW_SIGMA_COLOURS = dict(zip(_LINES.values(), style.PALETTE[:2], strict=True))
_WINDOW_SIGMA_ADVICE = (
    "Where the two lines differ, depths need the upper one: residuals are too small where errors of one track "
    "are alike from frame to frame. If the lines were flat and equal, errors would be independent in every frame."
)


def window_sigma_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: a panel per tracker at the lowest speed."""
    rows = data.nominal(data["window_sigmas"]).filter(pl.col("quantity").is_in([*_LINES]), trimming=data.trimming)
    if rows.is_empty():
        return [
            Absence(_WINDOW_SIGMA_ID, _WINDOW_SIGMA_TITLE, "No track was long enough for a window of an estimator.")
        ]
    table = rows.with_columns(line=pl.col("quantity").replace_strict(_LINES), at=pl.col("window").cast(pl.Int64))
    present = [tracker for tracker in data.trackers if tracker in table["tracker"]]
    panels = [_window_sigma_panel(table, tracker) for tracker in present]
    shows = (
        f"Standard deviation of one coordinate at speed {data.slowest}{data.where}, by the number of observations in a "
        "window. The first line is the sigma for depths, with which depths are as certain as an estimator claims. "
        f"The second is the residual core. {describe_bounds(table, of='the lines')}"
    )
    look_for = " ".join(
        [*filter(None, (estimator_sentence(data, tracker) for tracker in present)), _WINDOW_SIGMA_ADVICE]
    )
    spec = arranged(panels, columns=2, independent=["fill"])
    return [Figure(_WINDOW_SIGMA_ID, _WINDOW_SIGMA_TITLE, shows, look_for, spec, sigma_message(data))]


def _window_sigma_panel(table: pl.DataFrame, tracker: str) -> Panel:
    rows = table.filter(tracker=tracker).sort("line", "at")
    columns = rows.select("line", "at", "n", u="value", u_low="low", u_high="high")
    x = marks.along(table["at"], title="observations in a window", from_zero=True)
    domain = marks.holding(table["value"], pl.concat([table["low"], table["high"]]))
    y = alt.Y("u:Q", title="sigma (px)", scale=alt.Scale(domain=domain, nice=False))
    tips = [alt.Tooltip("line:N"), alt.Tooltip("at:Q", title="window"), alt.Tooltip("n:Q", title="windows"),
            alt.Tooltip("u:Q", title="sigma (px)")]  # fmt: skip
    hue = marks.colour("line", _WINDOW_SIGMA_COLOURS, "sigma")
    return curves(
        columns,
        "line",
        "u",
        x,
        y,
        _WINDOW_SIGMA_COLOURS,
        tips,
        title=tracker,
        hue=hue,
        height=190,
        point=20,
        clip=False,
    )


_DEPTH_INTERVAL_ID, _DEPTH_INTERVAL_TITLE = "depth-intervals", "True depths inside the claimed intervals"
_RESIDUAL, _CONSISTENT = "residual core", "sigma for depths"
_DEPTH_INTERVAL_COLOURS = dict(zip((_RESIDUAL, _CONSISTENT, "whole tracks", "1 px"), style.PALETTE[:4], strict=True))
_WHY = (
    "It takes true depths, tracks of at least five observations, and two scenes or more. Noise is tried on scenes that "
    "it was not learned from."
)


def depth_interval_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: a panel per tracker at the lowest speed."""
    rows = depth_shares(data)
    if rows.is_empty():
        return [Absence(_DEPTH_INTERVAL_ID, _DEPTH_INTERVAL_TITLE, _WHY)]
    table = rows.rename({"value": "u", "low": "u_low", "high": "u_high"})
    table = table.with_columns(
        pl.col("covariance").replace({"residual sigma": _RESIDUAL, "consistent sigma": _CONSISTENT})
    )
    present = [tracker for tracker in data.trackers if tracker in table["tracker"]]
    shows = (
        f"Share of windows whose true depth is inside the claimed interval, by the level of the interval, at speed "
        f"{data.slowest}{data.where}. Points are triangulated with the true poses. The noise was learned from other "
        f"scenes. Windows of {_windows(table, present)}. {describe_bounds(rows, of='the lines')}"
    )
    panels = [_depth_interval_panel(table, tracker) for tracker in present]
    spec = arranged(panels, columns=2, independent=["fill"])
    return [
        Figure(
            _DEPTH_INTERVAL_ID,
            _DEPTH_INTERVAL_TITLE,
            shows,
            _advice(table, present),
            spec,
            _depth_interval_message(table),
        )
    ]


def _depth_interval_message(table: pl.DataFrame) -> str:
    """The tracker whose residuals mislead most; empty where none is shown to mislead."""
    few = table.filter(pl.col("u_high") < 95.0, covariance=_RESIDUAL, at=95).sort("u")
    if few.is_empty():
        return ""
    tracker, share = few.select("tracker", "u").row(0)
    return f"95{SPACE}% depth intervals of {tracker} from the residual core contain {share:.0f}{SPACE}% of depths"


def _windows(table: pl.DataFrame, trackers: Sequence[str]) -> str:
    lengths = {tracker: table.filter(tracker=tracker)["window"][0] for tracker in trackers}
    if len(set(lengths.values())) == 1:
        return f"{lengths[trackers[0]]} observations"
    return ", ".join(f"{length} observations ({tracker})" for tracker, length in lengths.items())


def _advice(table: pl.DataFrame, trackers: Sequence[str]) -> str:
    """What a 95 % interval holds, and what to look for."""
    sentences = []
    for tracker in trackers:
        rows = table.filter(tracker=tracker, at=95)
        shares = {name: f"{share:.0f}{SPACE}%" for name, share in rows.select("covariance", "u").iter_rows()}
        stated = [
            f"{shares[name]} from the {name}"
            for name in _DEPTH_INTERVAL_COLOURS
            if name in shares and name in (_RESIDUAL, _CONSISTENT)
        ]
        stated += [f"{shares['whole tracks']} from the covariance of whole tracks"] if "whole tracks" in shares else []
        sentences.append(
            f"Intervals of 95{SPACE}% of {tracker} contain these shares of true depths: {', '.join(stated)}."
        )
    last = "Where a line is below the diagonal, depths are less certain than claimed."
    return " ".join([*map(sentence_case, sentences), last])


def _depth_interval_panel(table: pl.DataFrame, tracker: str) -> Panel:
    rows = table.filter(tracker=tracker).sort("covariance", "at")
    columns = rows.select("covariance", "at", "n", "u", "u_low", "u_high")
    scale = alt.Scale(domain=[40, 100], nice=False, clamp=True)
    x = alt.X("at:Q", title="level of the claimed interval (%)", scale=scale, axis=alt.Axis(values=[*LEVELS.values()]))
    y = alt.Y("u:Q", title="true depths inside (%)", scale=alt.Scale(domain=[0, 100], nice=False))
    tips = [alt.Tooltip("covariance:N"), alt.Tooltip("at:Q", title="level (%)"), alt.Tooltip("n:Q", title="windows"),
            alt.Tooltip("u:Q", title="inside (%)")]  # fmt: skip
    colours = _DEPTH_INTERVAL_COLOURS
    hue = marks.colour("covariance", colours, "assumed noise", columns=2)
    below = [_dashed((40, 40), (100, 100), x, y)]
    return curves(columns, "covariance", "u", x, y, colours, tips, title=tracker, hue=hue, below=below, **_LOOKS)


def _dashed(start: tuple[Any, float], end: tuple[Any, float], x: alt.X, y: alt.Y) -> alt.Chart:
    """A dashed line between two points (at, u)."""
    ends = alt.InlineData(values=[{"at": at, "u": u} for at, u in (start, end)])
    line: alt.Chart = alt.Chart(ends).mark_line(color="#8a949e", strokeDash=[4, 3]).encode(x=x, y=y)
    return line


_COVARIANCE_ID, _COVARIANCE_TITLE = "own-covariances", "Covariances that trackers predict"
_COVARIANCE_ADVICE = (
    "Below the diagonal, covariances are too small. A NEES of 1 is right, and of all ages together it is the factor "
    "that would make them right. If it grows with age, errors add up along tracks, and the covariances do not."
)


def covariance_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure, where a tracker predicts covariances: coverage of their regions, and NEES by age."""
    rows = own_covariances(data).rename({"value": "u", "low": "u_low", "high": "u_high"})
    levels = pl.col("quantity").replace_strict(LEVELS, default=None, return_dtype=pl.Int64)
    shares = rows.filter(pl.col("quantity").is_in([*LEVELS])).with_columns(
        pl.col("u", "u_low", "u_high") * 100, at=levels
    )
    nees = rows.filter(pl.col("at").is_not_null() & (pl.col("n") >= data.min_features), quantity="nees")
    if shares.is_empty():
        return []
    lines = shares.select("tracker", "line").unique().sort("line").rows()
    names = [name for tracker in data.trackers for owner, name in lines if owner == tracker]
    colours = dict(zip(names, style.colours(names), strict=True))
    bounded = pl.concat([shares, nees]).drop_nulls(["u_low", "u_high"])
    shows = (
        f"Left: share of the errors inside the regions of a level. Right: NEES by {data.axis.name}, the mean of the "
        f"squared Mahalanobis distance over 2. At speed {data.slowest}{data.where}, of {data.tracks_shown}. The "
        "covariance of an error is that of its observation plus that of the first position of the track. "
        f"{describe_intervals(bounded, of='the lines', n_scenes='n_scenes')}"
    )
    panels = [_coverage_panel(shares, colours), *([_nees_panel(data, nees, colours)] if nees.height else [])]
    sentences = [*filter(None, (covariance_sentence(data, tracker) for tracker in data.trackers))]
    spec = arranged(panels, columns=2, independent=["fill"])
    look_for = " ".join([*sentences, _COVARIANCE_ADVICE])
    return [Figure(_COVARIANCE_ID, _COVARIANCE_TITLE, shows, look_for, spec, covariance_message(data))]


def _coverage_panel(shares: pl.DataFrame, colours: Mapping[str, str]) -> Panel:
    columns = shares.sort("line", "at").select("line", "at", "n", "u", "u_low", "u_high")
    scale = alt.Scale(domain=[40, 100], nice=False, clamp=True)
    x = alt.X("at:Q", title="level of the region (%)", scale=scale, axis=alt.Axis(values=[*LEVELS.values()]))
    y = alt.Y("u:Q", title="errors inside (%)", scale=alt.Scale(domain=[0, 100], nice=False))
    return _covariance_panel(columns, x, y, colours, "coverage", _dashed((40, 40), (100, 100), x, y))


def _nees_panel(data: ReportData, nees: pl.DataFrame, colours: Mapping[str, str]) -> Panel:
    columns = nees.sort("line", "at").select("line", "at", "n", "u", "u_low", "u_high")
    x = marks.along(columns["at"], title=data.axis.title, from_zero=data.axis is AGE)
    values = pl.concat([columns["u"], pl.Series([1.0])])
    domain = [cast(float, values.min()) / 2.0, cast(float, values.max()) * 2.0]
    y = alt.Y("u:Q", title="NEES", scale=alt.Scale(type="log", domain=domain, nice=False, clamp=True))
    first, last = columns["at"].min(), columns["at"].max()
    return _covariance_panel(columns, x, y, colours, "NEES", _dashed((first, 1.0), (last, 1.0), x, y))


def _covariance_panel(
    columns: pl.DataFrame, x: alt.X, y: alt.Y, colours: Mapping[str, str], title: str, right: alt.Chart
) -> Panel:
    tips = [alt.Tooltip("line:N", title="tracker"), alt.Tooltip("at:Q"), alt.Tooltip("n:Q", title="errors"),
            alt.Tooltip("u:Q", title=title)]  # fmt: skip
    hue = marks.colour("line", colours, "tracker")
    return curves(columns, "line", "u", x, y, colours, tips, title=title, hue=hue, below=[right], **_LOOKS)


FIGURES: Sections = {"estimator": (window_sigma_figures, depth_interval_figures, covariance_figures, model_fit_figures)}
"""What this module draws, by the section of the report."""
