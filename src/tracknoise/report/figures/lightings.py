"""Error under every lighting, of each tracker at each speed."""

from collections.abc import Sequence

from tracknoise.report.evidence import Evidence
from tracknoise.report.figures import light_sweeps
from tracknoise.report.figures.comparison import comparison
from tracknoise.report.figures.curve_grid import Series
from tracknoise.report.figures.figure import Absence, Family, Figure


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """One figure a tracker and speed, one colour a lighting; none where there is one lighting."""
    if len(evidence.lightings) < 2:
        return []
    return [_lightings_of(evidence, tracker, speed) for tracker in evidence.trackers for speed in evidence.speeds]


def _lightings_of(evidence: Evidence, tracker: str, speed: int) -> Figure | Absence:
    return comparison(
        evidence,
        evidence.across(evidence.points, "lighting").filter(tracker=tracker, speed=speed),
        Series("lighting", light_sweeps.colours(evidence, tracker), "under {}"),
        id=f"lighting-{evidence.slug(tracker)}-speed-{speed}",
        title=f"{tracker} at speed {speed} by lighting",
        shows=f"{evidence.errors_kept} of {tracker} at speed {speed} under every lighting"
        f"{evidence.elsewhere('lighting')}; black: {evidence.view['lighting']}.",
        advice="Curves that lie on each other speak for a lighting that makes no difference.",
    )


FAMILY = Family(
    id="lightings",
    title="Error by lighting",
    lead="What changes when the same path is seen under other light.",
    figures=figures,
)
