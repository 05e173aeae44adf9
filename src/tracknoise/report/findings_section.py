"""The first section of the report: the findings in sentences, and the verdicts for every tracker and speed."""

from itertools import groupby
from typing import Any

import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.report.cells import Cells
from tracknoise.report.report_data import ReportData
from tracknoise.topics.catalogue import TOPICS
from tracknoise.topics.headlines import findings_of
from tracknoise.topics.measures import Subject, estimate_cell
from tracknoise.topics.sentences import joined
from tracknoise.words import DASH, SELF_REFERENTIAL, format_estimate, number

_METRICS = {
    "delta_avg": "position accuracy",
    "delta_avg_reported": "accuracy of positions reported as visible",
    "average_jaccard": "average Jaccard",
    "occlusion_accuracy": "occlusion accuracy",
    "expected_feature_age": "expected feature age",
}
NOTHING = "Findings were not computed for this run. `tracknoise run` computes them."


def sentences(data: ReportData) -> list[dict[str, Any]]:
    """Rows of the findings by rank. `file` is the name of the table file that holds their numbers."""
    return [{**row, "file": row["table"].replace("_", "-")} for row in findings_of(data.tables).to_dicts()]


def verdicts(data: ReportData) -> Cells:
    """One row per tracker and speed, in the view shown in the figures: columns of all topics."""
    columns = [column for topic in TOPICS for column in topic.columns(data)]
    headings = ["tracker", "speed", f"at {data.axis.name}", *(column.heading for column in columns)]
    above = ["", "", "", *(column.above for column in columns)]
    groups = [(heading, len([*same])) for heading, same in groupby(above)]
    subjects = [Subject(data, tracker, speed) for tracker in data.trackers for speed in data.speeds]
    rows = [
        [subject.tracker, str(subject.speed), _at(subject), *(column.cell(subject) for column in columns)]
        for subject in subjects
        if subject.row is not None
    ]
    errors_text = "" if data.percentile is None else f"Errors are {data.trimming} unless the heading says otherwise."
    notes = dict.fromkeys([f"Verdicts{data.where}.", errors_text, *(column.note for column in columns)])
    return Cells(joined(notes), headings, rows, [False, True, True, *[False] * len(columns)], groups)


def _at(subject: Subject) -> str:
    """The reference age, or frame. Withheld where points are fitted to the tracks."""
    return DASH if subject.at is None or subject.data.truth_is_fitted else str(subject.at)


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
            estimate_cell(Estimate.of_row(row, "sigma_px", "low", "high", "px")),
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
