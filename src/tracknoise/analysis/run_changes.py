"""What changed between two runs: paired values, tests, and the rows of the result.

All statistics are differences within scenes, averaged over scenes of equal weight. Scales, shares of events, lifetimes
and counts are compared as ratios: geometric means over scenes.

Each direction has a test of its own, as in `tracknoise.analysis.factors`. A fall is the growth of the negative change.

- Does any point grow by more than the margin? First, each scene's mean over all points is tested, then the single
  points: p_beyond = min(p_1 / 0.8, p_2 / 0.2) (two-stage).
- Is the growth below the margin at every single point? p_within is the largest p-value of all points (intersection and
  union).

For the size of a mean error, let x and y be the mean errors of the first and the second run, d = y - x their difference
and s = y + x their sum. As

    |y| - |x| = min(|d|, |s|) if d and s have one sign, else -min(|d|, |s|)      (size of a mean)

the size grew by more than the margin only if both d and s exceed it with one sign, and fell only if they exceed it with
different signs. d and s are means over scenes, so that each of the two has Student's t test. Both must be significant
(intersection and union). That the change is below the margin is shown by either of them, at half of the level.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tracknoise.analysis.factor_values import DISAGREE
from tracknoise.analysis.factors import OVERALL_SHARE, Question, ask, enough_scenes
from tracknoise.analysis.paired_values import PairedValues
from tracknoise.inference.multiple_tests import best_by_chance
from tracknoise.inference.paired_differences import (
    Averages,
    average,
    best_of_few,
    best_of_many,
    half_widths,
    half_widths_alone,
    p_of_best,
    standard_errors,
    taking_part,
    upper_tail,
)
from tracknoise.inference.units import MIN_SCENES, MIN_WITHIN, Resampled
from tracknoise.tables.enumerations import ChangeVerdict, ComparedAges
from tracknoise.tables.quantities import QUANTITIES, RATIOS, Better, ComparedBy
from tracknoise.tables.trust import TruthVerdict
from tracknoise.words import count, only, place


class Unit(StrEnum):
    """Unit of an effect: a ratio, px, or a difference of shares."""

    ratio = "ratio"
    px = "px"
    share = "share"


@dataclass(frozen=True, slots=True)
class Estimand:
    """One statistic.

    Attributes
    ----------
    title
        For readers.
    meaning
        What is estimated.
    unit
        Unit of the effect.
    larger_is_better
        Whether a larger value is better.
    """

    title: str
    meaning: str
    unit: Unit = Unit.ratio
    larger_is_better: bool = False


_MEAN = "geometric mean over scenes, ages (or frames) and both coordinates"
_TAP = "as TAP-Vid defines it for images of 256 x 256 pixels, mean over scenes"

ESTIMANDS: Mapping[str, Estimand] = {
    "core": Estimand("core of the errors", f"Robust standard deviation of the errors of a scene: {_MEAN}."),
    "second_moment": Estimand("second moment", f"Second moment of all errors about zero, untrimmed: {_MEAN}."),
    "bias": Estimand(
        "bias",
        "Size of the mean error in u or v, mean over scenes, at the age (or frame) that changed most clearly.",
        Unit.px,
    ),
    "tails": Estimand(
        "tails",
        "Share of the errors of a scene that are larger than three cores of their age, all ages together: geometric "
        "mean over scenes and both coordinates.",
    ),
    "growth": Estimand(
        "growth",
        "Factor by which the second moment grows from the youngest to the oldest age, by a straight line through "
        "logarithms: geometric mean over scenes and both coordinates.",
    ),
    "outlier_ratio": Estimand(
        "outlier ratio", "Features rejected as outliers, divided by features offered: geometric mean over scenes."
    ),
    "lifetime": Estimand(
        "lifetime",
        "Restricted mean lifetime to a horizon that all scenes reach in both runs: geometric mean over scenes.",
        larger_is_better=True,
    ),
    "feature_count": Estimand(
        "feature count", "Mean number of features per frame: geometric mean over scenes.", larger_is_better=True
    ),
    "consistent_sigma": Estimand(
        "sigma for depths",
        "Consistent sigma, which makes depths of points right, of the longest windows up to 15 observations that "
        "enough scenes of both runs have: geometric mean over scenes.",
    ),
    "residual_sigma": Estimand(
        "residual core",
        "Residual core of windows of observations: geometric mean over scenes and lengths of windows.",
    ),
    "overconfidence": Estimand(
        "overconfidence",
        "Consistent sigma of windows, divided by their residual core: geometric mean over scenes and lengths.",
    ),
    "tap_delta_avg": Estimand("position accuracy (TAP)", f"Delta average, {_TAP}.", Unit.share, larger_is_better=True),
    "tap_delta_avg_reported": Estimand(
        "accuracy of reported positions",
        f"Delta average of the positions that are reported as visible, {_TAP}.",
        Unit.share,
        larger_is_better=True,
    ),
    "tap_average_jaccard": Estimand(
        "average Jaccard (TAP)", f"Average Jaccard, {_TAP}.", Unit.share, larger_is_better=True
    ),
    "tap_occlusion_accuracy": Estimand(
        "occlusion accuracy (TAP)", f"Occlusion accuracy, {_TAP}.", Unit.share, larger_is_better=True
    ),
    "expected_feature_age": Estimand(
        "expected feature age",
        "Share of its visible time for which a point is tracked, in images of 256 x 256 pixels, mean over scenes.",
        Unit.share,
        larger_is_better=True,
    ),
    **{
        name: Estimand(
            QUANTITIES[name].title.lower(),
            f"{QUANTITIES[name].estimand} Untrimmed, mean over scenes and ages.",
            Unit.ratio if QUANTITIES[name].compared == ComparedBy.ratio else Unit.share,
            larger_is_better=QUANTITIES[name].better == Better.larger,
        )
        for name in RATIOS
        if QUANTITIES[name].compared != ComparedBy.none
    },
}
"""By name, in the order in which they are reported."""
OF_ERRORS = ("core", "second_moment", "bias", "tails", "growth", *RATIOS)
"""Statistics of errors. Without meaning where true positions are fitted to the tracks."""


class OfStatistic:
    """Anything about one of the `ESTIMANDS`.

    Attributes
    ----------
    statistic
        Its name.
    """

    __slots__ = ()
    statistic: str

    @property
    def estimand(self) -> Estimand:
        """What is estimated."""
        return ESTIMANDS[self.statistic]


GROWS, FALLS = 1, -1


@dataclass(frozen=True, slots=True)
class OneSided:
    """Tests of one direction.

    Attributes
    ----------
    p_beyond
        P-value of the hypothesis that no point changes by more than the margin in this direction.
    p_within
        P-value of the hypothesis that some point changes by at least the margin in this direction.
    point
        Which point decides; None for the mean over all of them.
    """

    p_beyond: float
    p_within: float
    point: int | None


@dataclass(frozen=True, slots=True)
class Change:
    """What was found about one statistic.

    Attributes
    ----------
    effect, low, high
        Change from the first run to the second, and its interval: of the mean over all points, or of the point that
        decides.
    point
        That point; None for the mean.
    sides
        Tests by direction: `GROWS` and `FALLS`.
    compared : (points,) bool
        Points that enough scenes have.
    scenes : (scenes,) float64
        The same change in every scene, NaN where it has none.
    coordinate
        0 for u and 1 for v, if it is the mean over all places of one coordinate; None otherwise.
    """

    effect: float
    low: float
    high: float
    point: int | None
    sides: Mapping[int, OneSided]
    compared: NDArray[np.bool_]
    scenes: NDArray[np.float64]
    coordinate: int | None = None

    @property
    def p_change(self) -> float:
        """P-value of the hypothesis that nothing changes by more than the margin."""
        return min(side.p_beyond for side in self.sides.values())

    @property
    def p_none(self) -> float:
        """P-value of the hypothesis that something changes by at least the margin."""
        return max(side.p_within for side in self.sides.values())

    @property
    def direction(self) -> int:
        """The direction whose test is the more significant."""
        return min(self.sides, key=lambda sign: self.sides[sign].p_beyond)

    def held_by(self, others: Sequence["Change | None"]) -> "Change":
        """With p-values that hold by others too, such as by references of each kind alone."""
        sides = dict(self.sides)
        for sign, side in sides.items():
            same = [OneSided(1.0, 1.0, None) if one is None else one.sides[sign] for one in others]
            beyond, within = (max(getattr(one, name) for one in (side, *same)) for name in ("p_beyond", "p_within"))
            sides[sign] = replace(side, p_beyond=beyond, p_within=within)
        return replace(self, sides=sides)

    def decides(self, level: float) -> bool:
        """Whether this alone, before corrections for several questions, shows a change, or that there is none."""
        return self.p_change <= 1 - level or self.p_none <= (1 - level) / 2


def change_of(values: NDArray[np.float64], question: Question, ages: ComparedAges) -> Change | None:
    """Test both directions; None where no point has enough scenes.

    Shapes: values (scenes, points). `values`: second run minus first run, NaN where there is none.
    """
    every = average(values, question.group, question.resampled)
    compared = enough_scenes(every, question.resampled)
    if not compared.any():
        return None
    scenes = mean_of_points(values, compared)
    overall = average(scenes[:, None], question.group, question.resampled)
    points = every.of(compared) if ages == ComparedAges.every else overall
    place = np.flatnonzero(compared)
    sides = {sign: _one_sided(overall, points, place, question, sign) for sign in (GROWS, FALLS)}
    point = min(sides.values(), key=lambda side: side.p_beyond).point
    if point is None:
        effect, width = overall.mean[0], half_widths_alone(overall, 1 - question.level)[0]
    else:
        chosen = int(np.searchsorted(place, point))
        effect, width = points.mean[chosen], half_widths(points, question.directions, 1 - question.level)[chosen]
        scenes = values[:, point]
    return Change(float(effect), float(effect - width), float(effect + width), point, sides, compared, scenes)


def mean_of_points(values: NDArray[np.float64], compared: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Each scene's mean over the points that it has among those that are compared, (scenes,); NaN where it has none."""
    there = ~np.isnan(values) & compared
    count = there.sum(axis=1)
    return np.asarray(np.where(there, values, 0.0).sum(axis=1) / np.where(count > 0, count, np.nan))


def _one_sided(overall: Averages, points: Averages, place: NDArray[np.intp], question: Question, sign: int) -> OneSided:
    of_mean = best_of_few(_towards(overall, sign), question.margin, question.directions).p
    within = float(_tail_below(points, question.margin, sign).max())
    if len(points.mean) == 1:
        return OneSided(of_mean, within, None)
    rest = 1 - OVERALL_SHARE
    p_overall = min(of_mean / OVERALL_SHARE, 1.0)
    single = best_of_many(_towards(points, sign), question.margin, question.directions, needed=rest * p_overall)
    p_single = single.p / rest
    at_point = p_single <= 1 - question.level < p_overall
    return OneSided(min(p_overall, p_single, 1.0), within, int(place[single.chosen]) if at_point else None)


def _towards(found: Averages, sign: int) -> Averages:
    """The same with no change where it is in the other direction."""
    return replace(found, mean=np.maximum(sign * found.mean, 0.0))


def _tail_below(found: Averages, margin: float, sign: int) -> NDArray[np.float64]:
    """P-values of the hypotheses that a change in one direction is at least the margin."""
    return upper_tail((margin - sign * found.mean) / standard_errors(found, margin), found.degrees)


def bias_change(
    change: NDArray[np.float64], total: NDArray[np.float64], question: Question, ages: ComparedAges
) -> Change | None:
    """Test both directions; None where no point has enough scenes.

    Shapes: change, total (scenes, points). `change, total`: mean errors of the second run minus, and plus, those of the
    first, px, NaN where there are none.
    """
    compared = enough_scenes(average(change, question.group, question.resampled), question.resampled)
    if not compared.any():
        return None
    if ages == ComparedAges.mean:
        parts, place = [_mean_of_places(array, compared) for array in (change, total)], None
    else:
        parts, place = [array[:, compared] for array in (change, total)], np.flatnonzero(compared)
    both = average(np.concatenate(parts, axis=1), question.group, question.resampled)
    by_chance = best_by_chance(*taking_part(both, question.directions))
    tests = {sign: _beyond(both, question.margin, sign) for sign in (GROWS, FALLS)}
    chosen = int(np.argmin(np.minimum(*tests.values())))
    point = None if place is None else int(place[chosen])
    sides = {
        sign: OneSided(_corrected(p.min(), by_chance, both), _within(both, question.margin, sign), point)
        for sign, p in tests.items()
    }
    effect, low, high = _sizes(both, chosen, question)
    scenes = _growth(parts[0][:, chosen], parts[1][:, chosen])
    return Change(effect, low, high, point, sides, compared, scenes, chosen if place is None else None)


def _mean_of_places(values: NDArray[np.float64], compared: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Mean of each scene over the places that are compared, (scenes, 2)."""
    known = np.where(compared, values, np.nan).reshape(len(values), -1, 2)
    there = ~np.isnan(known)
    count = there.sum(axis=1)
    return np.asarray(np.where(there, known, 0.0).sum(axis=1) / np.where(count > 0, count, np.nan))


def _split(values: NDArray[np.float64], sign: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Differences, and sums with their sign turned for a fall, of both kinds one after the other."""
    change, total = np.split(values, 2)
    return change, sign * total


def _beyond(both: Averages, margin: float, sign: int) -> NDArray[np.float64]:
    """P-values of the hypotheses that a size does not change by more than the margin in a direction, (points,)."""
    change, total = _split(both.mean, sign)
    error_change, error_total = np.split(standard_errors(both, margin), 2)
    degrees = np.split(both.degrees, 2)[0]
    sides = [
        np.maximum(
            upper_tail((side * change - margin) / error_change, degrees),
            upper_tail((side * total - margin) / error_total, degrees),
        )
        for side in (1, -1)
    ]
    return np.asarray(np.minimum(2 * np.minimum(*sides), 1.0), dtype=np.float64)


def _within(both: Averages, margin: float, sign: int) -> float:
    """Largest p-value of the hypotheses that a size changes by at least the margin in a direction."""
    change, total = _split(both.mean, sign)
    error_change, error_total = np.split(standard_errors(both, margin), 2)
    degrees = np.split(both.degrees, 2)[0]
    sides = [
        np.minimum(
            upper_tail((margin - side * change) / error_change, degrees),
            upper_tail((margin - side * total) / error_total, degrees),
        )
        for side in (1, -1)
    ]
    return float(np.minimum(2 * np.maximum(*sides), 1.0).max())


def _corrected(p: float, by_chance: NDArray[np.float64], both: Averages) -> float:
    """P-value of the best of all points."""
    as_small = int(np.searchsorted(by_chance, p, side="right"))
    return min(p_of_best(float(p), as_small, len(by_chance), len(both.mean)), 1.0)


def _sizes(both: Averages, chosen: int, question: Question) -> tuple[float, float, float]:
    """Change of the size of a mean at a point, and its bounds from those of the difference and of the sum."""
    width = half_widths(both, question.directions, 1 - question.level)
    corners = [np.split(both.mean + side * width, 2) for side in (-1, 1)]
    sizes = [_growth(low[chosen], high[chosen]) for low in _of(corners, 0) for high in _of(corners, 1)]
    change, total = np.split(both.mean, 2)
    return float(_growth(change[chosen], total[chosen])), float(min(sizes)), float(max(sizes))


def _of(corners: list[list[NDArray[np.float64]]], part: int) -> list[NDArray[np.float64]]:
    return [corner[part] for corner in corners]


def _growth(change: NDArray[np.float64], total: NDArray[np.float64]) -> NDArray[np.float64]:
    """By (size of a mean)."""
    return np.asarray((np.abs(total + change) - np.abs(total - change)) / 2)


@dataclass(frozen=True, slots=True)
class Compared:
    """What is compared: a condition and its trackers in two runs.

    Attributes
    ----------
    run
        Name of the second run. The first is that of the comparison.
    tracker, other_tracker
        Name of the tracker in the first and in the second run.
    dataset, lighting, rotation, direction, camera, speed
        The condition.
    """

    run: str
    tracker: str
    other_tracker: str
    dataset: str
    lighting: str
    rotation: int
    direction: str
    camera: str
    speed: int


@dataclass(frozen=True, slots=True)
class Row(OfStatistic):
    """One statistic of one condition.

    Attributes
    ----------
    of
        What is compared.
    statistic
        A key of `ESTIMANDS`.
    verdict, why
        The answer, and why it is undecided, or what else is to be known of it.
    effect, low, high
        Second run over, or minus, the first in the unit of the estimand, and its interval. None without data.
    margin
        Largest change that counts as no difference, in the same unit.
    at, coordinate
        Age (or distance from the key frame, or length of windows) and coordinate of the effect; None for the mean over
        all.
    at_low, at_high
        Least and largest age, frame or length of windows that was compared; None for single numbers.
    axis
        What these are: ``age``, ``frame`` or ``window``; None for single numbers.
    horizon
        Horizon of lifetimes, frames.
    p_change, p_adjusted
        P-value of the hypothesis that nothing changes by more than the margin, and that by Holm over all rows of its
        family (`tracknoise.analysis.factors.family`).
    p_none
        P-value of the hypothesis that something changes by at least the margin.
    n_scenes
        Scenes that were measured in both runs.
    resampled
        What intervals are about: ``scenes``, ``groups`` of scenes, or scenes ``within`` their groups.
    scenes
        The effect in every scene that has one.
    """

    of: Compared
    statistic: str
    verdict: ChangeVerdict
    why: str | None
    effect: float | None
    low: float | None
    high: float | None
    margin: float | None
    at: int | None
    coordinate: str | None
    at_low: int | None
    at_high: int | None
    axis: str | None
    horizon: float | None
    p_change: float | None
    p_adjusted: float | None
    p_none: float | None
    n_scenes: int
    resampled: str | None
    scenes: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class RunSide:
    """One of the runs.

    Attributes
    ----------
    name
        Name by which rows refer to it.
    path
        Its folder.
    differs
        Settings and versions of packages that differ from those of the first run: name, there, here.
    notes
        What the comparison leaves out, one sentence each.
    truth
        The verdict on the truth of the run.
    """

    name: str
    path: str
    differs: tuple[tuple[str, str, str], ...] = ()
    notes: tuple[str, ...] = ()
    truth: TruthVerdict = field(default_factory=TruthVerdict)


@dataclass(frozen=True, slots=True)
class GateRow(OfStatistic):
    """Outcome of one tolerance in one condition.

    Attributes
    ----------
    of, statistic
        As in `Row`.
    tolerance
        Largest change for the worse that passes: relative for ratios, otherwise in the unit.
    outcome
        ``pass``, ``worse`` or ``undecided``.
    why
        Reason of an undecided outcome.
    effect, low, high
        As in `Row`.
    """

    of: Compared
    statistic: str
    tolerance: float
    outcome: str
    why: str | None
    effect: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class GateResult:
    """Outcome of a gate.

    Attributes
    ----------
    outcome
        ``pass`` if all rows pass, ``worse`` if one is worse, otherwise ``undecided``.
    rows
        One per tolerance and condition.
    missing
        What a gate needs and the runs lack, one sentence each; with any of them, the outcome is never ``pass``.
    """

    outcome: str
    rows: tuple[GateRow, ...]
    missing: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Runs compared with the first of them.

    Attributes
    ----------
    first
        The run that the others are compared with.
    others
        The others.
    rows
        One per statistic, condition and run.
    margin, level, ages
        How verdicts were made.
    gate
        Outcome of the gate, if there was one.
    """

    first: RunSide
    others: tuple[RunSide, ...]
    rows: tuple[Row, ...]
    margin: float
    level: float
    ages: ComparedAges
    gate: GateResult | None = None

    @property
    def doubts(self) -> tuple[str, ...]:
        """What is said of the truth of each run whose truth is not trusted, or of which this is unknown."""
        sides = (self.first, *self.others)
        return tuple(f"{side.name}: {side.truth.sentence}" for side in sides if not side.truth.is_usable)


def place_words(axis: str, at: int) -> str:
    """Write an age, a distance from the key frame or a length of windows: ``at age 10``, ``in windows of 5``.

    Parameters
    ----------
    axis, at
        As in `Row`.
    """
    return f"in windows of {at}" if axis == "window" else place(axis, at)


_FEW = f"at least {MIN_SCENES} are needed"


@dataclass(frozen=True, slots=True)
class Asked(OfStatistic):
    """A statistic of a condition in two runs.

    Attributes
    ----------
    of
        What is compared.
    statistic
        A key of `ESTIMANDS`.
    values
        Paired by scene.
    scenes
        Names of the scenes.
    group : (scenes,)
        Number of the group of each scene.
    axis
        What the places of the values are.
    by_kind
        The values by each kind of reference tracks alone; none where poses were not refined.
    """

    of: Compared
    statistic: str
    values: PairedValues
    scenes: Sequence[str]
    group: NDArray[np.intp]
    axis: str | None = None
    by_kind: Sequence[PairedValues] = ()

    @property
    def worse(self) -> int:
        """Direction of a change for the worse."""
        return FALLS if self.estimand.larger_is_better else GROWS

    @property
    def n_scenes(self) -> int:
        """Number of scenes that were measured in both runs."""
        return int(self.values.both.sum())

    def tested(self, margin: float, *, level: float, ages: ComparedAges) -> "Tested":
        """Test both directions against a margin, of logarithms for ratios and otherwise in the unit."""
        question = ask(self.values.both[:, None], self.group, margin=margin, level=level)
        if question is None:
            return Tested(None, None, self._too_few())
        found, *alone = (_tested(values, question, ages) for values in (self.values, *self.by_kind))
        gap = self._gap(found)
        if found is None or not alone:
            return Tested(found, question.resampled, gap)
        held = found.held_by(alone)
        known = [one for one in alone if one is not None]
        opposed = len({one.direction for one in known}) > 1 and all(one.decides(level) for one in known)
        is_apart = not held.decides(level) and (found.decides(level) or opposed)
        trackers = dict.fromkeys((self.of.tracker, self.of.other_tracker))
        return Tested(held, question.resampled, f"{DISAGREE} {' and '.join(trackers)}" if is_apart else gap)

    def in_unit(self, change: float) -> float:
        """A change in the unit of the estimand."""
        with np.errstate(over="ignore"):
            return float(np.exp(change)) if self.estimand.unit == Unit.ratio else change

    def _too_few(self) -> str:
        if self.n_scenes < MIN_SCENES:
            return f"{only(self.n_scenes, 'scene')} with data in both runs; {_FEW}"
        part = self.group[self.values.both]
        n_groups = len(np.unique(part))
        if n_groups < MIN_SCENES and len(part) - n_groups < MIN_WITHIN:
            return f"the scenes form only {count(n_groups, 'group')}; {_FEW}, or {MIN_WITHIN} more scenes than groups"
        return "errors have no scale that a margin could be a share of"

    def _gap(self, found: Change | None) -> str | None:
        if found is None:
            with_data = int((~np.isnan(self.values.change)).any(axis=1).sum())
            return f"{only(with_data, 'scene')} with enough data in both runs; {_FEW}"
        if (self.values.unlike & found.compared).any():
            return "a value of 0 in one of the runs, which has no ratio"
        return None


def _tested(values: PairedValues, question: Question, ages: ComparedAges) -> Change | None:
    if values.total is None:
        return change_of(values.change, question, ages)
    return bias_change(values.change, values.total, question, ages)


@dataclass(frozen=True, slots=True)
class Tested:
    """Outcome of the tests.

    Attributes
    ----------
    found
        Tests and effect; None without enough data.
    resampled
        What intervals are about.
    gap
        Why nothing can be shown to be within the margin, if so, or that references of the two kinds disagree.
    """

    found: Change | None
    resampled: Resampled | None
    gap: str | None
