"""Which of a run's many numbers its headlines are about, and these numbers with their intervals."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import polars as pl

from tracknoise.findings.wording import place, view_text
from tracknoise.statistics.definitions import NAMES
from tracknoise.statistics.factors import ReferenceCondition
from tracknoise.tables.enumerations import Aspect
from tracknoise.tables.schema import VIEW

Found: TypeAlias = tuple[float, float | None, float | None]
"""A number, and the bounds of its interval."""


@dataclass(frozen=True, slots=True)
class Scope:
    """The conditions that headlines are about: every tracker in the reference view at the lowest speed.

    Parameters
    ----------
    reference
        The view and the speed; the key frames, where curves run along frames.
    trackers
        Names, in the order in which they are told.
    population
        Which observations errors are of: `visible` or `projected`.
    percentile
        Percentile of the tracks' largest error above which they were dropped; None where none was.
    recorded
        Whether true positions come from recorded poses and depth, whose own errors are inside every number.
    """

    reference: ReferenceCondition
    trackers: Sequence[str]
    population: str = "visible"
    percentile: float | None = None
    recorded: bool = False

    @property
    def axis(self) -> str:
        """What curves run along: frame where there are key frames, otherwise age."""
        return "frame" if self.reference.key_frames else "age"

    @property
    def trimmings(self) -> tuple[str, ...]:
        """What is told apart by trimming, the tracks that an experiment is about first."""
        return ("untrimmed",) if self.percentile is None else ("trimmed", "untrimmed")

    def of(self, table: pl.DataFrame, tracker: str) -> pl.DataFrame:
        """Rows of a tracker's condition."""
        chosen = {name: getattr(self.reference, name) for name in (*VIEW, "speed")}
        return table.filter(tracker=tracker, **chosen)

    def since(self, at: int) -> int:
        """Distance of an age or a frame from where errors are zero, in frames of the sequence."""
        return at - self.reference.key_frames.get(self.reference.direction, 0)

    def place(self, at: int) -> str:
        """Write an age or a frame by its distance from where errors are zero."""
        return place(self.axis, self.since(at))

    def where(self, conditions: pl.DataFrame) -> str:
        """Write the speed, and the parts of the view of which `conditions` have several."""
        several = [name for name in VIEW if conditions[name].n_unique() > 1]
        view = {name: getattr(self.reference, name) for name in VIEW}
        return f"at speed {self.reference.speed}{view_text(view, several)}"


@dataclass(frozen=True, slots=True)
class Estimate:
    """A number with the bounds of its interval; None where it has none, or none on that side."""

    value: float
    low: float | None = None
    high: float | None = None
    unit: str = "px"

    @classmethod
    def of(cls, value: float, found: "Found | None", unit: str = "px") -> "Estimate":
        """A number with the bounds that were found for it, if any."""
        return cls(value, *((None, None) if found is None else found[1:]), unit)


def curve_bounds(
    intervals: pl.DataFrame,
    scope: Scope,
    role: str,
    at: int,
    coordinate: str,
    *,
    trimming: str = "trimmed",
    weighting: str = "features",
    aspect: Aspect = Aspect.all,
    at_least: int | None = None,
) -> Found | None:
    """Value and bounds of a point of a curve; None where there is no interval, roots where it is a second moment.

    Parameters
    ----------
    intervals
        Rows of one condition.
    role
        Of the statistic, as in `tracknoise.statistics.curves.NAMES`.
    at, coordinate, trimming, weighting, aspect, at_least
        As in the table.
    """
    found = intervals.filter(
        pl.col("at_least").eq_missing(at_least),
        aspect=aspect,
        population=scope.population,
        trimming=trimming,
        weighting=weighting,
        statistic=NAMES[scope.axis][role],
        axis=scope.axis,
        at=at,
        coordinate=coordinate,
    )
    if role in ("second", "central"):
        found = found.with_columns(pl.col("value", "low", "high").clip(lower_bound=0.0).sqrt())
    return _bounds(found)


def scalar_bounds(intervals: pl.DataFrame, statistic: str) -> Found | None:
    """Value and bounds of a statistic that is one number a condition; None where there is no interval.

    Parameters
    ----------
    intervals
        Rows of one condition.
    statistic
        As in the table.
    """
    return _bounds(intervals.filter(statistic=statistic))


def _bounds(found: pl.DataFrame) -> Found | None:
    known = found.drop_nulls("value").filter(pl.col("low").is_not_null() | pl.col("high").is_not_null())
    return known.select("value", "low", "high").row(0) if known.height else None
