"""Bias, absolute error and spread by age, tracker beside tracker at the lowest speed."""

from collections.abc import Sequence

from tracknoise.report.evidence import Evidence
from tracknoise.report.figures.curve_grid import Series, grid, readings, when
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.sentences import number

_HOW = (
    "Rows: mean error, mean absolute error, and the root of the second moment about zero (solid) with that of the "
    "covariance about the mean (dashed); columns: u and v."
)


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """Trimmed curves, and the same untrimmed."""
    return [_trimmed(evidence), _untrimmed(evidence)]


def _trimmed(evidence: Evidence) -> Figure | Absence:
    name, title = "curves-trimmed", f"Error by age at speed {evidence.slowest}, trimmed"
    kept = "the tracks that trimming kept"
    if evidence.percentile is None:
        title, kept = f"Error by age at speed {evidence.slowest}", "all tracks, for nothing was trimmed in this run,"
    shows = f"Errors of {kept}{evidence.where} as they age. {_HOW}"
    advice = "A mean that leaves zero with age is drift; where dashed runs below solid, a bias is part of the error."
    return _figure(evidence, "trimmed", name, title, shows, advice)


def _untrimmed(evidence: Evidence) -> Figure | Absence:
    name, title = "curves-untrimmed", f"Error by age at speed {evidence.slowest}, untrimmed"
    if evidence.percentile is None:
        return Absence(name, title, "Nothing was trimmed in this run, so this would show the same.")
    shows = f"The same for all tracks{evidence.where}, none dropped; mind the other scale of the axes."
    advice = (
        "What differs from the figure above is the work of the tracks that were dropped: an estimator meets them too."
    )
    return _figure(evidence, "untrimmed", name, title, shows, advice)


def _figure(evidence: Evidence, trimming: str, name: str, title: str, shows: str, advice: str) -> Figure | Absence:
    points = evidence.nominal(evidence.points).filter(trimming=trimming, population=evidence.population)
    found = readings(points, "tracker", evidence.trackers)
    if not found:
        return Absence(name, title, _nothing(evidence))
    parts = [
        f"{one.name} has a mean error of {one.told('nu')}, and a root second moment of {one.told('Phi')}"
        for one in found
    ]
    look_for = f"{when(found)} {'; '.join(parts)}. {advice}"
    return Figure(name, title, shows, look_for, grid(points, Series("tracker", evidence.colour), boxes=False))


def _nothing(evidence: Evidence) -> str:
    return (
        f"At speed {evidence.slowest} no age beyond the first frame has {number(evidence.min_features)} features of "
        "known error, so there is no curve to draw."
    )


FAMILY = Family(
    id="curves",
    title="Error by age",
    lead="How the error grows while a feature is tracked. Age counts frames of the sequence since the feature was "
    "first seen, where its error is zero by construction.",
    figures=figures,
)
