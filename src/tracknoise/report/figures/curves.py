"""Bias, absolute error and spread by age, tracker beside tracker at the lowest speed."""

from collections.abc import Sequence

from tracknoise.report.evidence import Evidence
from tracknoise.report.figures.curve_grid import Series, grid, readings, when
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.sentences import number

_HOW = "Rows: mean error, mean absolute error, and the root of the second moment about zero (solid) with that of the " \
    "covariance about the mean (dashed); columns: u and v."


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """Trimmed curves, and the same untrimmed."""
    return [_trimmed(evidence), _untrimmed(evidence)]


def _trimmed(evidence: Evidence) -> Figure | Absence:
    name, title = "curves-trimmed", f"Error by age at speed {evidence.slowest}, trimmed"
    nominal = evidence.nominal(evidence.points).filter(trimming="trimmed", population=evidence.population)
    if nominal.is_empty():
        return Absence(name, title, _nothing(evidence))
    share = "" if evidence.percentile is not None else " Nothing was trimmed in this run."
    return Figure(
        id=name,
        title=title,
        shows=f"Errors of the tracks that trimming kept{evidence.where}, as they age. {_HOW}{share}",
        look_for=_numbers(evidence, "trimmed") + " A mean that leaves zero with age is drift; where dashed runs below "
        "solid, a bias is part of the error.",
        spec=grid(nominal, Series("tracker", evidence.colour), boxes=False),
    )


def _untrimmed(evidence: Evidence) -> Figure | Absence:
    name, title = "curves-untrimmed", f"Error by age at speed {evidence.slowest}, untrimmed"
    nominal = evidence.nominal(evidence.points).filter(trimming="untrimmed", population=evidence.population)
    if nominal.is_empty():
        return Absence(name, title, _nothing(evidence))
    return Figure(
        id=name,
        title=title,
        shows=f"The same for all tracks{evidence.where}, none dropped; mind the other scale of the axes.",
        look_for=_numbers(evidence, "untrimmed") + " What is larger here than above is due to the few tracks that "
        "trimming dropped: an estimator meets them too.",
        spec=grid(nominal, Series("tracker", evidence.colour), boxes=False),
    )


def _nothing(evidence: Evidence) -> str:
    return (
        f"At speed {evidence.slowest} no age has {number(evidence.min_features)} features with a known error, so there "
        "is no curve to draw."
    )


def _numbers(evidence: Evidence, trimming: str) -> str:
    points = evidence.nominal(evidence.points).filter(trimming=trimming, population=evidence.population)
    found = readings(points, "tracker", evidence.trackers)
    parts = [
        f"{one.name} has a mean error of {one.told('nu')}, and a root second moment of {one.told('Phi')}"
        for one in found
    ]
    return f"{when(found)} {'; '.join(parts)}."


FAMILY = Family(
    id="curves",
    title="Error by age",
    lead="How the error grows while a feature is tracked. Age counts frames of the sequence since the feature was first "
    "seen, where its error is zero by construction.",
    figures=figures,
)
