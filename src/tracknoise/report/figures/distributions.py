"""Distributions of errors: their shape, and the largest error of every track.

- The largest error of every track before trimming, the threshold of trimming, and the dropped tracks of one scene.
- The shape of the error distribution, compared with a Gaussian of the same covariance.
"""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import altair as alt
import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.report import style
from tracknoise.report.cells import Cells
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure, Sections, SectionTables
from tracknoise.report.figures.frames import TrimmedFrame, trimmed_frame
from tracknoise.report.figures.messages import values
from tracknoise.report.figures.panels import Panel, Spec, arranged, layered
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import Shape
from tracknoise.topics.bands import AGE, FRAME
from tracknoise.words import DASH, SPACE, count, format_estimate, listing, number, percent, px

_TRIMMING_TITLE = "Errors before trimming"
_FRAME_EXPLAINED = (
    " The images show the features of one scene at the lowest speed. Lines connect dropped features with their true "
    "positions."
)
_DECADES = alt.Axis(values=[10.0**power for power in range(-3, 4)], format="~g")


def trimming_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One histogram per tracker, with one line per speed, and the image of one scene beside it."""
    table = data.reference(data["errors"])
    if not table["n"].sum():
        return [Absence("trimming", _TRIMMING_TITLE, "No track has a known true position, so there are no errors.")]
    trackers = [name for name in data.trackers if table.filter(tracker=name)["n"].sum()]
    frame = trimmed_frame(data)
    figure = Figure(
        id="trimming",
        title=_TRIMMING_TITLE,
        shows=f"{_shows(data, table)}{'' if frame is None else _FRAME_EXPLAINED}",
        look_for=_look_for_trimming(data, trackers),
        spec=_chart(data, trackers, table, frame),
        message=_trimming_message(data, trackers),
    )
    return [figure]


def _trimming_message(data: ReportData, trackers: Sequence[str]) -> str:
    """Median threshold of each tracker at the lowest speed; empty where nothing was trimmed."""
    cuts = {name: data.cuts(name).filter(speed=data.slowest)["cut"].to_list() for name in trackers}
    return values({name: px(cut[0]) for name, cut in cuts.items() if cut}, "Trimming drops tracks with errors above")


def _chart(data: ReportData, trackers: Sequence[str], table: pl.DataFrame, frame: TrimmedFrame | None) -> Spec:
    width = 385 if len(trackers) > 1 or data.percentile is not None else 700
    histograms = [_trimming_panel(data, tracker, table, width=width) for tracker in trackers]
    if frame is None:
        return arranged(histograms, columns=2, independent=["color"])
    rows = zip(histograms, map(frame.panel, trackers), strict=True)
    return frame.shown_in(arranged(list(chain.from_iterable(rows)), columns=2, independent=["color"]))


def _shows(data: ReportData, table: pl.DataFrame) -> str:
    return (
        f"Distribution of the largest error of each track{data.where}. The error is the distance between observed and "
        f"true position. Both axes are logarithmic. The leftmost bin contains all errors below {_first_bound(table)}. "
        f"{_cut_explained(data)}"
    )


def _first_bound(table: pl.DataFrame) -> str:
    return f"{table.filter(bin_low_px=0.0)['bin_high_px'][0]:g}{SPACE}px"


def _cut_explained(data: ReportData) -> str:
    if data.percentile is None:
        return "Nothing was trimmed in this run."
    return (
        f"Dashed lines mark the threshold of trimming. It is the {number(int(data.percentile))}th percentile in each "
        "scene. The line shows the median over scenes."
    )


def _look_for_trimming(data: ReportData, trackers: Sequence[str]) -> str:
    parts = [_sentences(data, tracker) for tracker in trackers]
    return (
        f"At speed {data.slowest}, {' '.join(parts)} "
        "A second peak on the right is a group of tracks that follow the wrong point."
    )


def _sentences(data: ReportData, tracker: str) -> str:
    lived = data.nominal(data["lifetimes"]).filter(tracker=tracker)
    total, once = (_tracks(lived), _tracks(lived.filter(lifetime=1)))
    trims = data.nominal(data["trims"]).filter(tracker=tracker)
    dropped, measured = int(trims["n_dropped"].sum()), int(trims["n_measured"].sum())
    counted = f"{tracker} has {count(total, 'track')}. "
    counted += (
        f"{number(measured)} of them are alive in the key frame and have a known error."
        if data.axis is FRAME
        else f"{number(once)} of them were seen only in their first frame, where the error is zero."
    )
    cuts = trims["threshold_px"].drop_nulls().sort().to_list()
    if data.percentile is None or not cuts:
        return counted
    low, high = px(cuts[0]), px(cuts[-1])
    where = low if low == high else f"between {low} and {high}, depending on the scene"
    share = percent(dropped / measured)
    return f"{counted} The threshold is {where}. Trimming drops {share} of the tracks with a known error."


def _tracks(lifetimes: pl.DataFrame) -> int:
    return int(lifetimes["n_ended"].sum()) + int(lifetimes["n_censored"].sum())


def _trimming_panel(data: ReportData, tracker: str, errors: pl.DataFrame, *, width: int) -> Panel:
    bins = errors.filter(tracker=tracker).with_columns(speed=pl.col("speed").cast(pl.String))
    hue = marks.colour("speed", data.speed_colours(tracker), "speed", legend=len(data.speeds) > 1)
    title = alt.Title(tracker, color=data.colour[tracker])
    chart = layered(_histogram(bins, hue), _cuts(data, tracker, hue))
    chart = chart.properties(width=width, height=230, title=title)
    return Panel(chart, (marks.shown("speed", data.speed_colours(tracker)),))


def _histogram(bins: pl.DataFrame, hue: alt.Color) -> alt.Chart:
    """Steps from bin to bin. The first and the last bin are infinite and are drawn a tenth of a decade wide."""
    tenth = 10**0.1
    low = pl.when(pl.col("bin_low_px") > 0).then("bin_low_px").otherwise(pl.col("bin_high_px") / tenth)
    last = bins.filter(pl.col("n") > 0)["bin_high_px"].fill_null(float("inf")).max()
    table = bins.filter(pl.col("bin_low_px") <= last).select(
        "tracker", "speed", "n", marks.drawn_count(pl.col("n")), low=low, to="bin_high_px", of="bin_low_px"
    )
    x = alt.X("low:Q", scale=alt.Scale(type="log", nice=False), title="largest error of the track (px)", axis=_DECADES)
    tips = [
        alt.Tooltip("speed:N"),
        alt.Tooltip("of:Q", title="from (px)"),
        alt.Tooltip("to:Q", title="to (px)"),
        alt.Tooltip("n:Q", title="tracks"),
    ]
    y = marks.log_count("tracks (count)", table["drawn"])
    chart = alt.Chart(marks.rows(table)).mark_line(interpolate="step-after")
    encoded: alt.Chart = chart.encode(x=x, y=y, color=hue, opacity=marks.opacity("speed"), tooltip=tips)
    return encoded


def _cuts(data: ReportData, tracker: str, hue: alt.Color) -> alt.Chart:
    """A line at the threshold of each speed. One at 0 px is left out, because the axis is logarithmic."""
    table = data.cuts(tracker).filter(pl.col("cut") > 0).with_columns(pl.col("speed").cast(pl.String))
    tips = [alt.Tooltip("speed:N"), alt.Tooltip("cut:Q", title="threshold (px)")]
    chart = alt.Chart(marks.rows(table)).mark_rule(strokeDash=[5, 3], strokeWidth=1.5, color=style.INK)
    encoded: alt.Chart = chart.encode(x=alt.X("cut:Q"), color=hue, opacity=marks.opacity("speed"), tooltip=tips)
    return encoded


_GAUSSIANITY_TITLE = "Error quantiles compared with a Gaussian"
_SIZE = {"width": 385, "height": 260}
_SHAPES = {
    "Gaussian": "close to Gaussian",
    "contaminated": "contaminated by a wider Gaussian",
    "undecided": "of undecided shape",
}
"""How a sentence states a verdict, where its name is not enough."""


def gaussianity_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: one row per tracker, before and after trimming, one colour per band of ages."""
    radii = data.nominal(data["radii"]).with_columns(band=_band(data))
    if radii.is_empty():
        return [
            Absence("gaussianity", _GAUSSIANITY_TITLE, "No condition has enough errors to judge their distribution.")
        ]
    shown = data.trimmings
    panels = [
        _gaussianity_panel(data, radii.filter(tracker=tracker, trimming=trimming), tracker, trimming)
        for tracker in data.trackers
        for trimming in shown
        if radii.filter(tracker=tracker).height
    ]
    figure = Figure(
        id="gaussianity",
        title=_GAUSSIANITY_TITLE,
        shows="Quantiles of the Mahalanobis distance of errors from their mean, against those of a Gaussian of the "
        f"same covariance, at speed {data.slowest}{data.where}. Each band of "
        f"{'ages' if data.axis is AGE else 'distances from the key frame'} has its own colour. Both axes are "
        "logarithmic. On the grey line the two are equal.",
        look_for=_look_for_gaussianity(data),
        spec=arranged(panels, columns=len(shown), independent=["color"]),
        message=_gaussianity_message(data),
    )
    return [figure]


def _gaussianity_message(data: ReportData) -> str:
    """Trackers whose errors have heavy tails in every band; whether all are close to Gaussian."""
    rows = _ordered(data).filter(trimming=data.trimming)
    heavy = pl.col("verdict").is_in([Shape.heavy_tailed, Shape.contaminated])
    judged = rows.group_by("tracker", maintain_order=True)
    shapes = judged.agg(heavy=heavy.all(), gaussian=(pl.col("verdict") == Shape.gaussian).all())
    if shapes.height and shapes["gaussian"].all():
        return "Errors are close to Gaussian"
    names = shapes.filter("heavy")["tracker"].to_list()
    return f"Errors of {listing(names)} have heavier tails than a Gaussian" if names else ""


def tables(data: ReportData) -> Sequence[Cells]:
    """Shape and tails at the lowest speed: one row per tracker, band of ages and trimming."""
    rows = [_row(row) for row in _ordered(data).to_dicts()]
    headings = ["tracker", data.axis.distance, "trimming", "n", "skewness", "kurtosis", "P(99 %)", "P(99.9 %)"]
    headings += ["gain of Student-t (nat)", "gain of mixture (nat)", "degrees of freedom of Student-t", "verdict"]
    caption = f"Error distribution at speed {data.slowest}{data.where}, all scenes pooled"
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
    opening_cells = [
        row["tracker"],
        row["band"].replace(" ", SPACE),
        row["trimming"],
        number(row["n"]),
        number(row["skewness"]),
    ]
    return [*opening_cells, *estimates, row["verdict"] + why]


def _estimate_text(row: Mapping[str, Any], name: str, bounds: str) -> str:
    if row[name] is None:
        return DASH
    return format_estimate(Estimate.of_row(row, name, f"{bounds}_low", f"{bounds}_high"))


def _ordered(data: ReportData) -> pl.DataFrame:
    table = data.nominal(data["gaussianity"]).filter(pl.col("trimming").is_in(data.trimmings))
    return table.with_columns(band=_band(data)).sort(data.tracker_place, "age_low", "trimming")


def _band(data: ReportData) -> pl.Expr:
    """Band of ages, or of distances, in words."""
    low, high = pl.col("age_low").cast(pl.String), pl.col("age_high").cast(pl.String)
    return pl.when(high.is_null()).then(low + " or more").otherwise(low + " to " + high)


def _gaussianity_panel(data: ReportData, radii: pl.DataFrame, tracker: str, trimming: str) -> Panel:
    """Observed against expected quantiles of one tracker, with the diagonal."""
    rows = radii.filter((pl.col("expected") > 0) & (pl.col("observed") > 0)).sort("age_low", "probability")
    names = rows.sort("age_low")["band"].unique(maintain_order=True).to_list()
    hues = dict(zip(names, style.levels(data.colour[tracker], len(names)), strict=False))
    x = alt.X("expected:Q", title="expected for a Gaussian", scale=_logarithmic(rows["expected"]))
    y = alt.Y("observed:Q", title="observed", scale=_logarithmic(pl.concat([rows["expected"], rows["observed"]])))
    tips = [
        alt.Tooltip("band:N"),
        alt.Tooltip("probability:Q", format=".4~g"),
        alt.Tooltip("expected:Q"),
        alt.Tooltip("observed:Q"),
    ]
    table = rows.select("band", "probability", "expected", "observed")
    base = alt.Chart(marks.rows(table)).encode(
        x=x,
        y=y,
        color=marks.colour("band", hues, "age" if data.axis is AGE else "distance"),
        opacity=marks.opacity("band"),
        tooltip=tips,
    )
    diagonal = alt.Chart(marks.rows(rows.select("expected"))).mark_line(color="#9aa5b1", strokeWidth=1)
    chart = layered(base.mark_line(point=True), diagonal.encode(x=x, y=marks.on(y, "expected")))
    return Panel(chart.properties(title=f"{tracker}, {trimming}", **_SIZE), (marks.shown("band", hues),))


def _logarithmic(values: pl.Series) -> alt.Scale:
    """Scale that includes all values with some margin."""
    low, high = (float(values.min()), float(values.max())) if values.len() else (1.0, 1.0)  # type: ignore[arg-type]
    return alt.Scale(type="log", domain=[low / 1.2, high * 1.2], nice=False)


def _look_for_gaussianity(data: ReportData) -> str:
    rows = _ordered(data)
    parts = []
    for tracker in data.trackers:
        untrimmed = rows.filter(tracker=tracker, trimming="untrimmed")
        verdicts = [_sentence(data, bands) for _, bands in untrimmed.group_by("verdict", maintain_order=True)]
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
    noun = "ages" if data.axis is AGE else "distances"
    verdict = bands["verdict"][0]
    return f"{_SHAPES.get(verdict, verdict)} at {noun} {listing(bands['band'])}{tail}"


FIGURES: Sections = {"gaussianity": (gaussianity_figures,), "trimming": (trimming_figures,)}
"""What this module draws, by the section of the report."""
TABLES: SectionTables = {"gaussianity": tables}
"""Tables below the figures of a section."""
