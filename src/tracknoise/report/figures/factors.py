"""Error by age at every speed, and under every lighting, of each tracker."""

from collections.abc import Sequence

import polars as pl

from tracknoise.report import style
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures.curve_grid import Series, grid, readings, when
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.sentences import listing, px

_BOXES = (
    "The box plots beside the curves show the curves' own values over all ages drawn but 0: orange line the median, "
    "green triangle the mean, whiskers to the last value within 1.5 interquartile ranges."
)


def by_speed(evidence: Evidence) -> Sequence[Figure | Absence]:
    """One figure a tracker, one colour a speed."""
    if len(evidence.speeds) < 2:
        only = f"Only speed {evidence.slowest} was run" if evidence.speeds else "No tracker found a feature"
        return [Absence("curves-by-speed", "Error by age and speed", f"{only}, so there are no speeds to compare.")]
    return [_speeds_of(evidence, tracker) for tracker in evidence.trackers]


def by_lighting(evidence: Evidence) -> Sequence[Figure | Absence]:
    """One figure a tracker, one colour a lighting; none where there is one lighting."""
    if len(evidence.lightings) < 2:
        return []
    return [_lightings_of(evidence, tracker) for tracker in evidence.trackers]


def _speeds_of(evidence: Evidence, tracker: str) -> Figure | Absence:
    points = _kept(evidence, evidence.reference(evidence.points), tracker)
    shows = (
        f"{evidence.errors_kept} of {tracker} at every speed{evidence.where}: at speed s it sees every s-th frame "
        "only, so that features move farther between the frames it sees. Dashed: about the mean."
    )
    advice = "Curves that lie on each other mean that error comes with age, whatever the number of steps it took."
    advice += _cuts_differ(evidence, tracker)
    title, series = f"{tracker} by speed", Series("speed", evidence.speed_colours(tracker))
    return _figure(f"speed-{evidence.slug(tracker)}", title, points, series, shows, advice)


def _lightings_of(evidence: Evidence, tracker: str) -> Figure | Absence:
    here = (pl.col("speed") == evidence.slowest) & (pl.col("rotation") == evidence.rotations[0])
    points = _kept(evidence, evidence.points.filter(here), tracker)
    shows = (
        f"{evidence.errors_kept} of {tracker} at speed {evidence.slowest} under every lighting. Dashed: about the mean."
    )
    advice = "Curves that lie on each other speak for a lighting that makes no difference."
    colours = dict(
        zip(evidence.lightings, style.shades(evidence.colour[tracker], len(evidence.lightings)), strict=True)
    )
    series = Series("lighting", colours)
    return _figure(f"lighting-{evidence.slug(tracker)}", f"{tracker} by lighting", points, series, shows, advice)


def _cuts_differ(evidence: Evidence, tracker: str) -> str:
    """Warn that speeds were not trimmed at the same error: where few tracks live on, most errors are 0."""
    cuts = evidence.cuts(tracker)
    if cuts["cut"].n_unique() < 2:
        return ""
    told = listing(f"{px(row['cut'])} at speed {row['speed']}" for row in cuts.to_dicts())
    return f" Mind that trimming cut at {told}: some of the difference is the cut's."


def _kept(evidence: Evidence, points: pl.DataFrame, tracker: str) -> pl.DataFrame:
    return points.filter(tracker=tracker, trimming="trimmed", population=evidence.population)


def _figure(name: str, title: str, points: pl.DataFrame, series: Series, shows: str, advice: str) -> Figure | Absence:
    found = readings(points, series.field, list(series.colours))
    if not found:
        return Absence(
            name, title, "Beyond the first frame no age has enough features of known error, so there is no curve."
        )
    told = listing(f"{one.told('Phi')} for {series.field} {one.name}" for one in found)
    missing = [label for label in series.colours if label not in {one.name for one in found}]
    gap = f" No age has enough features for {series.field} {listing(missing)}." if missing else ""
    look_for = f"{when(found)} the root second moment is {told}.{gap} {advice}"
    return Figure(name, title, f"{shows} {_BOXES}", look_for, grid(points, series, boxes=True))


SPEED = Family(
    id="speeds",
    title="Error by age and speed",
    lead="What changes when the camera moves faster, or the tracker sees fewer frames.",
    figures=by_speed,
)
LIGHTING = Family(
    id="lightings",
    title="Error by age and lighting",
    lead="What changes when the same path is seen under other light.",
    figures=by_lighting,
)
