"""Error at every speed, of each tracker."""

from collections.abc import Sequence

from tracknoise.findings.wording import px
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures.comparison import comparison
from tracknoise.report.figures.curve_grid import MANY, Series
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.sentences import listing


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """One figure a tracker, one colour a speed."""
    if len(evidence.speeds) < 2:
        only = f"Only speed {evidence.slowest} was run" if evidence.speeds else "No tracker found a feature"
        title = f"Error by {evidence.axis.name} and speed"
        return [Absence("curves-by-speed", title, f"{only}, so there are no speeds to compare.")]
    return [_speeds_of(evidence, tracker) for tracker in evidence.trackers]


def _speeds_of(evidence: Evidence, tracker: str) -> Figure | Absence:
    return comparison(
        evidence,
        evidence.reference(evidence.points).filter(tracker=tracker),
        Series("speed", evidence.speed_colours(tracker), "for speed {}"),
        id=f"speed-{evidence.slug(tracker)}",
        title=f"{tracker} by speed",
        shows=f"{evidence.errors_kept} of {tracker} at every speed{evidence.where}: at speed s it sees every s-th "
        "frame only, so that features move farther between the frames it sees.",
        advice=f"Curves that lie on each other mean that error comes with {evidence.axis.distance}, whatever the "
        f"number of steps it took.{_cuts_differ(evidence, tracker)}",
    )


def _cuts_differ(evidence: Evidence, tracker: str) -> str:
    """Warn that speeds were not trimmed at the same error: where few tracks live on, most errors are 0."""
    cuts = evidence.cuts(tracker)
    if cuts["cut"].n_unique() < 2:
        return ""
    many = cuts.height > MANY
    rows = cuts.sort("cut")[[0, -1]].to_dicts() if many else cuts.to_dicts()
    told = listing(f"{px(row['cut'])} at speed {row['speed']}" for row in rows)
    return f" Mind that trimming cut {'between' if many else 'at'} {told}: some of the difference is the cut's."


FAMILY = Family(
    id="speeds",
    title="Error by speed",
    lead="What changes when the camera moves faster, or the tracker sees fewer frames.",
    figures=figures,
)
