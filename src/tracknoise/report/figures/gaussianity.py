"""Are errors Gaussian: how far out they lie, beside how far a Gaussian of the same covariance would."""

from collections.abc import Mapping, Sequence
from typing import Any

import altair as alt
import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_estimate
from tracknoise.findings.wording import DASH, SHAPES, SPACE, number
from tracknoise.report import style
from tracknoise.report.axis import AGE
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.figures.layout import Panel, arranged
from tracknoise.report.sentences import NU, listing
from tracknoise.report.tables import Cells

_TITLE = "Gaussian?"
_SIZE = {"width": 385, "height": 260}
_TRIMMINGS = ("untrimmed", "trimmed")


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """One figure: a row a tracker, all tracks beside those that trimming kept, a colour a band of ages."""
    radii = evidence.nominal(evidence.radii).with_columns(band=_band(evidence))
    if radii.is_empty():
        return [Absence("gaussianity", _TITLE, "No condition has enough single errors to see of what shape they are.")]
    shown = _trimmings(evidence)
    panels = [
        _panel(evidence, radii.filter(tracker=tracker, trimming=trimming), tracker, trimming)
        for tracker in evidence.trackers
        for trimming in shown
        if radii.filter(tracker=tracker).height
    ]
    figure = Figure(
        id="gaussianity",
        title="How far out errors lie",
        shows="Quantiles of the distance of errors from their mean, in units of their own spread (Mahalanobis), "
        f"against those of a Gaussian of the same covariance, at speed {evidence.slowest}{evidence.where}, a colour a "
        f"band of {'ages' if evidence.axis is AGE else 'distances from the key frame'}; both axes logarithmic, grey: "
        "where the two are the same.",
        look_for=_look_for(evidence),
        spec=arranged(panels, columns=len(shown), independent=["color"]),
    )
    return [figure]


def tables(evidence: Evidence) -> Sequence[Cells]:
    """Shape and tails, a row a tracker, band of ages and trimming, at the lowest speed."""
    rows = [_row(row) for row in _ordered(evidence).to_dicts()]
    headings = ["tracker", evidence.axis.distance, "", "n", "skewness", "kurtosis", "P(99 %)", "P(99.9 %)"]
    headings += ["Student-t gains (nat)", "mixture gains (nat)", f"{NU} of Student-t", "verdict"]
    caption = (
        f"Shape of errors at speed {evidence.slowest}{evidence.where}: a Gaussian has skewness 0, kurtosis 8, and "
        "shares beyond its ellipses 1 times its own"
    )
    numeric = [False, False, False, *[True] * 8, False]
    return [Cells(caption, headings, rows, numeric)] if rows else []


def _row(row: Mapping[str, Any]) -> list[str]:
    estimates = [
        _told(row, "kurtosis", "kurtosis"),
        *(DASH if row[name] is None else number(row[name]) for name in ("tail_99", "tail_999")),
        _told(row, "gain_student_nats", "gain_student"),
        _told(row, "gain_mixture_nats", "gain_mixture"),
        number(row["student_nu"]),
    ]
    why = f": {row['why']}" if row["verdict"] == "undecided" and row["why"] else ""
    asked = [row["tracker"], row["band"], row["trimming"], number(row["n"]), number(row["skewness"])]
    return [*asked, *estimates, SHAPES[row["verdict"]] + why]


def _told(row: Mapping[str, Any], name: str, bounds: str) -> str:
    if row[name] is None:
        return DASH
    return format_estimate(Estimate.of_row(row, name, f"{bounds}_low", f"{bounds}_high"))


def _ordered(evidence: Evidence) -> pl.DataFrame:
    table = evidence.nominal(evidence.gaussianity).filter(pl.col("trimming").is_in(_trimmings(evidence)))
    order = {name: place for place, name in enumerate(evidence.trackers)}
    place = pl.col("tracker").replace_strict(order, return_dtype=pl.Int64, default=len(order))
    return table.with_columns(band=_band(evidence)).sort(place, "age_low", "trimming")


def _trimmings(evidence: Evidence) -> Sequence[str]:
    """All tracks, and those that trimming kept if it dropped any."""
    return _TRIMMINGS[:1] if evidence.percentile is None else _TRIMMINGS


def _band(evidence: Evidence) -> pl.Expr:
    """Band of ages, or of distances, in words."""
    low, high = pl.col("age_low").cast(pl.String), pl.col("age_high").cast(pl.String)
    return pl.when(high.is_null()).then(low + " or more").otherwise(low + " to " + high)


def _panel(evidence: Evidence, radii: pl.DataFrame, tracker: str, trimming: str) -> Panel:
    """Observed against expected quantiles of one tracker, with the diagonal."""
    known = radii.filter((pl.col("expected") > 0) & (pl.col("observed") > 0)).sort("age_low", "probability")
    names = known.sort("age_low")["band"].unique(maintain_order=True).to_list()
    hues = dict(zip(names, style.shades(evidence.colour[tracker], max(1, len(names))), strict=False))
    x = alt.X("expected:Q", title="expected of a Gaussian", scale=_logarithmic(known["expected"]))
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
        color=marks.colour("band", hues, "age" if evidence.axis is AGE else "distance"),
        opacity=marks.opacity("band"),
        tooltip=tips,
    )
    same = alt.Chart(marks.rows(known.select("expected"))).mark_line(color="#9aa5b1", strokeWidth=1)
    chart = alt.layer(base.mark_line(point=True), same.encode(x=x, y=marks.on(y, "expected")))
    return Panel(chart.properties(title=f"{tracker}, {trimming}", **_SIZE), (marks.shown("band", hues),))


def _logarithmic(values: pl.Series) -> alt.Scale:
    """Scale that holds all values with a little room."""
    low, high = (float(values.min()), float(values.max())) if values.len() else (1.0, 1.0)  # type: ignore[arg-type]
    return alt.Scale(type="log", domain=[low / 1.2, high * 1.2], nice=False)


def _look_for(evidence: Evidence) -> str:
    rows = _ordered(evidence)
    parts = []
    for tracker in evidence.trackers:
        own = rows.filter(tracker=tracker, trimming="untrimmed")
        told_ = [_sentence(evidence, bands) for _, bands in own.group_by("verdict", maintain_order=True)]
        parts += [f"errors of {tracker} are {listing(told_)}"] if told_ else []
    numbers = f"Before trimming, {'; '.join(parts)}. " if parts else ""
    return (
        f"{numbers}Dots that climb above the grey line on the right are tails heavier than a Gaussian's; an estimator "
        "that takes errors for Gaussian gives these observations too much weight. Dots below it are what trimming "
        "leaves."
    )


def _sentence(evidence: Evidence, bands: pl.DataFrame) -> str:
    """Bands of one verdict."""
    tails = bands["tail_99"].drop_nulls()
    ends = (
        list(dict.fromkeys(number(end) for end in (tails.to_numpy().min(), tails.to_numpy().max())))
        if tails.len()
        else []
    )
    tail = f" ({' to '.join(ends)} times a Gaussian's share beyond its 99{SPACE}% ellipse)" if ends else ""
    what = "ages" if evidence.axis is AGE else "distances"
    return f"{SHAPES[bands['verdict'][0]]} at {what} {listing(bands['band'])}{tail}"


FAMILY = Family(
    id="gaussianity",
    title=_TITLE,
    lead="Most estimators take errors for Gaussian. Whether they are is a matter of shape, whatever their size: of how "
    "often an error lies far out for its kind.",
    figures=figures,
    tables=tables,
)
