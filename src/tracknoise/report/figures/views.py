"""Error in images that are turned, and in sequences that are played backward, beside the usual."""

from collections.abc import Sequence

import polars as pl

from tracknoise.report import style
from tracknoise.report.bands import upright_bounds
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures.comparison import comparison
from tracknoise.report.figures.curve_grid import Series
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.sentences import listing

_TURNED = {0: "upright", 90: "sideways", 180: "upside down", 270: "sideways, the other way"}
"""What images are called that are turned counter-clockwise by so many degrees."""


def rotations(evidence: Evidence) -> Sequence[Figure | Absence]:
    """One figure a tracker, one colour a rotation; none where there is one rotation."""
    if len(evidence.rotations) < 2:
        return []
    return [_rotations_of(evidence, tracker) for tracker in evidence.trackers]


def directions(evidence: Evidence) -> Sequence[Figure | Absence]:
    """One figure a tracker, one colour a direction; none where there is one direction."""
    if len(evidence.directions) < 2:
        return []
    return [_directions_of(evidence, tracker) for tracker in evidence.trackers]


def _rotations_of(evidence: Evidence, tracker: str) -> Figure | Absence:
    points = evidence.across(evidence.points, "rotation").filter(tracker=tracker, speed=evidence.slowest)
    names = [_TURNED[angle] for angle in evidence.rotations]
    told = listing(f"{_TURNED[angle]} is turned by {angle}°" for angle in evidence.rotations if angle)
    return comparison(
        evidence,
        upright_bounds(points, signed=pl.col("role") == "mean").with_columns(
            rotation=pl.col("rotation").replace_strict(_TURNED, return_dtype=pl.String)
        ),
        Series("rotation", _two(evidence, tracker, names), "{}"),
        id=f"rotation-{evidence.slug(tracker)}",
        title=f"{tracker}, {listing(names, joint='against')}",
        shows=f"{evidence.errors_kept} of {tracker} at speed {evidence.slowest}{evidence.elsewhere('rotation')} in "
        f"images of each rotation; {told} counter-clockwise. What was measured in a turned image is turned back: u "
        "and v are those of the upright image in all curves.",
        advice="Curves that lie on each other belong to a tracker that does not mind which way is up; where they lie "
        "apart, part of the error comes from the image's own axes.",
    )


def _directions_of(evidence: Evidence, tracker: str) -> Figure | Absence:
    return comparison(
        evidence,
        evidence.across(evidence.points, "direction").filter(tracker=tracker, speed=evidence.slowest),
        Series("direction", _two(evidence, tracker, evidence.directions), "{}"),
        id=f"direction-{evidence.slug(tracker)}",
        title=f"{tracker}, {listing(evidence.directions, joint='against')}",
        shows=f"{evidence.errors_kept} of {tracker} at speed {evidence.slowest}{evidence.elsewhere('direction')} with "
        "the frames in the order of their recording, and with the last frame first.",
        advice="A mean error that changes its sign with the direction follows the motion in the image; one that keeps "
        "it does not.",
        role="mean",
    )


def _two(evidence: Evidence, tracker: str, names: Sequence[str]) -> dict[str, str]:
    return dict(zip(names, style.shades(evidence.colour[tracker], len(names)), strict=True))


ROTATION = Family(
    id="rotations",
    title="Error in turned images",
    lead="What changes when the same images are shown to the trackers turned, with the camera's axes turned alike.",
    figures=rotations,
)
DIRECTION = Family(
    id="directions",
    title="Error by direction",
    lead="What changes when the same frames are played backward, as if the camera had gone its way back.",
    figures=directions,
)
