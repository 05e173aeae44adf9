"""Answer to one question: does a factor change a statistic by more than a margin, and by how much: arrays only.

The differences are of logarithms (scales), or in px (means). They are averaged over scenes at each point: a pair of
levels at one age and coordinate. Points that too few scenes have are left out.

- Does any pair differ by more than the margin? For scales this is asked in two stages. First, each scene's mean over
  all ages and both coordinates that it has is tested, one for each pair, at 80 % of the level. Second, the single
  points are tested, at 20 %: p_yes = min(p_1 / 0.8, p_2 / 0.2) (two-stage). Means of a signed error may cancel, so that
  for them only the points are tested.
- Do all pairs differ by less than the margin? Only if each single point does: p_no is the largest p-value of all points
  (intersection and union).

What is reported is the pair with the clearest overall difference, or the clearest point where only that exceeds the
margin. Its interval holds for all pairs, or all points, together.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.factors.averages import Averages, average
from tracknoise.findings.factors.differences import Differences
from tracknoise.findings.factors.exceeding import best_of_few, best_of_many, half_widths, half_widths_alone, p_below
from tracknoise.findings.factors.more_scenes import more_scenes
from tracknoise.findings.sampling.groups import MIN_WITHIN
from tracknoise.findings.sampling.units import MIN_SCENES
from tracknoise.tables.enumerations import Resampled

OVERALL_SHARE = 0.8
"""Share of the level that the overall differences are tested at; the rest is for single points."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What was found about one question.

    Attributes
    ----------
    pair
        Which pair of levels is reported.
    point
        Which point of it is reported; None for the mean over all of them.
    difference, low, high
        Signed difference of the pair and its interval.
    most
        Largest bound of the size of any difference at any point.
    p_yes, p_no
        By (two-stage) and (intersection and union).
    compared : (pairs, points) bool
        Points that enough scenes have.
    more_scenes
        How many more scenes would settle the question; None where this is unknown.
    """

    pair: int
    point: int | None
    difference: float
    low: float
    high: float
    most: float
    p_yes: float
    p_no: float
    compared: NDArray[np.bool_]
    more_scenes: int | None


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked of all differences.

    Parameters
    ----------
    margin
        Largest difference that counts as no effect: of logarithms, or in px.
    level
        Probability that an interval contains the true difference.
    group : (scenes,)
        Number of the group of each scene.
    resampled
        What is averaged: `scenes`, `groups` or `within`.
    directions : (draws, dimensions)
        See `tracknoise.findings.sampling.rotation.rotations`; there are as many dimensions as the parts of averages.
    cancels
        Whether differences at several points may cancel, so that their mean is no measure of them.
    """

    margin: float
    level: float
    group: NDArray[np.intp]
    resampled: Resampled
    directions: NDArray[np.float64]
    cancels: bool = False


@dataclass(frozen=True, slots=True)
class _Clearest:
    """The clearest of several differences, and the p-value of the hypothesis that none of them exceeds the margin."""

    found: Averages
    chosen: int
    p: float
    pair: int
    point: int | None

    @property
    def difference(self) -> float:
        return float(self.found.mean[self.chosen])

    def half_width(self, question: Question) -> float:
        """Half width of the interval, which holds for all differences together."""
        return float(half_widths(self.found, question.directions, 1 - question.level)[self.chosen])


def answer(asked: Differences, question: Question) -> Answer | None:
    """Compare all pairs; None where no point has enough scenes."""
    n_scenes, n_pairs, n_points = asked.values.shape
    every = average(asked.values.reshape(n_scenes, n_pairs * n_points), question.group, question.resampled)
    enough = enough_scenes(every, question.resampled)
    if not enough.any():
        return None
    points, compared = every.of(enough), enough.reshape(n_pairs, n_points)
    if question.cancels:
        reported = _clearest_point(points, compared, question, needed=np.inf)
    else:
        reported = _of_two_stages(asked.values, points, compared, question)
    half_width = reported.half_width(question)
    largest = np.abs(points.mean) + half_widths_alone(points, 1 - question.level)
    return Answer(
        pair=reported.pair,
        point=reported.point,
        difference=reported.difference,
        low=reported.difference - half_width,
        high=reported.difference + half_width,
        most=float(largest.max()),
        p_yes=reported.p,
        p_no=p_below(points, question.margin),
        compared=compared,
        more_scenes=more_scenes(reported.found, reported.chosen, points, margin=question.margin, level=question.level),
    )


def enough_scenes(found: Averages, resampled: Resampled) -> NDArray[np.bool_]:
    """Where there are enough scenes or groups for an interval, as in `tracknoise.findings.sampling.groups.scheme`.

    Parameters
    ----------
    found
        Means at any number of points.
    resampled
        What was averaged.

    Returns
    -------
    (points,) bool
    """
    least = MIN_WITHIN if resampled == Resampled.within else 0
    return np.asarray((found.n_units >= MIN_SCENES) & (found.degrees >= least), dtype=np.bool_)


def _of_two_stages(
    values: NDArray[np.float64], points: Averages, compared: NDArray[np.bool_], question: Question
) -> _Clearest:
    """The clearest difference, with the p-value of (two-stage); of numbers without ages there is one stage only."""
    overall = _clearest_pair(values, compared, question)
    if compared.shape[1] == 1:
        return overall
    rest = 1 - OVERALL_SHARE
    p_overall = min(overall.p / OVERALL_SHARE, 1.0)
    single = _clearest_point(points, compared, question, needed=rest * p_overall)
    p_single = single.p / rest
    at_point = p_single <= 1 - question.level < p_overall
    return replace(single if at_point else overall, p=min(p_overall, p_single))


def _clearest_pair(values: NDArray[np.float64], compared: NDArray[np.bool_], question: Question) -> _Clearest:
    """Of the means over the points of each pair."""
    there = ~np.isnan(values) & compared
    count = there.sum(axis=2)
    means = np.where(there, values, 0.0).sum(axis=2) / np.where(count > 0, count, np.nan)
    pairs = np.flatnonzero(compared.any(axis=1))
    found = average(means[:, pairs], question.group, question.resampled)
    best = best_of_few(found, question.margin, question.directions)
    return _Clearest(found, best.chosen, best.p, int(pairs[best.chosen]), None)


def _clearest_point(points: Averages, compared: NDArray[np.bool_], question: Question, *, needed: float) -> _Clearest:
    """Of single points; a p-value of `needed` or more need not be exact."""
    best = best_of_many(points, question.margin, question.directions, needed=needed)
    pair, point = np.argwhere(compared)[best.chosen]
    return _Clearest(points, best.chosen, best.p, int(pair), int(point))
