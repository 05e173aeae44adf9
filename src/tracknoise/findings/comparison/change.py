"""Whether something grew or fell by more than a margin from one run to another: arrays only.

Each direction has a test of its own, as in `tracknoise.findings.factors.answers`:

- Does any point grow by more than the margin? First, each scene's mean over all points is tested, then the single
  points: p_beyond = min(p_1 / 0.8, p_2 / 0.2) (two-stage).
- Is the growth below the margin at every single point? p_within is the largest p-value of all points (intersection and
  union).

A fall is the growth of the negative change.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.factors.answers import OVERALL_SHARE, Question, enough_scenes
from tracknoise.findings.factors.averages import Averages, average
from tracknoise.findings.factors.exceeding import (
    best_of_few,
    best_of_many,
    half_widths,
    half_widths_alone,
    standard_errors,
    upper_tail,
)
from tracknoise.tables.enumerations import ComparedAges

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


def change_of(values: NDArray[np.float64], question: Question, ages: ComparedAges) -> Change | None:
    """Test both directions; None where no point has enough scenes.

    Parameters
    ----------
    values : (scenes, points) float64
        Second run minus first run, NaN where there is none.
    question
        What is asked.
    ages
        Whether single points are tested besides their mean.
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
