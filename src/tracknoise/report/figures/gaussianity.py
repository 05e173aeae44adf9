"""The shape of the error distribution, compared with a Gaussian of the same covariance."""

from collections.abc import Mapping, Sequence
from typing import Any

import altair as alt
import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_estimate
from tracknoise.findings.wording import DASH, SPACE, listing, number
from tracknoise.report import style
from tracknoise.report.axis import AGE, NU
from tracknoise.report.cells import Cells
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import Shape

_TITLE = "Error quantiles compared with a Gaussian"
_SIZE = {"width": 385, "height": 260}
_TRIMMINGS = ("untrimmed", "trimmed")
_SHAPES = {
    "Gaussian": "close to Gaussian",
    "contaminated": "contaminated by a wider Gaussian",
    "undecided": "of undecided shape",
}
"""How a sentence states a verdict, where its name is not enough."""


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: one row per tracker, before and after trimming, one colour per band of ages."""
    radii = data.nominal(data.radii).with_columns(band=_band(data))
    if radii.is_empty():
        return [Absence("gaussianity", _TITLE, "No condition has enough errors to judge their distribution.")]
    shown = _trimmings(data)
    panels = [
        _panel(data, radii.filter(tracker=tracker, trimming=trimming), tracker, trimming)
        for tracker in data.trackers
        for trimming in shown
        if radii.filter(tracker=tracker).height
    ]
    figure = Figure(
        id="gaussianity",
        title=_TITLE,
        shows="Quantiles of the Mahalanobis distance of errors from their mean, against those of a Gaussian of the "
        f"same covariance, at speed {data.slowest}{data.where}. Each band of "
        f"{'ages' if data.axis is AGE else 'distances from the key frame'} has its own colour. Both axes are "
        "logarithmic. On the grey line the two are equal.",
        look_for=_look_for(data),
        spec=arranged(panels, columns=len(shown), independent=["color"]),
        message=_message(data),
    )
    return [figure]


def _message(data: ReportData) -> str:
    """Trackers whose errors have heavy tails in every band; whether all are close to Gaussian."""
    rows = _ordered(data).filter(trimming=data.trimming)
    heavy = pl.col("verdict").is_in([Shape.heavy_tailed, Shape.contaminated])
    judged = rows.group_by("tracker", maintain_order=True)
    found = judged.agg(heavy=heavy.all(), gaussian=(pl.col("verdict") == Shape.gaussian).all())
    if found.height and found["gaussian"].all():
        return "Errors are close to Gaussian"
    names = found.filter("heavy")["tracker"].to_list()
    return f"Errors of {listing(names)} have heavier tails than a Gaussian" if names else ""


def tables(data: ReportData) -> Sequence[Cells]:
    """Shape and tails at the lowest speed: one row per tracker, band of ages and trimming."""
    rows = [_row(row) for row in _ordered(data).to_dicts()]
    headings = ["tracker", data.axis.distance, "trimming", "n", "skewness", "kurtosis", "P(99 %)", "P(99.9 %)"]
    headings += ["gain of Student-t (nat)", "gain of mixture (nat)", f"{NU} of Student-t", "verdict"]
    caption = f"Error distribution at speed {data.slowest}{data.where}"
    numeric = [False, False, False, *[True] * 8, False]
    return [Cells(caption, headings, rows, numeric)] if rows else []


def _row(row: Mapping[str, Any]) -> list[str]:
    estimates = [
        _estimate_text(row, "kurtosis", "kurtosis"),
        *(DASH if row[name] is None else number(row[name]) for name in ("tail_99", "tail_999")),
        _estimate_text(row, "gain_student_nats", "gain_student"),
        _estimate_text(row, "gain_mixture_nats", "gain_mixture"),
        number(row["student_nu"]),
    ]
    why = f": {row['why']}" if row["verdict"] == "undecided" and row["why"] else ""
    asked = [
        row["tracker"],
        row["band"].replace(" ", SPACE),
        row["trimming"],
        number(row["n"]),
        number(row["skewness"]),
    ]
    return [*asked, *estimates, row["verdict"] + why]


def _estimate_text(row: Mapping[str, Any], name: str, bounds: str) -> str:
    if row[name] is None:
        return DASH
    return format_estimate(Estimate.of_row(row, name, f"{bounds}_low", f"{bounds}_high"))


def _ordered(data: ReportData) -> pl.DataFrame:
    table = data.nominal(data.gaussianity).filter(pl.col("trimming").is_in(_trimmings(data)))
    order = {name: place for place, name in enumerate(data.trackers)}
    place = pl.col("tracker").replace_strict(order, return_dtype=pl.Int64, default=len(order))
    return table.with_columns(band=_band(data)).sort(place, "age_low", "trimming")


def _trimmings(data: ReportData) -> Sequence[str]:
    """Before trimming, and after it if it dropped any track."""
    return _TRIMMINGS[:1] if data.percentile is None else _TRIMMINGS


def _band(data: ReportData) -> pl.Expr:
    """Band of ages, or of distances, in words."""
    low, high = pl.col("age_low").cast(pl.String), pl.col("age_high").cast(pl.String)
    return pl.when(high.is_null()).then(low + " or more").otherwise(low + " to " + high)


def _panel(data: ReportData, radii: pl.DataFrame, tracker: str, trimming: str) -> Panel:
    """Observed against expected quantiles of one tracker, with the diagonal."""
    known = radii.filter((pl.col("expected") > 0) & (pl.col("observed") > 0)).sort("age_low", "probability")
    names = known.sort("age_low")["band"].unique(maintain_order=True).to_list()
    hues = dict(zip(names, style.levels(data.colour[tracker], len(names)), strict=False))
    x = alt.X("expected:Q", title="expected for a Gaussian", scale=_logarithmic(known["expected"]))
    y = alt.Y("observed:Q", title="observed", scale=_logarithmic(pl.concat([known["expected"], known["observed"]])))
    tips = [
        alt.Tooltip("band:N"),
        alt.Tooltip("probability:Q", format=".4~g"),
        alt.Tooltip("expected:Q"),
        alt.Tooltip("observed:Q"),
    ]
    table = known.select("band", "probability", "expected", "observed")
    base = alt.Chart(marks.rows(table)).encode(
        x=x,
        y=y,
        color=marks.colour("band", hues, "age" if data.axis is AGE else "distance"),
        opacity=marks.opacity("band"),
        tooltip=tips,
    )
    same = alt.Chart(marks.rows(known.select("expected"))).mark_line(color="#9aa5b1", strokeWidth=1)
    chart = layered(base.mark_line(point=True), same.encode(x=x, y=marks.on(y, "expected")))
    return Panel(chart.properties(title=f"{tracker}, {trimming}", **_SIZE), (marks.shown("band", hues),))


def _logarithmic(values: pl.Series) -> alt.Scale:
    """Scale that includes all values with some margin."""
    low, high = (float(values.min()), float(values.max())) if values.len() else (1.0, 1.0)  # type: ignore[arg-type]
    return alt.Scale(type="log", domain=[low / 1.2, high * 1.2], nice=False)


def _look_for(data: ReportData) -> str:
    rows = _ordered(data)
    parts = []
    for tracker in data.trackers:
        own = rows.filter(tracker=tracker, trimming="untrimmed")
        verdicts = [_sentence(data, bands) for _, bands in own.group_by("verdict", maintain_order=True)]
        parts += [f"Before trimming, errors of {tracker} are {listing(verdicts)}. "] if verdicts else []
    numbers = "".join(parts)
    return (
        f"{numbers}Dots above the grey line on the right show tails heavier than those of a Gaussian. An estimator "
        "that assumes Gaussian errors gives such observations too much weight. Trimming moves dots below the line."
    )


def _sentence(data: ReportData, bands: pl.DataFrame) -> str:
    """Bands of one verdict."""
    tails = bands["tail_99"].drop_nulls()
    ends = (
        list(dict.fromkeys(number(end) for end in (tails.to_numpy().min(), tails.to_numpy().max())))
        if tails.len()
        else []
    )
    tail = f" ({' to '.join(ends)} times the share of a Gaussian beyond the 99{SPACE}% ellipse)" if ends else ""
    what = "ages" if data.axis is AGE else "distances"
    verdict = bands["verdict"][0]
    return f"{_SHAPES.get(verdict, verdict)} at {what} {listing(bands['band'])}{tail}"
