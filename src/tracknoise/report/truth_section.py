"""How much of the errors can be the truth's: verdicts of the audit, as sentences and tables.

- The audit of the truth as tables of text.
- How much of the errors can be the truth's: verdicts of the audit, and what errors of the truth can cause.
"""

import math
from itertools import groupby

import polars as pl

from tracknoise.report.cells import Cells
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.tables.enumerations import TruthCause
from tracknoise.tables.trust import AssessedTruth
from tracknoise.topics.bands import Axis
from tracknoise.truth_faults.audit_summary import audit_sentences, corrections_toml
from tracknoise.truth_faults.explained import MOVED
from tracknoise.truth_faults.fault_parameters import Family
from tracknoise.words import DASH, SPACE, listing, number, percent, pixels

_FAMILIES = {
    "alone": "alone",
    "beside_bias": "beside biases of the trackers",
    "named": "all faults found",
    "at_most": "most that can be explained",
}
_CAPTION = (
    "Corrections of the stated truth, fitted to the errors of all trackers. Explained: share of the second moment that "
    "a correction removes from data that took no part in its fit."
)


_CAUSES = (
    "What the verdict rests on: shares of the squared errors of each tracker that causes in the truth may explain."
)


def parameter_cells(audit: pl.DataFrame) -> Cells:
    """One row per number of every fit."""
    shown = audit.filter(pl.col("family").is_in(list(_FAMILIES)), pl.col("parameter") != MOVED)
    headings = ["fitted", "parameter", "stated", "value", "low", "high", "unit", "explained", "condition", "verdict"]
    rows = [
        [
            _FAMILIES[row["family"]],
            f"{row['parameter'].replace('_', ' ')} {row['component']}".strip(),
            *(number(row[name], digits=4) for name in ("stated", "value", "low", "high")),
            row["unit"],
            percent(row["gain_high" if row["family"] == Family.at_most else "gain"]),
            number(row["condition"], digits=2),
            (row["verdict"] or DASH).replace("_", " "),
        ]
        for row in shown.iter_rows(named=True)
    ]
    numeric = [False, False, True, True, True, True, False, True, True, False]
    return Cells(_CAPTION + _resampled(audit), headings, rows, numeric)


def cause_cells(truth: AssessedTruth) -> Cells:
    """What the verdict rests on: shares of the squared errors by cause, and what is established."""
    headings = ["cause", "tracker", "explains", "low", "high", "at most (px)", "what is established"]
    rows = [
        [
            "all together" if row["cause"] == TruthCause.every else row["cause"].replace("_", " "),
            row["tracker"] or DASH,
            *(DASH if row[name] is None else percent(row[name]) for name in ("share", "low", "high")),
            DASH if row["bound_px"] is None else pixels(row["bound_px"]),
            row["text"] or "",
        ]
        for row in truth.causes.iter_rows(named=True)
    ]
    return Cells(_CAUSES, headings, rows, [False, False, True, True, True, True, False])


def curve_cells(curves: pl.DataFrame) -> Cells:
    """Mean error and second moment by age, before and after each correction."""
    headings = ["tracker", "age", "corrected", "n", "mean u (px)", "mean v (px)", "second u (px²)", "second v (px²)"]
    names = ("mean_u_px", "mean_v_px", "second_uu", "second_vv")
    rows = [
        [
            row["tracker"],
            number(row["age"]),
            "nothing" if row["correction"] == "measured" else row["correction"].replace("_", " "),
            number(row["n"]),
            *(pixels(row[name]) for name in names),
        ]
        for row in curves.iter_rows(named=True)
    ]
    caption = "Errors before and after corrections. Each correction is applied together with those above it."
    return Cells(caption, headings, rows, [False, True, False, *[True] * 5])


def _resampled(audit: pl.DataFrame) -> str:
    """How intervals were made."""
    units = audit["resampled"].drop_nulls()
    if units.is_empty():
        return ""
    kind = {"blocks": "blocks of tracks", "within": "scenes, resampled within their groups"}.get(units[0], units[0])
    level = f"{100 * audit['level'].drop_nulls()[0]:g}{SPACE}%"
    return f" {level} intervals from {audit['n_units'].drop_nulls()[0]} {kind}."


TITLE = "How much of this is the truth?"
_MOST_SHARE = 0.5
"""Share of the second moment from which on a covariance is the truth's rather than the tracker's."""
_SHOWN = ("alone", "named")
_UNSTATED = "The accuracy of this truth is not stated, so that there is no truth floor."
_EXACT = "The truth is stated to be exact, so that it adds nothing to the errors."


def verdicts(data: ReportData) -> list[str]:
    """Sentences: the verdict, what it changed in that of a check, what the audit found, and what is stated."""
    floor = [] if data.truth_is_fitted else _floor(data)
    change = data.truth_change
    truth = data.truth
    sentences = filter(None, [truth.sentence, truth.stated, change])
    return [*sentences, *audit_sentences(data.audit.audit), *floor]


def corrections(data: ReportData) -> str | None:
    """The block of an experiment file that corrects what the audit found; None where it found nothing."""
    return corrections_toml(data.audit.audit, data.settings)


def tables(data: ReportData) -> list[Cells]:
    """The audit: each parameter alone, and the faults that were found; then what the verdict rests on."""
    shown = data.audit.audit.filter(pl.col("family").is_in(_SHOWN))
    parameters = [] if shown.is_empty() else [parameter_cells(shown)]
    causes = cause_cells(data.assessed_truth)
    return [*parameters, causes] if causes.rows else parameters


def _floor(data: ReportData) -> list[str]:
    points = data.nominal(data.points).filter(
        pl.col("since") > 0, role="second", trimming=data.trimming, population=data.population
    )
    if points.is_empty():
        return []
    with_floor = points.drop_nulls(["floor_u", "floor_v"])
    if with_floor.is_empty():
        return [_UNSTATED]
    if with_floor.select(pl.max_horizontal("floor_u", "floor_v").max()).item() == 0.0:
        return [_EXACT]
    of_trackers = [
        _of_tracker(with_floor.filter(tracker=tracker).sort("since"), tracker, data.axis) for tracker in data.trackers
    ]
    return [sentence for sentence in of_trackers if sentence]


def _of_tracker(points: pl.DataFrame, tracker: str, axis: Axis) -> str:
    """Error and floor at the reference age, and where the floor is the smaller part."""
    young = points.filter(pl.col("since") <= REFERENCE_AGE)
    if young.is_empty():
        return ""
    place = axis.opening_place(young["since"][-1])
    error_px, floor_px = (math.hypot(*young.select(names).row(-1)) for names in (("u", "v"), ("floor_u", "floor_v")))
    opening = (
        f"{place}, errors of the stated size can cause {pixels(min(floor_px, error_px))} of the {pixels(error_px)} px "
        f"of {tracker}."
    )
    return f"{opening} {_limit(points, axis)}"


def _limit(points: pl.DataFrame, axis: Axis) -> str:
    """Where errors of the truth can be more than half of the second moment, and where a covariance can be taken."""
    floor, second = (pl.col(f"{name}u") ** 2 + pl.col(f"{name}v") ** 2 for name in ("floor_", ""))
    covered = points.select(floor > _MOST_SHARE * second).to_series().to_list()
    places = [axis.place(since).removeprefix("at ") for since in points["since"]]
    if not any(covered):
        return f"Errors of the truth can explain less than half of the second moment up to {places[-1]}."
    reason = "errors of the truth can explain more than half of the second moment"
    if all(covered):
        return f"Do not take a covariance from this recording: {reason} at any {axis.distance}."
    first = covered.index(True)
    if first > 0 and all(covered[first:]):
        return f"Do not take a covariance beyond {places[first - 1]} from this recording: {reason}."
    free = [list(run) for is_covered, run in groupby(range(len(covered)), covered.__getitem__) if not is_covered]
    spans = listing(f"from {places[run[0]]} to {places[run[-1]]}" for run in free)
    return f"Take a covariance from this recording only {spans}: elsewhere, {reason}."
