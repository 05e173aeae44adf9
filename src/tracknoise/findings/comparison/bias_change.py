"""Whether the size of a mean error grew or fell by more than a margin: arrays only.

Mean errors x and y of the first and the second run have the difference d = y - x and the sum s = y + x. As

    |y| - |x| = min(|d|, |s|) if d and s have one sign, else -min(|d|, |s|)      (size of a mean)

the size grew by more than the margin only if both d and s exceed it with one sign, and fell only if they exceed it with
different signs. d and s are means over scenes, so that each of the two has Student's t test. Both must be significant
(intersection and union). That the change is below the margin is shown by either of them, at half of the level.
"""

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.comparison.change import FALLS, GROWS, Change, OneSided
from tracknoise.findings.factors.answers import Question, enough_scenes
from tracknoise.findings.factors.averages import Averages, average
from tracknoise.findings.factors.exceeding import (
    half_widths,
    p_of_best,
    standard_errors,
    taking_part,
    upper_tail,
)
from tracknoise.findings.sampling.rotation import best_by_chance
from tracknoise.tables.enumerations import ComparedAges


def bias_change(
    change: NDArray[np.float64], total: NDArray[np.float64], question: Question, ages: ComparedAges
) -> Change | None:
    """Test both directions; None where no point has enough scenes.

    Parameters
    ----------
    change, total : (scenes, points) float64
        Mean errors of the second run minus, and plus, those of the first, px, NaN where there are none. Points are
        places times two coordinates.
    question
        What is asked.
    ages
        Whether single points are tested, or the mean over all places of each coordinate.
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
