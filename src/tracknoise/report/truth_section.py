"""How much of the errors can be the truth's: verdicts of the audit, and what errors of the truth can cause."""

import math

import polars as pl

from tracknoise.audit.recorded_frames import recorded_step
from tracknoise.audit.summary import audit_sentences, corrections_toml
from tracknoise.findings.wording import pixels
from tracknoise.report.audit_cells import parameter_cells
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
    return corrections_toml(data.audit, recorded_step(data.settings))


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
    of_trackers = [_of_tracker(known.filter(tracker=tracker).sort("since"), tracker) for tracker in data.trackers]
    return [sentence for sentence in of_trackers if sentence]


def _of_tracker(points: pl.DataFrame, tracker: str) -> str:
    """Error and floor at the reference age, and the age up to which the floor is the smaller part."""
    young = points.filter(pl.col("since") <= REFERENCE_AGE)
    if young.is_empty():
        return ""
    age = young["since"][-1]
    error_px, floor_px = (math.hypot(*young.select(names).row(-1)) for names in (("u", "v"), ("floor_u", "floor_v")))
    opening = (
        f"At age {age}, errors of the truth can cause {pixels(min(floor_px, error_px))} of the {pixels(error_px)} px "
        f"of {tracker}."
    )
    return f"{opening} {_limit(points)}"


def _limit(points: pl.DataFrame) -> str:
    covered = pl.col("floor_u") ** 2 + pl.col("floor_v") ** 2 > _MOST_SHARE * (pl.col("u") ** 2 + pl.col("v") ** 2)
    first = points.filter(covered)["since"].min()
    before = points if first is None else points.filter(pl.col("since") < first)
    if before.is_empty():
        return "Do not take a covariance from this recording: more than half of it can be the truth's at any age."
    last = before["since"][-1]
    if first is None:
        return f"Less than half of the second moment can be the truth's up to age {last}."
    return f"Do not take a covariance beyond age {last} from this recording: more than half of it can be the truth's."
