"""Rows of a card about tracks: outlier ratio and median lifetime."""

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.headlines.reported_conditions import scalar_bounds
from tracknoise.printable import counted
from tracknoise.report.answer.subject import Subject, number, with_interval
from tracknoise.report.answer.summary import Answer, Measure


def outliers(subject: Subject, fewest: Answer | None) -> Measure | None:
    """Share of features that the tracker rejects."""
    value = None if subject.row is None else subject.row["outlier_ratio"]
    if value is None:
        return None
    shown = number(Estimate.of(value, scalar_bounds(subject.intervals, "outlier_ratio"), "share"))
    sentence = f"{subject.tracker} rejects {with_interval(shown)} of the features carried into a frame."
    note = "share of features carried into a frame that is rejected"
    return Measure("outliers", "share", shown, None, None, fewest, note, sentence, "outlier-ratio")


def lifetime(subject: Subject, longest: Answer | None) -> Measure | None:
    """Median lifetime, or the mean up to a horizon where more than half of the tracks are alive at the end."""
    if subject.row is None or not subject.row["n_tracks"]:
        return None
    if subject.row["median_lifetime"] is not None:
        return _of(subject, longest, "median_lifetime", "Kaplan-Meier median", "The median lifetime of tracks of")
    if subject.row["restricted_mean_lifetime"] is None:
        return None
    horizon = f"up to {counted(subject.row['restricted_to'], 'frame')}"
    note = f"mean {horizon}; over half are alive at the end"
    return _of(subject, longest, "restricted_mean_lifetime", note, f"The mean lifetime {horizon} of tracks of")


def _of(subject: Subject, longest: Answer | None, statistic: str, note: str, opening: str) -> Measure:
    value = None if subject.row is None else subject.row[statistic]
    shown = number(Estimate.of(value, scalar_bounds(subject.intervals, statistic), "frames"))
    bounds = f" ({shown.interval})" if shown.interval and statistic == "median_lifetime" else ""
    sentence = f"{opening} {subject.tracker} is {shown.text}{bounds}."
    return Measure("lifetime", "frames", shown, None, None, longest, note, sentence, "lifetimes")
