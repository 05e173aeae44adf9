"""What changed between runs: verdicts on every statistic of every condition that they share.

All statistics are differences within scenes, averaged over scenes of equal weight. Scales, shares of events, lifetimes
and counts are compared as ratios: geometric means over scenes. Two runs are the levels of a factor, and their changes
have a direction (`tracknoise.analysis.paired_tests`).

Statistics form families, each with the whole level: sizes (core, second moment and sigma for depths), ends of tracks
(lifetime and outlier ratio), and the others.

- `worse` or `better`: the p-value is at most 1 - level after Holm's correction over all rows of the family. The
  probability of any false claim in a family is then at most 1 - level, and what else is compared does not count.
- `no difference`: a change by the margin is excluded in both directions, at half of 1 - level and by Benjamini and
  Hochberg over all rows of the same statistic.
- `undecided`: all other cases.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.analysis.estimand import Estimand
from tracknoise.analysis.paired_tests import (
    AT_LEAST,
    DISAGREE,
    FALLS,
    GROWS,
    Change,
    ask,
    change,
    decided,
    mean_of_points,
    why_not_asked,
    why_open,
)
from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.multiple_tests import benjamini_hochberg, holm, in_families
from tracknoise.inference.paired_differences import Differences
from tracknoise.inference.units import MIN_SCENES, Resampled
from tracknoise.tables.defaults import MARGIN
from tracknoise.tables.enumerations import ChangeVerdict, ComparedAges, Verdict
from tracknoise.words import count, only, place


class OfEstimand:
    """Anything about one statistic."""

    __slots__ = ()
    estimand: Estimand

    @property
    def statistic(self) -> str:
        """Its name."""
        return self.estimand.name


@dataclass(frozen=True, slots=True)
class Compared:
    """What is compared: a condition and its trackers in two runs."""

    run: str  # name of the second run; the first is that of the comparison
    tracker: str  # in the first run
    other_tracker: str  # in the second run
    dataset: str
    lighting: str
    rotation: int
    direction: str
    camera: str
    speed: int


@dataclass(frozen=True, slots=True)
class Row(OfEstimand):
    """One statistic of one condition."""

    of: Compared
    estimand: Estimand
    verdict: ChangeVerdict
    why: str | None  # why the verdict is undecided, or what else is to be known of it
    # the second run over, or minus, the first in the unit of the estimand, and its interval; None without data
    effect: float | None
    low: float | None
    high: float | None
    margin: float | None  # largest change that counts as no difference, in the same unit
    # age (or distance from the key frame, or length of windows) and coordinate of the effect; None for the mean of all
    at: int | None
    coordinate: str | None
    at_low: int | None  # least and largest age, frame or length that was compared; None for single numbers
    at_high: int | None
    axis: str | None  # what these are: ``age``, ``frame`` or ``window``
    horizon: float | None  # of lifetimes, frames
    p_change: float | None  # P-value of the hypothesis that nothing changes by more than the margin
    p_adjusted: float | None  # the same by Holm over all rows of its family
    p_none: float | None  # P-value of the hypothesis that something changes by at least the margin
    n_scenes: int  # that were measured in both runs
    resampled: str | None  # what intervals are about: ``scenes``, ``groups`` of them, or scenes ``within`` their groups
    scenes: Mapping[str, float]  # the effect in every scene that has one


@dataclass(frozen=True, slots=True)
class GateRow(OfEstimand):
    """Outcome of one tolerance in one condition."""

    of: Compared
    estimand: Estimand
    tolerance: float  # largest change for the worse that passes: relative for ratios, otherwise in the unit
    outcome: str  # ``pass``, ``worse`` or ``undecided``
    why: str | None  # reason of an undecided outcome
    effect: float | None  # this and its interval as in `Row`
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class GateResult:
    """Outcome of a gate."""

    outcome: str  # ``pass`` if all rows pass, ``worse`` if one is worse, otherwise ``undecided``
    rows: tuple[GateRow, ...]  # one per tolerance and condition
    missing: tuple[str, ...]  # what a gate needs and the runs lack, one sentence each: it is never passed with any


def place_words(axis: str, at: int) -> str:
    """Write an age, a distance from the key frame or a length of windows, as in `Row`: ``at age 10``."""
    return f"in windows of {at}" if axis == "window" else place(axis, at)


UNSURE = "a larger change cannot be excluded at each age and coordinate"
"""Why an answer about several ages or coordinates is undecided."""


@dataclass(frozen=True, slots=True)
class Asked(OfEstimand):
    """A statistic of a condition in two runs."""

    of: Compared
    estimand: Estimand
    values: Differences  # second run minus first run
    scenes: Sequence[str]  # their names
    group: NDArray[np.intp]  # (scenes,): number of the group of each scene
    axis: str | None = None  # what the places of the values are

    @property
    def worse(self) -> int:
        """Direction of a change for the worse."""
        return FALLS if self.estimand.larger_is_better else GROWS

    @property
    def n_scenes(self) -> int:
        """Number of scenes that were measured in both runs."""
        return int(self.values.both.sum())

    @property
    def hides_worse(self) -> str | None:
        """Why a change for the worse could be larger than it looks; None if there is no such reason."""
        second, first = self.values.scarce[0]
        return None if self.until or (second and not first) else self.values.gap

    @property
    def until(self) -> str | None:
        """Up to what horizon lifetimes are those asked for, where most tracks outlive it; otherwise None."""
        horizon, gap = self.values.horizon[0], self.values.gap
        return None if gap is None or np.isnan(horizon) else f"up to {horizon:g} frames; {gap}"

    def tested(self, margin: float, *, level: float, ages: ComparedAges) -> "Tested":
        """Test both directions against a margin, of logarithms for ratios and otherwise in the unit."""
        question = ask(self.values.both, self.group, margin=margin, level=level)
        if question is None:
            few = f"{only(self.n_scenes, 'scene')} with data in both runs; {AT_LEAST}"
            return Tested(self, gap=few if self.n_scenes < MIN_SCENES else why_not_asked(self.values.both, self.group))
        tests, gap = change(self.values, question, ages), None
        if tests is None:
            with_data = int((~np.isnan(self.values.values)).sum(axis=0).max(initial=0))  # at one place
            few = f"{with_data} of {count(self.n_scenes, 'scene')} with enough data in both runs; {AT_LEAST}"
            gap = self.values.gap or few
        elif tests.kinds_disagree:
            gap = f"{DISAGREE} {' and '.join(dict.fromkeys((self.of.tracker, self.of.other_tracker)))}"
        elif (self.values.unlike[0] & tests.compared).any():
            gap = "a value of 0 in one of the runs, which has no ratio"
        return Tested(self, tests, gap, question.resampled)


@dataclass(frozen=True, slots=True)
class Tested:
    """Outcome of the tests of a question."""

    asked: Asked
    change: Change | None = None  # tests and effect; None without enough data
    gap: str | None = None  # why nothing can be shown to be within the margin, or that kinds of references disagree
    resampled: Resampled | None = None  # what intervals are about

    def columns(self) -> dict[str, Any]:
        """Columns of a row that do not depend on the verdict."""
        asked, values = self.asked, self.asked.values
        return {
            **dict.fromkeys(("effect", "low", "high", "coordinate", "at_low", "at_high")),
            "at": values.place(0) if values.values.shape[2] == 1 else None,  # a single value is not a mean over places
            **(self._without_tests() if self.change is None else self._effect(self.change)),
            "axis": asked.axis,
            "horizon": known(values.horizon[0]),
            "n_scenes": asked.n_scenes,
            "resampled": None if self.resampled is None else str(self.resampled),
        }

    def _effect(self, tests: Change) -> dict[str, Any]:
        """Effect, interval and place of a change that was tested."""
        values, of = self.asked.values, self.asked.estimand.unit.of
        columns: dict[str, Any] = {name: known(of(getattr(tests, name))) for name in ("effect", "low", "high")}
        second, first = values.scarce[0]
        if (first and tests.effect > 0) or (second and tests.effect < 0):
            columns["high" if tests.effect > 0 else "low"] = None
        if tests.point is not None:
            columns |= {"at": values.place(tests.point), "coordinate": values.coordinate(tests.point)}
        elif tests.coordinate is not None:
            columns["coordinate"] = values.coordinate(tests.coordinate)
        at_low, at_high = (values.place(int(point)) for point in np.flatnonzero(tests.compared)[[0, -1]])
        return {**columns, "at_low": at_low, "at_high": at_high, "scenes": self._by_scene(tests.scenes)}

    def _without_tests(self) -> dict[str, Any]:
        """Mean change of scenes that are too few for a test; of mean errors, none."""
        values = self.asked.values.values[:, 0]
        scenes = mean_of_points(values, np.ones(values.shape[1], dtype=np.bool_))
        there = scenes[~np.isnan(scenes)]
        if self.asked.values.total is not None or not len(there):
            return {"scenes": {}}
        return {"effect": known(self.asked.estimand.unit.of(float(there.mean()))), "scenes": self._by_scene(scenes)}

    def _by_scene(self, changes: NDArray[np.float64]) -> dict[str, float]:
        """Changes in the unit of the statistic, of scenes that have one."""
        pairs, of = zip(self.asked.scenes, changes, strict=True), self.asked.estimand.unit.of
        return {name: of(float(change)) for name, change in pairs if not np.isnan(change)}

    def verdict(self, adjusted: float, q_none: float, margin: float, level: float) -> tuple[ChangeVerdict, str | None]:
        """The verdict by adjusted p-values, and why it is undecided, or a remark."""
        tests = self.change
        if tests is None:
            return ChangeVerdict.undecided, self.gap
        gap = self.gap or self.asked.values.gap
        differs = decided(tests.p_none, adjusted, q_none, level, has_gap=gap is not None)
        if differs == Verdict.yes:
            is_worse = tests.direction == self.asked.worse
            return ChangeVerdict.worse if is_worse else ChangeVerdict.better, self._contrary(tests, level)
        if differs == Verdict.no:
            return ChangeVerdict.none, None
        contains = tests.straddles(margin)
        why = why_open(tests.p_change, tests.p_none, level, contains=contains, otherwise=UNSURE)
        return ChangeVerdict.undecided, gap or why

    def _contrary(self, tests: Change, level: float) -> str | None:
        """A remark where single ages changed in the other direction."""
        other = tests.sides[-tests.direction]
        if other.p_beyond > 1 - level or other.point is None:
            return None
        at = self.asked.values.place(other.point)
        where = "elsewhere" if self.asked.axis is None or at is None else place_words(self.asked.axis, at)
        return f"the change has the opposite sign {where}"


def known(value: float) -> float | None:
    """A finite number; None for others."""
    return float(value) if np.isfinite(value) else None


def verdicts(
    asked: Sequence[Asked], *, margin: float = MARGIN, level: float = LEVEL, ages: ComparedAges = ComparedAges.every
) -> list[Row]:
    """One row per question, in their order.

    Parameters
    ----------
    asked
        All questions of a comparison.
    margin
        Largest relative change that counts as no difference: 0.1 for ratios of 1.1, for mean errors 10 % of the core,
        and for shares 0.02.
    level
        Probability that an interval contains the true change; any false claim in a family has a probability of at most
        1 - level.
    ages
        Whether single ages are tested besides their mean.
    """
    margins = [one.estimand.unit.margin(margin, one.values.scale_px) for one in asked]
    tested = [one.tested(limit, level=level, ages=ages) for one, limit in zip(asked, margins, strict=True)]
    p_change = [None if one.change is None else one.change.p_change for one in tested]
    p_none = [None if one.change is None else one.change.p_none for one in tested]
    statistics = [one.statistic for one in asked]
    adjusted = in_families(holm, p_change, [one.estimand.values.family for one in asked])
    q_none = in_families(benjamini_hochberg, p_none, statistics)
    rows = []
    for number, (one, tests) in enumerate(zip(asked, tested, strict=True)):
        verdict, why = tests.verdict(adjusted[number], q_none[number], margins[number], level)
        numbers: dict[str, Any] = {
            "margin": known(one.estimand.unit.of(margins[number])),
            "p_change": p_change[number],
            "p_adjusted": known(adjusted[number]),
            "p_none": p_none[number],
        }
        rows.append(Row(one.of, one.estimand, verdict, why, **numbers, **tests.columns()))
    return rows
