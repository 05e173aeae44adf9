"""Curves of one tracker for every value of a factor, with box plots beside them: what several families show."""

import polars as pl

from tracknoise.findings.wording import px
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures.curve_grid import MANY, Reading, Series, bands_text, grid, readings, when
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.sentences import listing
from tracknoise.statistics.definitions import REFERENCE_AGE

_NAMES = {"mean": "mean error", "second": "root second moment"}


def comparison(
    evidence: Evidence,
    points: pl.DataFrame,
    series: Series,
    *,
    id: str,
    title: str,
    shows: str,
    advice: str,
    role: str = "second",
) -> Figure | Absence:
    """A figure of the tracks that trimming kept.

    Parameters
    ----------
    points
        Curves of one value of everything but `series.field`, trimmed and untrimmed, of every population.
    series
        The factor.
    id, title, shows
        Of the figure; what is said of box plots is added.
    advice
        What to look for, after the numbers.
    role
        Of which statistic numbers are told: mean or second.
    """
    kept = points.filter(trimming="trimmed", population=evidence.population)
    found = readings(kept, series)
    if not found:
        why = f"Where errors are not zero by construction no {evidence.axis.name} has enough features of known error, "
        return Absence(id, title, why + "so there is no curve.")
    missing = [label for label in series.colours if label not in {one.name for one in found}]
    no_curve = f" No {evidence.axis.name} has enough features {series.phrase.format(listing(missing))}."
    dashed = "Dashed: about the mean. " if len(series.colours) <= MANY else ""
    return Figure(
        id,
        title,
        f"{shows} {dashed}{bands_text(kept, series)} {_boxes(evidence)}",
        f"{_numbers(evidence, found, series, role)}{no_curve if missing else ''} {advice}",
        grid(kept, series, evidence.axis, boxes=True),
    )


def _boxes(evidence: Evidence) -> str:
    return (
        "The box plots beside the curves show the curves' own values over all "
        f"{evidence.axis.name}s drawn but {evidence.axis.zero}: orange line the median, green triangle the mean, "
        "whiskers to the last value within 1.5 interquartile ranges."
    )


def _numbers(evidence: Evidence, found: list[Reading], series: Series, role: str) -> str:
    """A statistic of every curve, or of the two that differ most where there are many."""
    place = when(found, evidence.axis, phrase=series.phrase)
    if len(found) <= MANY:
        told = listing(f"{one.told(role)} {series.phrase.format(one.name)}" for one in found)
        return f"{place} the {_NAMES[role]} is {told}."
    if len({reading.since for reading in found}) > 1:
        place = f"Where each comes nearest to {evidence.axis.place(REFERENCE_AGE).removeprefix('at ')}"
    ends = " and ".join(_range(evidence, found, series, role, coordinate) for coordinate in (0, 1))
    return f"{place} the {_NAMES[role]} lies {ends}."


def _range(evidence: Evidence, found: list[Reading], series: Series, role: str, coordinate: int) -> str:
    """The curves with the least and with the largest value in u (0) or v (1), and where, if not all are read there."""
    differ = len({reading.since for reading in found}) > 1
    ordered = sorted(found, key=lambda one: one.values[role][coordinate])
    ends = []
    for one in (ordered[0], ordered[-1]):
        place = f", {evidence.axis.place(one.since)}" if differ else ""
        ends.append(f"{px(one.values[role][coordinate])} ({series.phrase.format(one.name)}{place})")
    return f"in {'uv'[coordinate]} between {listing(ends)}"
