"""Whether levels of a factor differ by more than a margin: tests of differences that are paired within scenes.

Scenes are the sampling units. A scene is seen at all levels of a factor, so that what the levels have in common cancels
in their difference. Scales of errors, shares of events, lifetimes and counts are compared as ratios: the mean over
scenes of the difference of logarithms, and thus the geometric mean over scenes of the ratio. Mean errors have a sign,
and their differences are in px. Every scene has the same weight.

Differences are averaged over scenes at each point: a pair of levels at one age and coordinate. Points that too few
scenes have are left out.

- Does any pair differ by more than the margin? For scales this is asked in two stages. First, each scene's mean over
  all ages and both coordinates that it has is tested, one for each pair, at 80 % of the level. Second, the single
  points are tested, at 20 %: p_yes = min(p_1 / 0.8, p_2 / 0.2) (two-stage). Means of a signed error may cancel, so that
  for them only the points are tested.
- Do all pairs differ by less than the margin? Only if each single point does: p_no is the largest p-value of all points
  (intersection and union).

The pair with the clearest overall difference is reported, or the clearest point where only that exceeds the margin. Its
interval holds for all pairs, or all points, together.

Two runs have an order, so that each direction has a test of its own. A fall is the growth of the negative change. For
the size of a mean error, let x and y be the mean errors of the first and the second run, d = y - x their difference and
s = y + x their sum. As

    |y| - |x| = min(|d|, |s|) if d and s have one sign, else -min(|d|, |s|)      (size of a mean)

the size grew by more than the margin only if both d and s exceed it with one sign, and fell only if they exceed it with
different signs. d and s are means over scenes, so that each of the two has Student's t test. Both must be significant
(intersection and union). That the change is below the margin is shown by either of them, at half of the level.

Poses that are refined by tracks may favour trackers that are like these. Reference tracks are of two kinds. Where poses
were refined, trackers and runs are compared by each kind alone too, and every answer has to hold: p-values are the
largest of the three. That two levels differ is not shown where kinds order them differently.

P-values are then adjusted for everything that is asked (`decided`).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tracknoise.inference.multiple_tests import best_by_chance, rotations
from tracknoise.inference.paired_differences import (
    Averages,
    Differences,
    average,
    best_of_few,
    best_of_many,
    half_widths,
    half_widths_alone,
    more_scenes,
    p_below,
    p_of_best,
    standard_errors,
    taking_part,
    upper_tail,
)
from tracknoise.inference.units import MIN_SCENES, MIN_WITHIN, Resampled, scheme
from tracknoise.tables.enumerations import ComparedAges, Verdict
from tracknoise.words import count

OVERALL_SHARE = 0.8
"""Share of the level that the overall differences are tested at; the rest is for single points."""
N_DRAWS = 499
"""Rotations: enough to distinguish p-values of a few percent."""
DISAGREE = "references of the two kinds disagree about"
"""How a reason begins why a comparison is undecided that references together, or each kind in its own way, decide."""
AT_LEAST = f"at least {MIN_SCENES} are needed"
SHARE_MARGIN = 0.2
"""Margin of differences of shares, relative to that of ratios: 0.02 where ratios have 0.1."""
_ROUNDING = 1e-12


class Unit(StrEnum):
    """Unit of an effect: a ratio, px, or a difference of shares."""

    ratio = "ratio"
    px = "px"
    share = "share"

    def of(self, difference: float) -> float:
        """A difference in this unit: of logarithms, for ratios."""
        with np.errstate(over="ignore"):
            return float(np.exp(difference)) if self == Unit.ratio else difference

    def margin(self, margin: float, scale_px: float | None) -> float:
        """Margin of differences: of logarithms for ratios, a share of a length for px; NaN where that is unknown."""
        if self == Unit.ratio:
            return float(np.log1p(margin))
        if self == Unit.share:
            return SHARE_MARGIN * margin
        return math.nan if scale_px is None else margin * scale_px


class Family(StrEnum):
    """Questions that are corrected together: about sizes of errors, about ends of tracks, or about all else."""

    sizes = "sizes"
    ends = "ends"
    others = "others"

    @classmethod
    def of_role(cls, role: str) -> "Family":
        """That of the questions about statistics of a role."""
        return _FAMILIES.get(role, cls.others)


_FAMILIES = {
    **dict.fromkeys(("core", "second"), Family.sizes),
    **dict.fromkeys(("lifetime", "outlier_ratio"), Family.ends),
}
"""Families of roles; those of all others are `others`."""


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked of all differences."""

    margin: float  # largest difference that counts as no effect: of logarithms, or in px
    level: float  # probability that an interval contains the true difference
    group: NDArray[np.intp]  # (scenes,): number of the group of each scene
    resampled: Resampled  # what is averaged: `scenes`, `groups` or `within`
    # (draws, dimensions) of `tracknoise.inference.multiple_tests.rotations`: as many dimensions as averages have parts
    directions: NDArray[np.float64]
    cancels: bool = False  # whether differences at several points may cancel, so that their mean is no measure of them

    def average(self, values: NDArray[np.float64]) -> Averages:
        """Means over scenes of values (scenes, points)."""
        return average(values, self.group, self.resampled)

    def half_width(self, averages: Averages, chosen: int) -> float:
        """Half width of the interval of one of some means, which holds for all of them together."""
        return float(half_widths(averages, self.directions, 1 - self.level)[chosen])


def ask(
    both: NDArray[np.bool_],
    group: NDArray[np.intp],
    *,
    margin: float,
    level: float,
    n_draws: int = N_DRAWS,
    seed: int = 0,
    cancels: bool = False,
) -> Question | None:
    """The question about differences; None where scenes or groups are too few, or the margin is unknown.

    Shapes: both (scenes, pairs), group (scenes,). `margin`: NaN where it is unknown.
    """
    resampled = scheme(group[both.any(axis=1)])
    if resampled is None or not np.isfinite(margin):
        return None
    n_groups = len(np.unique(group))
    within = len(group) - n_groups + 1
    dimensions = {Resampled.scenes: len(group), Resampled.groups: n_groups}.get(resampled, within)
    directions = rotations(dimensions, n_draws=n_draws, seed=seed)
    return Question(margin, level, group, resampled, directions, cancels=cancels)


def why_not_asked(both: NDArray[np.bool_], group: NDArray[np.intp]) -> str:
    """Why there is no question about enough scenes."""
    part = group[both.any(axis=1)]
    n_groups = len(np.unique(part))
    if n_groups < MIN_SCENES and len(part) - n_groups < MIN_WITHIN:
        return f"the scenes form only {count(n_groups, 'group')}; {AT_LEAST}, or {MIN_WITHIN} more scenes than groups"
    return "errors have no scale that a margin could be a share of"


def decided(p_none: float | None, q: float, q_none: float, level: float, *, has_gap: bool) -> Verdict:
    """Whether a difference is shown, or that there is none.

    `p_none`: P-value of the hypothesis that some difference is at least the margin. `q, q_none`: adjusted p-values of
    the hypothesis that none exceeds the margin, and of that one. None and NaN without a test. `has_gap`: whether there
    is a reason why nothing can be shown to be alike.
    """
    largest = 1 - level + _ROUNDING
    if q <= largest:
        return Verdict.yes
    is_none = p_none is not None and not has_gap and is_below(p_none, level) and q_none <= largest
    return Verdict.no if is_none else Verdict.undecided


def is_below(p_none: float, level: float) -> bool:
    """Whether a p-value of the hypothesis that a difference is at least the margin alone shows that it is less."""
    return p_none <= (1 - level) / 2 + _ROUNDING


def is_beyond(p: float, level: float) -> bool:
    """Whether a p-value of the hypothesis that a difference is at most the margin shows that it is more."""
    return p <= 1 - level + _ROUNDING


def why_open(p: float, p_none: float, level: float, *, contains: bool, otherwise: str) -> str:
    """Why an answer is undecided of enough scenes. `contains`: whether the interval crosses the margin."""
    if p <= 1 - level or is_below(p_none, level):
        return "not significant after the correction for multiple tests"
    return "the interval crosses the margin" if contains else otherwise


def enough_scenes(averages: Averages, resampled: Resampled) -> NDArray[np.bool_]:
    """Where there are enough scenes or groups for an interval, as in `tracknoise.inference.units.scheme`."""
    least = MIN_WITHIN if resampled == Resampled.within else 0
    return np.asarray((averages.n_units >= MIN_SCENES) & (averages.degrees >= least), dtype=np.bool_)


def mean_of_points(values: NDArray[np.float64], compared: NDArray[np.bool_], *, axis: int = -1) -> NDArray[np.float64]:
    """Each scene's mean over the points, along an axis, that it has among those that are compared; NaN without any."""
    there = ~np.isnan(values) & compared
    count = there.sum(axis=axis)
    return np.asarray(np.where(there, values, 0.0).sum(axis=axis) / np.where(count > 0, count, np.nan))


def _two_stages(overall: Averages, points: Averages | None, question: Question) -> tuple[float, int, int | None]:
    """P-value of (two-stage), the clearest overall difference, and the clearest point where only it is significant.

    `points`: None where there is one stage only.
    """
    best = best_of_few(overall, question.margin, question.directions)
    if points is None:
        return best.p, best.chosen, None
    rest = 1 - OVERALL_SHARE
    p_overall = min(best.p / OVERALL_SHARE, 1.0)
    single = best_of_many(points, question.margin, question.directions, needed=rest * p_overall)
    p_single = single.p / rest
    at_point = p_single <= 1 - question.level < p_overall
    return min(p_overall, p_single), best.chosen, single.chosen if at_point else None


@dataclass(frozen=True, slots=True)
class Answer:
    """Whether any levels differ."""

    pair: int  # which pair of levels is reported
    point: int | None  # which point of it is reported; None for the mean over all of them
    difference: float  # of the pair, with a sign, and its interval
    low: float
    high: float
    most: float  # largest bound of the size of any difference at any point
    p_yes: float  # by (two-stage)
    p_no: float  # by (intersection and union)
    compared: NDArray[np.bool_]  # (pairs, points): those that enough scenes have
    more_scenes: int | None  # how many more scenes would settle the question; None where this is unknown
    kinds_disagree: bool = False  # whether references of each kind alone decide otherwise

    def held_by(self, by_kind: Sequence[Differences], question: Question) -> "Answer":
        """With p-values that hold by references of each kind alone, and whether these differ in what they decide."""
        alone = [found for one in by_kind if (found := _answer(one, question)) is not None]
        yes, no = ([one.p_yes for one in (self, *alone)], [one.p_no for one in (self, *alone)])
        order = [self.difference, *(self._difference(one) for one in by_kind)]
        is_missing, is_opposed = len(alone) < len(by_kind), min(order) < 0.0 < max(order)
        p_yes, p_no = (1.0 if is_missing or is_opposed else max(yes), 1.0 if is_missing else max(no))
        wrong = 1.0 - question.level
        is_lost = yes[0] <= wrong < p_yes or no[0] <= wrong / 2 < p_no
        kinds_disagree = is_lost or (is_opposed and max(yes[1:], default=1.0) <= wrong)
        return replace(self, p_yes=p_yes, p_no=p_no, kinds_disagree=kinds_disagree)

    def _difference(self, asked: Differences) -> float:
        """Mean over scenes of the pair and the point that is reported, or of all points that are compared."""
        values = asked.values[:, self.pair]
        chosen = values[:, self.compared[self.pair]] if self.point is None else values[:, self.point]
        finite = chosen[np.isfinite(chosen)]
        return float(finite.mean()) if len(finite) else 0.0


def answer(asked: Differences, question: Question) -> Answer | None:
    """Compare all pairs; None where no point has enough scenes."""
    answered = _answer(asked, question)
    return answered.held_by(asked.by_kind, question) if answered is not None and asked.by_kind else answered


def _answer(asked: Differences, question: Question) -> Answer | None:
    n_scenes, n_pairs, n_points = asked.values.shape
    every = question.average(asked.values.reshape(n_scenes, n_pairs * n_points))
    enough = enough_scenes(every, question.resampled)
    if not enough.any():
        return None
    points, compared = every.of(enough), enough.reshape(n_pairs, n_points)
    point: int | None
    if question.cancels:
        single = best_of_many(points, question.margin, question.directions, needed=np.inf)
        p, point = single.p, single.chosen
    else:
        pairs = np.flatnonzero(compared.any(axis=1))
        averages = question.average(mean_of_points(asked.values, compared)[:, pairs])
        p, chosen, point = _two_stages(averages, points if n_points > 1 else None, question)
        pair = int(pairs[chosen])
    if point is not None:
        averages, chosen = points, point
        pair, point = map(int, np.argwhere(compared)[chosen])
    difference, width = float(averages.mean[chosen]), question.half_width(averages, chosen)
    largest = np.abs(points.mean) + half_widths_alone(points, 1 - question.level)
    return Answer(
        pair=pair,
        point=point,
        difference=difference,
        low=difference - width,
        high=difference + width,
        most=float(largest.max()),
        p_yes=p,
        p_no=p_below(points, question.margin),
        compared=compared,
        more_scenes=more_scenes(averages, chosen, points, margin=question.margin, level=question.level),
    )


GROWS, FALLS = 1, -1


@dataclass(frozen=True, slots=True)
class OneSided:
    """Tests of one direction."""

    p_beyond: float  # P-value of the hypothesis that no point changes by more than the margin in this direction
    p_within: float  # P-value of the hypothesis that some point changes by at least the margin in this direction
    point: int | None  # which point decides; None for the mean over all of them


@dataclass(frozen=True, slots=True)
class Change:
    """What changed from one level to another."""

    effect: float  # the change of the mean over all points, or of the point that decides, and its interval
    low: float
    high: float
    point: int | None  # that point; None for the mean
    sides: Mapping[int, OneSided]  # tests by direction: `GROWS` and `FALLS`
    compared: NDArray[np.bool_]  # (points,): those that enough scenes have
    scenes: NDArray[np.float64]  # (scenes,): the same change in every scene, NaN where it has none
    coordinate: int | None = None  # 0 for u and 1 for v, if it is the mean over all places of one of them
    kinds_disagree: bool = False  # as in `Answer`

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

    def straddles(self, margin: float) -> bool:
        """Whether the interval crosses the margin of either direction."""
        return self.low <= margin <= self.high or self.low <= -margin <= self.high

    def held_by(self, alone: Sequence["Change | None"], level: float) -> "Change":
        """As `Answer.held_by`, with what changed by references of each kind alone."""
        sides = dict(self.sides)
        for sign, side in sides.items():
            same = [OneSided(1.0, 1.0, None) if one is None else one.sides[sign] for one in alone]
            beyond, within = (max(getattr(one, name) for one in (side, *same)) for name in ("p_beyond", "p_within"))
            sides[sign] = replace(side, p_beyond=beyond, p_within=within)
        held, known = replace(self, sides=sides), [one for one in alone if one is not None]
        is_opposed = len({one.direction for one in known}) > 1 and all(one._decides(level) for one in known)
        kinds_disagree = not held._decides(level) and (self._decides(level) or is_opposed)
        return replace(held, kinds_disagree=kinds_disagree)

    def _decides(self, level: float) -> bool:
        """Whether this alone, before corrections for several questions, shows a change, or that there is none."""
        return self.p_change <= 1 - level or self.p_none <= (1 - level) / 2


def change(asked: Differences, question: Question, ages: ComparedAges) -> Change | None:
    """Test both directions of the difference between two levels; None where no point has enough scenes."""
    values = asked.values[:, 0]
    if asked.total is None:
        tests = change_of(values, question, ages)
    else:
        tests = bias_change(values, asked.total[:, 0], question, ages)
    alone = [change(one, question, ages) for one in asked.by_kind]
    return tests.held_by(alone, question.level) if tests is not None and alone else tests


def change_of(values: NDArray[np.float64], question: Question, ages: ComparedAges) -> Change | None:
    """Test both directions; None where no point has enough scenes.

    Shapes: values (scenes, points). `values`: second run minus first run, NaN where there is none.
    """
    every = question.average(values)
    compared = enough_scenes(every, question.resampled)
    if not compared.any():
        return None
    scenes = mean_of_points(values, compared)
    overall = question.average(scenes[:, None])
    points = every.of(compared) if ages == ComparedAges.every else overall
    place = np.flatnonzero(compared)
    sides = {sign: _one_sided(overall, points, place, question, sign) for sign in (GROWS, FALLS)}
    point = min(sides.values(), key=lambda side: side.p_beyond).point
    if point is None:
        effect, width = overall.mean[0], half_widths_alone(overall, 1 - question.level)[0]
    else:
        chosen = int(np.searchsorted(place, point))
        effect, width = points.mean[chosen], question.half_width(points, chosen)
        scenes = values[:, point]
    return Change(float(effect), float(effect - width), float(effect + width), point, sides, compared, scenes)


def _one_sided(overall: Averages, points: Averages, place: NDArray[np.intp], question: Question, sign: int) -> OneSided:
    several = _towards(points, sign) if len(points.mean) > 1 else None
    beyond, _, chosen = _two_stages(_towards(overall, sign), several, question)
    below = (question.margin - sign * points.mean) / standard_errors(points, question.margin)
    within = float(upper_tail(below, points.degrees).max())
    return OneSided(beyond, within, None if chosen is None else int(place[chosen]))


def _towards(averages: Averages, sign: int) -> Averages:
    """The same with no change where it is in the other direction."""
    return replace(averages, mean=np.maximum(sign * averages.mean, 0.0))


def bias_change(
    change: NDArray[np.float64], total: NDArray[np.float64], question: Question, ages: ComparedAges
) -> Change | None:
    """Test both directions; None where no point has enough scenes.

    Shapes: change, total (scenes, points). `change, total`: mean errors of the second run minus, and plus, those of the
    first, px, NaN where there are none.
    """
    compared = enough_scenes(question.average(change), question.resampled)
    if not compared.any():
        return None
    places: NDArray[np.intp] | None
    if ages == ComparedAges.mean:
        places, parts = None, [_of_coordinates(array, compared) for array in (change, total)]
    else:
        places, parts = np.flatnonzero(compared), [array[:, compared] for array in (change, total)]
    both = question.average(np.concatenate(parts, axis=1))
    by_chance = best_by_chance(*taking_part(both, question.directions))
    tests = {sign: _tests_of_size(both, question.margin, sign) for sign in (GROWS, FALLS)}
    chosen = int(np.argmin(np.minimum(*(beyond for beyond, _ in tests.values()))))
    point = None if places is None else int(places[chosen])
    sides = {
        sign: OneSided(_corrected(beyond.min(), by_chance, both), float(within.max()), point)
        for sign, (beyond, within) in tests.items()
    }
    effect, low, high = _sizes(both, chosen, question)
    scenes = _growth(parts[0][:, chosen], parts[1][:, chosen])
    return Change(effect, low, high, point, sides, compared, scenes, chosen if places is None else None)


def _of_coordinates(values: NDArray[np.float64], compared: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Mean of each scene over the places that are compared, (scenes, 2)."""
    return mean_of_points(values.reshape(len(values), -1, 2), compared.reshape(-1, 2), axis=1)


def _tests_of_size(both: Averages, margin: float, sign: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """P-values of the hypotheses that a size changes by at most, and by at least, the margin in a direction, (points,).

    `both`: of the differences, and then of the sums, of all points.
    """
    mean, error = (array.reshape(2, -1) for array in (both.mean, standard_errors(both, margin)))
    signs = np.array([[1, sign], [-1, -sign]])[..., None]  # of differences and sums, on both sides
    excess, degrees = (signs * mean - margin) / error, np.split(both.degrees, 2)[0]
    beyond = upper_tail(excess, degrees).max(axis=1).min(axis=0)
    within = upper_tail(-excess, degrees).min(axis=1).max(axis=0)
    return np.minimum(2 * beyond, 1.0), np.minimum(2 * within, 1.0)


def _corrected(p: float, by_chance: NDArray[np.float64], both: Averages) -> float:
    """P-value of the best of all points."""
    as_small = int(np.searchsorted(by_chance, p, side="right"))
    return min(p_of_best(float(p), as_small, len(by_chance), len(both.mean)), 1.0)


def _sizes(both: Averages, chosen: int, question: Question) -> tuple[float, float, float]:
    """Change of the size of a mean at a point, and its bounds from those of the difference and of the sum."""
    width = half_widths(both, question.directions, 1 - question.level)
    ends = np.stack([both.mean - width, both.mean + width]).reshape(2, 2, -1)[..., chosen]
    sizes = _growth(ends[:, :1], ends[:, 1])
    change, total = both.mean.reshape(2, -1)[:, chosen]
    return float(_growth(change, total)), float(sizes.min()), float(sizes.max())


def _growth(change: NDArray[np.float64], total: NDArray[np.float64]) -> NDArray[np.float64]:
    """By (size of a mean)."""
    return np.asarray((np.abs(total + change) - np.abs(total - change)) / 2)
