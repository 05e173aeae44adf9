"""Error along and across what the image and its motion are like, beside that in u and v."""

from collections.abc import Sequence

import polars as pl

from tracknoise.findings.wording import SPACE, count, number, px
from tracknoise.report import style
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures.curve_grid import Reading, Series, bands_text, grid, readings, when
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.sentences import listing
from tracknoise.statistics.definitions import LEAST_MOTION_PX
from tracknoise.tables.enumerations import Aspect

_LEAST = f"{number(LEAST_MOTION_PX, digits=1)}{SPACE}px"
_IMAGE = "u and v"
_TOLD = {
    _IMAGE: "{} in u and {} in v",
    Aspect.motion: "{} along the motion and {} across it",
    Aspect.gradient: "{} along the gradient and {} across it",
}
"""What curves there are, and how a sentence tells the two values of each."""


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """One figure a tracker at the lowest speed."""
    return [_along_and_across(evidence, tracker) for tracker in evidence.trackers]


def _along_and_across(evidence: Evidence, tracker: str) -> Figure | Absence:
    name, title = f"along-{evidence.slug(tracker)}", f"{tracker}, along and across"
    points, series = _points(evidence, tracker), _series(evidence, tracker)
    found = readings(points, series)
    if not {one.name for one in found} - {_IMAGE}:
        why = f"No {evidence.axis.name} has enough features of which the error and the motion, or a gradient, are known"
        return Absence(name, title, f"{why}, so there is no curve.")
    shows = f"{_shows(evidence, tracker)} {bands_text(points, series)}"
    return Figure(
        name, title, shows, _look_for(evidence, points, found), grid(points, series, evidence.axis, boxes=False)
    )


def _points(evidence: Evidence, tracker: str) -> pl.DataFrame:
    """Trimmed curves of visible features, by `axes`."""
    image = evidence.points.filter(population="visible").with_columns(aspect=pl.lit(_IMAGE))
    aspects = evidence.aspect_points.filter(pl.col("aspect").is_in([Aspect.motion, Aspect.gradient]))
    aspects = aspects.with_columns(pl.col("aspect").cast(pl.String))
    both = pl.concat([image, aspects.select(image.columns)]).rename({"aspect": "axes"})
    return evidence.nominal(both).filter(tracker=tracker, trimming="trimmed")


def _series(evidence: Evidence, tracker: str) -> Series:
    colours = dict(zip(_TOLD, style.shades(evidence.colour[tracker], len(_TOLD)), strict=True))
    return Series("axes", colours, "for {}", ("u, or along", "v, or across"))


def _shows(evidence: Evidence, tracker: str) -> str:
    return (
        f"{evidence.errors_kept} of {tracker} at speed {evidence.slowest}{evidence.where}, of features that could be "
        "seen: in u and v; along the motion of the true position since the frame that the tracker saw before (behind "
        f"it is negative) and across it (right of it is positive), where it moved by {_LEAST} or more; "
        "and along and across the dominant gradient of the image where the feature was first seen, if it had one. Such "
        "a gradient has no sign, so that there is no mean error along it. Dashed: about the mean."
    )


def _look_for(evidence: Evidence, points: pl.DataFrame, found: Sequence[Reading]) -> str:
    means = ", ".join(_told(one, "mean") for one in found if "mean" in one.values)
    roots = ", ".join(_told(one, "second") for one in found)
    rests = listing(f"{count(_features(points, one), 'feature')} for {one.name}" for one in found)
    return (
        f"{when(found, evidence.axis)} the mean error is {means}. The root second moment is {roots}. They rest on "
        f"{rests}. A mean error that follows the motion shows along it, though in u and v it may average out, where "
        "motion turns. Where errors across the gradient are larger than along it, features slide along edges."
        f"{_caution(evidence)}"
    )


def _caution(evidence: Evidence) -> str:
    """Recorded truth has errors of its own, from which the direction of motion is not free."""
    if all(entry.truth == "raycast" for entry in evidence.sequences.values()):
        return ""
    return " Mind that noise of the true positions shows as a lag too, the more so the slower the motion."


def _told(reading: Reading, role: str) -> str:
    return _TOLD[reading.name].format(*(px(value) for value in reading.values[role]))


def _features(points: pl.DataFrame, reading: Reading) -> int:
    return int(points.filter(axes=reading.name, since=reading.since, role="second")["n"].sum())


FAMILY = Family(
    id="along-and-across",
    title="Along and across",
    lead="Errors come from how the image looks and moves, which knows nothing of u and v. What a tracker does along "
    "the motion, or along an edge, shows in its own direction.",
    figures=figures,
)
