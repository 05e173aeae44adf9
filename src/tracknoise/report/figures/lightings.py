"""Error under every lighting, of each tracker at each speed, by the direction in which the light moves."""

from collections.abc import Sequence
from itertools import product

import polars as pl

from tracknoise.report.figures import light_sweeps
from tracknoise.report.figures.comparison import comparison
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.message import effect
from tracknoise.report.figures.series import Series
from tracknoise.report.report_data import ReportData


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, speed and sweep of the light, one colour per lighting. None for only one lighting."""
    if len(data.lightings) < 2:
        return []
    each = product(data.trackers, data.speeds, light_sweeps.sweeps(data))
    return [_lightings_of(data, tracker, speed, sweep) for tracker, speed, sweep in each]


def _lightings_of(data: ReportData, tracker: str, speed: int, sweep: str) -> Figure | Absence:
    colours = light_sweeps.colours(data, tracker, sweep)
    points = data.across(data.points, "lighting").filter(tracker=tracker, speed=speed)
    several = len(light_sweeps.sweeps(data)) > 1
    return comparison(
        data,
        points.filter(pl.col("lighting").is_in(list(colours))),
        Series("lighting", colours, "under {}"),
        id=f"error-by-lighting-{data.slug(tracker)}-speed-{speed}{'-' + sweep.replace(' ', '-') if several else ''}",
        title=f"{tracker} at speed {speed} by lighting{f', {sweep}' if several else ''}",
        shows=f"{data.errors_shown} of {tracker} at speed {speed} under "
        f"{f'each lighting of the group {sweep}' if several else 'every lighting'}{data.elsewhere('lighting')}. "
        f"{data.view['lighting']} is black.",
        advice="Where curves coincide, the lighting makes no difference.",
        message="" if several else effect(data, "lighting", tracker, speed=speed),
    )
