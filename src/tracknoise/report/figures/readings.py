"""Values of curves at one age or frame, for the sentences below a figure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import polars as pl

from tracknoise.findings.wording import listing, number, px
from tracknoise.report.axis import Axis
from tracknoise.report.figures.series import Series
from tracknoise.statistics.definitions import REFERENCE_AGE


@dataclass(frozen=True, slots=True)
class Reading:
    """Values of one curve at one age or frame.

    Attributes
    ----------
    name
        Of the curve.
    since
        Distance from where errors are zero by construction, in frames of the sequence.
    values
        Value in u and v of each statistic, by its role, px.
    """

    name: str
    since: int
    values: Mapping[str, tuple[float, float]]

    def describe(self, role: str) -> str:
        """Write the value of a statistic in both coordinates."""
        u, v = self.values[role]
        return f"{px(u)} in u and {px(v)} in v"


def readings(points: pl.DataFrame, series: Series) -> list[Reading]:
    """Values of all curves at the last age, up to the reference age, that they share.

    Where they share none, each is read at its own age nearest to the reference age. Nothing is read where errors are
    zero by construction. A curve without any other point has no reading.
    """
    curves = {name: points.filter(pl.col(series.field).cast(pl.String) == name) for name in series.colours}
    places = {name: set(curve.filter(pl.col("since") != 0, role="second")["since"]) for name, curve in curves.items()}
    places = {name: found for name, found in places.items() if found}
    shared = set.intersection(*places.values()) if places else set()
    common = {since for since in shared if 0 < since <= REFERENCE_AGE}
    return [_reading(name, curves[name], max(common) if common else _nearest(found)) for name, found in places.items()]


def when(found: Sequence[Reading], axis: Axis, *, phrase: str = "for {}") -> str:
    """Say where curves were read, as the start of a sentence. Each curve is named as in a `Series`."""
    places = {reading.since for reading in found}
    if len(places) == 1:
        return f"{axis.opening_place(places.pop())},"
    each = listing(f"{number(reading.since)} {phrase.format(reading.name)}" for reading in found)
    return f"{axis.opening_place(REFERENCE_AGE)} or the nearest available ({each}),"


def _nearest(places: set[int]) -> int:
    return min(places, key=lambda since: (abs(since - REFERENCE_AGE), since))


def _reading(name: str, curve: pl.DataFrame, since: int) -> Reading:
    values = {row["role"]: (row["u"], row["v"]) for row in curve.filter(since=since).to_dicts()}
    return Reading(name, since, values)
