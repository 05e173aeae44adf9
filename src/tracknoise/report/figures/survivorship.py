"""Error of the tracks that live long, beside that of all."""

from collections.abc import Sequence

import polars as pl

from tracknoise.findings.wording import number
from tracknoise.report import style
from tracknoise.report.axis import FRAME
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures.curve_grid import Reading, Series, bands_text, grid, readings, when
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.statistics.definitions import LONG_LIVED_AGES
from tracknoise.tables.enumerations import Aspect

_ALL = "all"
_NAMES = {age: f"to age {age}" for age in LONG_LIVED_AGES}
"""Name of the tracks that live to each age."""


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """One figure a tracker at the lowest speed."""
    return [_survivors_of(evidence, tracker) for tracker in evidence.trackers]


def _survivors_of(evidence: Evidence, tracker: str) -> Figure | Absence:
    points = _points(evidence, tracker)
    series = _series(points, evidence.colour[tracker])
    name, title = f"survivorship-{evidence.slug(tracker)}", f"{tracker}, by how long tracks live"
    found = _longest_beside_all(evidence, points)
    if not found:
        why = f"No {evidence.axis.name} has enough features whose tracks live to age {LONG_LIVED_AGES[0]}"
        return Absence(name, title, f"{why} or beyond, so there is nothing to set beside all tracks.")
    chart = grid(points, series, evidence.axis, boxes=False)
    shows = f"{_shows(evidence, tracker)} {bands_text(points, series)}"
    return Figure(name, title, shows, _look_for(evidence, points, found), chart)


def _points(evidence: Evidence, tracker: str) -> pl.DataFrame:
    """Trimmed curves of visible features, by `tracks`; without moments about the mean, for there are many curves."""
    every = evidence.points.filter(population="visible").with_columns(tracks=pl.lit(_ALL))
    chosen = evidence.aspect_points.filter(aspect=Aspect.long_lived)
    chosen = chosen.with_columns(tracks=pl.col("at_least").replace_strict(_NAMES, return_dtype=pl.String))
    both = pl.concat([every, chosen.select(every.columns)])
    return evidence.nominal(both).filter(pl.col("role") != "central", tracker=tracker, trimming="trimmed")


def _series(points: pl.DataFrame, colour: str) -> Series:
    """The groups of tracks that have a curve, in shades that are as far apart as their number allows."""
    present = [name for name in (_ALL, *_NAMES.values()) if name in points["tracks"].unique()]
    return Series("tracks", dict(zip(present, style.shades(colour, len(present)), strict=True)))


def _longest_beside_all(evidence: Evidence, points: pl.DataFrame) -> list[Reading]:
    """All tracks and those that live longest, at a place where some do not; empty where there is no such place."""
    for age in reversed(LONG_LIVED_AGES):
        pair = Series("tracks", dict.fromkeys((_ALL, _NAMES[age]), ""))
        younger = points if evidence.axis is FRAME else points.filter(pl.col("since") < age)
        found = readings(younger, pair)
        if len(found) == 2 and found[0].since == found[1].since:
            return found
    return []


def _shows(evidence: Evidence, tracker: str) -> str:
    joined = "" if evidence.axis is FRAME else " From that age on a curve is that of all tracks."
    return (
        f"{evidence.errors_kept} of {tracker} at speed {evidence.slowest}{evidence.where}, of features that could be "
        f"seen: of all tracks, and at every {evidence.axis.name} of those that were seen at a certain age or later, "
        f"frames of the sequence.{joined}"
    )


def _look_for(evidence: Evidence, points: pl.DataFrame, found: Sequence[Reading]) -> str:
    every, longest = found
    n, n_all = (int(points.filter(tracks=one.name, since=one.since, role="second")["n"].sum()) for one in found[::-1])
    return (
        f"{when(found, evidence.axis)} the root second moment is {every.told('second')} for all tracks, and "
        f"{longest.told('second')} for those that live {longest.name}, {number(n)} of {number(n_all)} features. Where "
        "tracks that live long err less than all do at the same place, part of a curve that flattens further on is "
        "that bad tracks have left: it is no promise for a track that is followed on."
    )


FAMILY = Family(
    id="survivorship",
    title="Survivors",
    lead="A tracker that loses its worst features first is left with its best: what lives long is no sample of what "
    "began.",
    figures=figures,
)
