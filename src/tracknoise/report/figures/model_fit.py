"""The noise models of a run over the errors that they were fitted to."""

from collections.abc import Mapping, Sequence

import altair as alt
import polars as pl

from tracknoise.findings.sampling.groups_of_scenes import groups_of_run
from tracknoise.findings.wording import SPACE, number
from tracknoise.noise_models.fitted_curve import fitted_curve
from tracknoise.noise_models.noise_model import NoiseModel
from tracknoise.noise_models.run_models import run_models
from tracknoise.report import style
from tracknoise.report.bands import describe_intervals
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.report_data import ReportData

_ID, _TITLE = "model-fit", "The noise model over the errors that it was fitted to"
_COLOURS = dict(zip(("measured", "model"), style.PALETTE[:2], strict=True))
_PARTS = {"first": "first position", "white": "each frame", "walk": "walk", "drift": "drift"}
_UNITS = {"first": "px", "white": "px", "walk": "px per √frame", "drift": "px per frame"}


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: a panel per tracker at the lowest speed."""
    models = run_models(data.run).models
    if not models:
        return [Absence(_ID, _TITLE, "This run has no noise model.")]
    curves = _curves(data, models)
    panels = [_panel(tracker, curve) for tracker, curve in curves.items()]
    table = pl.concat(list(curves.values()))
    bounded = table.drop_nulls(["low", "high"]).rename({"n_scenes": "n_resampled"})
    shows = (
        f"Root mean square of a coordinate of the errors about the first position at speed {data.slowest}, by age, all "
        "views together. Errors beyond the limit of the model are left out. The line of the model is that of its "
        f"components, at the magnifications of these tracks. {describe_intervals(bounded, of='the measured errors')}"
    )
    look_for = " ".join([*(_sentence(tracker, models[tracker], curve) for tracker, curve in curves.items()), _ADVICE])
    spec = arranged(panels, columns=2, independent=["fill"])
    return [Figure(_ID, _TITLE, shows, look_for, spec, _message(curves))]


def _message(curves: Mapping[str, pl.DataFrame]) -> str:
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


_ADVICE = "Where the line leaves the band, one set of components does not describe tracks of all ages."


def _curves(data: ReportData, models: Mapping[str, NoiseModel]) -> dict[str, pl.DataFrame]:
    """Measured and modelled errors of each tracker. The sums of all trackers are read together."""
    own = pl.col("tracker").is_in(list(models)) & (pl.col("speed") == data.slowest) & (pl.col("product") == "error")
    sums = pl.concat([table.filter(own) for table in data.run.stored_tables("noise_sums")])
    groups = groups_of_run(data.run)
    return {
        tracker: fitted_curve(sums.filter(tracker=tracker), model.components, groups=groups)
        for tracker, model in models.items()
    }


def _sentence(tracker: str, model: NoiseModel, curve: pl.DataFrame) -> str:
    """Components of the model, and how far it is off."""
    kept = {name: getattr(model, name).sigma.value for name in _PARTS if getattr(model, name).why_dropped is None}
    stated = ", ".join(f"{_PARTS[name]} {number(value)}{SPACE}{_UNITS[name]}" for name, value in kept.items())
    known = curve.drop_nulls(["measured", "modelled"]).filter(pl.col("measured") > 0.0)
    if known.is_empty():
        return f"{tracker}: {stated}."
    off = (known["modelled"] / known["measured"] - 1.0).abs().max()
    return f"{tracker}: {stated}; at most {100.0 * float(off):.0f}{SPACE}% from the measured errors."  # type: ignore[arg-type]


def _panel(tracker: str, curve: pl.DataFrame) -> Panel:
    columns = curve.select(line=pl.lit("measured"), at="age", n="n", u="measured", u_low="low", u_high="high")
    modelled = curve.select(line=pl.lit("model"), at="age", u="modelled")
    x = marks.along(curve["age"], title="age (frames)", from_zero=True)
    shown = pl.concat([columns["u"], modelled["u"]])
    y = alt.Y("u:Q", title="error (px)", scale=alt.Scale(domain=marks.holding(shown, columns["u_high"]), nice=False))
    hue = marks.colour("line", _COLOURS, "errors")
    tips = [alt.Tooltip("at:Q", title="age"), alt.Tooltip("n:Q", title="errors"), alt.Tooltip("u:Q", title="px")]
    points = alt.Chart(marks.rows(columns.select("line", "at", "n", "u"))).mark_point(filled=True, size=22)
    measured = points.encode(x=x, y=y, color=hue, opacity=marks.opacity("line"), tooltip=tips)
    drawn = alt.Chart(marks.rows(modelled)).mark_line()
    line = drawn.encode(x=x, y=y, color=hue, opacity=marks.opacity("line"))
    band = marks.band(columns, "line", _COLOURS, "u", x, y)
    chart = layered(*band, measured, line).properties(width=395, height=210, title=alt.Title(tracker))
    return Panel(chart, (marks.shown("line", _COLOURS),), layer=len(band))
