"""Error of each tracker at every speed."""

from collections.abc import Sequence

from tracknoise.findings.wording import listing, px
from tracknoise.report.figures.comparison import comparison
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.message import effect
from tracknoise.report.figures.series import MANY, Series
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import Trimming


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, one colour per speed."""
    if len(data.speeds) < 2:
        only = f"Only speed {data.slowest} was run" if data.speeds else "No tracker found a feature"
        title = f"Error by {data.axis.name} and speed"
        return [Absence("error-by-speed", title, f"{only}, so there are no speeds to compare.")]
    return [_speeds_of(data, tracker) for tracker in data.trackers]


def _speeds_of(data: ReportData, tracker: str) -> Figure | Absence:
    return comparison(
        data,
        data.reference(data.points).filter(tracker=tracker),
        Series("speed", data.speed_colours(tracker), "for speed {}"),
        id=f"error-by-speed-{data.slug(tracker)}",
        title=f"{tracker} by speed",
        shows=f"{data.errors_shown} of {tracker} at every speed{data.where}. At speed s the tracker sees only "
        "every s-th frame, so features move farther between its frames.",
        advice=f"Where curves coincide, the error depends on {data.axis.distance} and not on the number of tracking "
        f"steps.{_cuts_differ(data, tracker)}",
        message=effect(data, "speed", tracker),
    )


def _cuts_differ(data: ReportData, tracker: str) -> str:
    """Warn that speeds were not trimmed at the same error. Where few tracks live on, most errors are 0."""
    cuts = data.cuts(tracker)
    if data.trimming == Trimming.untrimmed or cuts["cut"].n_unique() < 2:
        return ""
    many = cuts.height > MANY
    rows = cuts.sort("cut")[[0, -1]].to_dicts() if many else cuts.to_dicts()
    cut = listing(f"{px(row['cut'])} at speed {row['speed']}" for row in rows)
    return f" Caution: trimming cuts {'between' if many else 'at'} {cut}. This explains part of the difference."
