"""The first section of the report: the findings in sentences, and the verdicts for every tracker and speed."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.analysis.zero_mean import verdict_at
from tracknoise.inference.estimates import Estimate
from tracknoise.report.cells import Cells
from tracknoise.report.report_data import ReportData
from tracknoise.topics.growth_topic import growth_ratio, kind_of_growth
from tracknoise.topics.headline import ReportedConditions, scalar_estimate, size_estimate
from tracknoise.topics.measures import SIZES, first, reported_conditions
from tracknoise.words import DASH, SELF_REFERENTIAL, SPACE, chance, format_estimate, number, rms_of_tracks

_METRICS = {
    "delta_avg": "position accuracy",
    "delta_avg_reported": "accuracy of positions reported as visible",
    "average_jaccard": "average Jaccard",
    "occlusion_accuracy": "occlusion accuracy",
    "expected_feature_age": "expected feature age",
}
NOTHING = "Findings were not computed for this run. `tracknoise run` computes them."
_ZERO = {"yes": "no", "no": "yes", "undecided": "undecided"}
"""Whether the mean error is zero, by the verdict on whether it differs from zero."""


def sentences(data: ReportData) -> list[dict[str, Any]]:
    """Rows of the findings by rank. `file` is the name of the table file that holds their numbers."""
    return [{**row, "file": row["table"].replace("_", "-")} for row in data["findings"].sort("rank").to_dicts()]


def verdicts(data: ReportData) -> Cells:
    """One row per tracker and speed, in the view shown in the figures: size of errors, and verdicts."""
    axis, dropped = data.axis, data.percentile is not None
    headings = ["tracker", "speed", f"at {axis.name}", "u", "v", "u", "v", "is zero?"]
    shapes = (
        [str(trimming) for trimming in reported_conditions(data, data.slowest).trimmings] if dropped else ["errors"]
    )
    headings += [*shapes, "in u", "in v", "outliers", "median lifetime"]
    groups = [
        ("", 3),
        ("core (px)", 2),
        (f"{rms_of_tracks(data.trimming)} (px)", 2),
        ("mean", 1),
        ("Gaussian?", len(shapes)),
        ("growth", 2),
        ("", 2),
    ]
    rows = [_row(data, tracker, speed) for tracker in data.trackers for speed in data.speeds]
    errors_text = f"Errors are {data.trimming} unless the heading says otherwise. " if dropped else ""
    combined = f"Core: of a typical scene. Whether the mean is zero: at this {axis.name} alone, u and v together."
    lifetimes = "Median lifetimes are Kaplan-Meier estimates in whole frames."
    caption = f"Verdicts{data.where}. {errors_text}{combined} {lifetimes}"
    shown = [row for row in rows if row]
    return Cells(caption, headings, shown, [False, True, True, *[False] * (len(headings) - 3)], groups)


def fitted_noise(data: ReportData) -> Cells | None:
    """Noise by length of the track where true positions are fitted to the tracks; None where they are not."""
    rows = data.reference(data["triangulated_noise"]).filter(trimming=data.trimming)
    if rows.is_empty():
        return None
    shown = [
        [
            str(row["tracker"]),
            str(row["speed"]),
            str(row["measure"]),
            _lengths(row["length_low"], row["length_high"]),
            str(row["coordinate"]),
            number(row["n"]),
            _px(Estimate.of_row(row, "sigma_px", "low", "high", "px")),
        ]
        for row in rows.to_dicts()
    ]
    headings = ["tracker", "speed", "from", "observations per track", "coordinate", "observations", "sigma (px)"]
    caption = f"Noise of one coordinate{data.where}, corrected for the fit. {SELF_REFERENTIAL}"
    return Cells(caption, headings, shown, [False, True, False, True, False, True, True])


def point_tracking(data: ReportData) -> Cells | None:
    """Metrics of point trackers, one row per condition and metric; None where they were not asked for."""
    rows = data.reference(data["point_tracking_metrics"]).filter(pl.col("metric").is_in([*_METRICS]))
    if rows.is_empty():
        return None
    shown = [
        [
            str(row["tracker"]),
            str(row["speed"]),
            _METRICS[row["metric"]],
            str(row["raster"]),
            format_estimate(Estimate.of_row(row, "value", "low", "high", "share")),
        ]
        for row in rows.to_dicts()
    ]
    caption = f"Metrics of TAP-Vid (query mode first) and expected feature age{data.where}, means over sequences."
    return Cells(caption, ["tracker", "speed", "metric", "px of", "mean"], shown, [False, True, False, False, True])


def _lengths(low: int | None, high: int | None) -> str:
    if low is None:
        return "all"
    return f"{low} or more" if high is None else str(low) if low == high else f"{low} to {high}"


def _row(data: ReportData, tracker: str, speed: int) -> list[str]:
    """Cells of one condition. Empty where it was not measured."""
    chosen = reported_conditions(data, speed)
    summary = first(chosen.of(data["summary"], tracker))
    if summary is None:
        return []
    intervals = chosen.of(data["intervals"], tracker)
    return [
        tracker,
        str(speed),
        *_sizes(data, chosen, intervals, summary),
        _zero_mean(data, chosen, tracker, summary["at"]),
        *_shapes(data, chosen, tracker, summary["at"]),
        *(_growth(data, chosen, tracker, coordinate) for coordinate in "uv"),
        *(
            DASH if summary[name] is None else format_estimate(scalar_estimate(summary, intervals, name, unit))
            for name, unit in (("outlier_ratio", "share"), ("median_lifetime", "frames"))
        ),
    ]


def _sizes(
    data: ReportData, conditions: ReportedConditions, intervals: pl.DataFrame, summary: Mapping[str, Any]
) -> list[str]:
    """The reference age, and sizes of errors there. Withheld where points are fitted to the tracks."""
    if summary["at"] is None or data.truth_is_fitted:
        return [DASH] * 5
    sizes = [size_estimate(summary, intervals, conditions, name, axis) for name in SIZES for axis in "uv"]
    return [str(summary["at"]), *map(_px, sizes)]


def _px(estimate: Estimate) -> str:
    return DASH if estimate.value is None else format_estimate(estimate).replace(f"{SPACE}px", "")


def _zero_mean(data: ReportData, conditions: ReportedConditions, tracker: str, at: int | None) -> str:
    """The verdict at the reference age alone."""
    rows = conditions.of(data["zero_mean"], tracker).filter(trimming=data.trimming, axis=data.axis.name)
    row = first(rows.filter(pl.col("at") == at)) if at is not None else None
    if row is None:
        return DASH
    p = row["sign_flip_p"]
    return _ZERO[verdict_at(row)] + ("" if p is None else f" ({chance(p)})")


def _shapes(data: ReportData, conditions: ReportedConditions, tracker: str, at: int | None) -> list[str]:
    """Verdicts on the shape in the band of ages that holds the reference age, one for each trimming."""
    rows = conditions.of(data["gaussianity"], tracker).sort("age_low")
    since = 1 if at is None else abs(conditions.since(at))
    holding = rows.filter(pl.col("age_low") <= since, pl.col("age_high").is_null() | (pl.col("age_high") >= since))
    by_trimming = [first(holding.filter(trimming=trimming)) for trimming in conditions.trimmings]
    return [DASH if row is None else str(row["verdict"]) for row in by_trimming]


def _growth(data: ReportData, conditions: ReportedConditions, tracker: str, coordinate: str) -> str:
    rows = conditions.of(data["time_structure"], tracker).filter(trimming=data.trimming, coordinate=coordinate)
    row = first(rows)
    ratio = None if row is None else growth_ratio(row)
    if row is None or ratio is None:
        return DASH
    return f"{format_estimate(ratio)} times; {kind_of_growth(row)}"
