"""Bias, absolute error and spread by age or frame, tracker beside tracker at the lowest speed."""

from collections.abc import Sequence

from tracknoise.findings.wording import number
from tracknoise.report.axis import FRAME
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures.curve_grid import Series, bands_text, grid, readings, when
from tracknoise.report.figures.figure import Absence, Family, Figure

_HOW = (
    "Rows: mean error, mean absolute error, and the root of the second moment about zero (solid) with that of the "
    "covariance about the mean (dashed); columns: u and v."
)


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """Trimmed curves, and the same untrimmed."""
    return [_trimmed(evidence), _untrimmed(evidence)]


def _trimmed(evidence: Evidence) -> Figure | Absence:
    name, title = "curves-trimmed", f"{_title(evidence)}, trimmed"
    kept = "the tracks that trimming kept"
    if evidence.percentile is None:
        title, kept = _title(evidence), "all tracks, for nothing was trimmed in this run,"
    shows = f"Errors of {kept}{evidence.where} {_along(evidence)}. {_HOW}"
    advice = (
        f"A mean that leaves zero with {evidence.axis.distance} is drift; where dashed runs below solid, a bias is "
        "part of the error."
    )
    return _figure(evidence, "trimmed", name, title, shows, advice)


def _untrimmed(evidence: Evidence) -> Figure | Absence:
    name, title = "curves-untrimmed", f"{_title(evidence)}, untrimmed"
    if evidence.percentile is None:
        return Absence(name, title, "Nothing was trimmed in this run, so this would show the same.")
    shows = f"The same for all tracks{evidence.where}, none dropped; mind the other scale of the axes."
    advice = (
        "What differs from the figure above is the work of the tracks that were dropped: an estimator meets them too."
    )
    return _figure(evidence, "untrimmed", name, title, shows, advice)


def _title(evidence: Evidence) -> str:
    return f"Error by {evidence.axis.name} at speed {evidence.slowest}"


def _along(evidence: Evidence) -> str:
    if evidence.axis is not FRAME:
        return "as they age"
    return "that are alive in the key frame, in which alone their true places are fixed, before and after it"


def _figure(evidence: Evidence, trimming: str, name: str, title: str, shows: str, advice: str) -> Figure | Absence:
    points = evidence.nominal(evidence.points).filter(trimming=trimming, population=evidence.population)
    series = Series("tracker", evidence.colour)
    found = readings(points, series)
    if not found:
        return Absence(name, title, _nothing(evidence))
    parts = [
        f"{one.name} has a mean error of {one.told('mean')}, and a root second moment of {one.told('second')}"
        for one in found
    ]
    look_for = f"{when(found, evidence.axis)} {'; '.join(parts)}. {advice}"
    shows = f"{shows} {bands_text(points, series)}"
    return Figure(name, title, shows, look_for, grid(points, series, evidence.axis, boxes=False))


def _nothing(evidence: Evidence) -> str:
    return (
        f"At speed {evidence.slowest} no {evidence.axis.name} but {evidence.axis.zero} has "
        f"{number(evidence.min_features)} features of known error, so there is no curve to draw."
    )


FAMILY = Family(
    id="curves",
    title="Error by tracker",
    lead="How the error grows away from where it is zero by construction: where a feature was first seen, from which "
    "its age counts in frames of the sequence, or, where a single scan fixes all features, in the scan's key frame.",
    figures=figures,
)
