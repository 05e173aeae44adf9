"""How much of the errors can be the truth's: verdicts of the audit, and what errors of the truth can cause."""

import math
from itertools import groupby

import polars as pl

from tracknoise.audit.summary import audit_sentences, corrections_toml
from tracknoise.findings.wording import listing, pixels
from tracknoise.report.audit_cells import parameter_cells
from tracknoise.report.axis import Axis
from tracknoise.report.cells import Cells
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE

TITLE = "How much of this is the truth?"
_MOST_SHARE = 0.5
"""Share of the second moment from which on a covariance is the truth's rather than the tracker's."""
_SHOWN = ("alone", "named")
_UNSTATED = "How accurate this truth is, is not stated, so that there is no truth floor."
_EXACT = "The truth is stated to be exact, so that it adds nothing to the errors."


def verdicts(data: ReportData) -> list[str]:
    """Sentences: what the audit found, then what errors of the truth can cause, for every tracker."""
    found = [] if data.truth_is_fitted else _floor(data)
    return [*audit_sentences(data.audit), *found]


def corrections(data: ReportData) -> str | None:
    """The block of an experiment file that corrects what the audit found; None where it found nothing."""
    return corrections_toml(data.audit, data.settings)


def tables(data: ReportData) -> list[Cells]:
    """The audit: each parameter alone, and the faults that were found."""
    shown = data.audit.filter(pl.col("family").is_in(_SHOWN))
    return [] if shown.is_empty() else [parameter_cells(shown)]


def _floor(data: ReportData) -> list[str]:
    points = data.nominal(data.points).filter(
        pl.col("since") > 0, role="second", trimming=data.trimming, population=data.population
    )
    if points.is_empty():
        return []
    known = points.drop_nulls(["floor_u", "floor_v"])
    if known.is_empty():
        return [_UNSTATED]
    if known.select(pl.max_horizontal("floor_u", "floor_v").max()).item() == 0.0:
        return [_EXACT]
    of_trackers = [
        _of_tracker(known.filter(tracker=tracker).sort("since"), tracker, data.axis) for tracker in data.trackers
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
        f"{place}, errors of the truth can cause {pixels(min(floor_px, error_px))} of the {pixels(error_px)} px "
        f"of {tracker}."
    )
    return f"{opening} {_limit(points, axis)}"


def _limit(points: pl.DataFrame, axis: Axis) -> str:
    """Where errors of the truth can be more than half of the second moment, and where a covariance can be taken."""
    floor, second = (pl.col(f"{name}u") ** 2 + pl.col(f"{name}v") ** 2 for name in ("floor_", ""))
    covered = points.select(floor > _MOST_SHARE * second).to_series().to_list()
    places = [axis.place(since).removeprefix("at ") for since in points["since"]]
    if not any(covered):
        return f"Less than half of the second moment can be the truth's up to {places[-1]}."
    reason = "more than half of it can be the truth's"
    if all(covered):
        return f"Do not take a covariance from this recording: {reason} at any {axis.distance}."
    first = covered.index(True)
    if first > 0 and all(covered[first:]):
        return f"Do not take a covariance beyond {places[first - 1]} from this recording: {reason}."
    free = [list(run) for is_covered, run in groupby(range(len(covered)), covered.__getitem__) if not is_covered]
    spans = listing(f"from {places[run[0]]} to {places[run[-1]]}" for run in free)
    return f"Take a covariance from this recording only {spans}: elsewhere, {reason}."
