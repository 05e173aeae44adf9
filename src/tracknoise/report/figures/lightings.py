"""Error under every lighting, of each tracker at each speed."""

from collections.abc import Sequence

from tracknoise.report.figures import light_sweeps
from tracknoise.report.figures.comparison import comparison
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.series import Series
from tracknoise.report.report_data import ReportData


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker and speed, one colour per lighting. None where there is only one lighting."""
    if len(data.lightings) < 2:
        return []
    return [_lightings_of(data, tracker, speed) for tracker in data.trackers for speed in data.speeds]


def _lightings_of(data: ReportData, tracker: str, speed: int) -> Figure | Absence:
    return comparison(
        data,
        data.across(data.points, "lighting").filter(tracker=tracker, speed=speed),
        Series("lighting", light_sweeps.colours(data, tracker), "under {}"),
        id=f"error-by-lighting-{data.slug(tracker)}-speed-{speed}",
        title=f"{tracker} at speed {speed} by lighting",
        shows=f"{data.errors_shown} of {tracker} at speed {speed} under every lighting"
        f"{data.elsewhere('lighting')}. {data.view['lighting']} is black.",
        advice="Where curves coincide, the lighting makes no difference.",
    )
