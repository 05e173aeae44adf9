"""Differences that are paired by scene: means, and tests of whether they exceed a margin.

Means over scenes
-----------------

Every scene has the same weight. A value that a scene lacks is NaN, and the scene takes no part in that mean. With n
scenes in G groups, a mean has the standard error s / sqrt(n) and its degrees of freedom (average):

- scenes: s is the standard deviation of the scenes; n - 1 degrees of freedom.
- groups: the scenes of a group are averaged first; groups then count as scenes do.
- within: s^2 is the variance of scenes within their groups, pooled; n - G degrees of freedom. The standard error
  excludes the variation between groups.

Tests
-----

For a mean difference d with standard error se, a margin m, and Student's distribution of its degrees of freedom, with
t = (|d| - m) / se and upper tail P:

- p_above = P(t) + P(t + 2 m / se) (above): that the difference is at most m. It is the probability of so large a |d| if
  the true one is at the margin. With m = 0 it is that of the paired t test.
- p_below = P(-t) (below): that the difference is at least m.

Of several, the best p-value is an answer only as far as it is seldom so small by chance (Westfall and Young's min-p).
Chance is that of the scenes' differences rotated (`tracknoise.inference.multiple_tests`). Where there are too few
rotations to estimate this, a p-value is multiplied by the number of tests (Bonferroni).

Source: P. Westfall, S. Young, Resampling-based multiple testing (1993).

More scenes
-----------

For a difference d with a margin m, a standard deviation s of single scenes and a test at the level of the intervals,
80 % of studies with n = ((z_level + z_80) s / (|d| - m))^2 + 2 scenes have a significant result (scenes). The last term
allows for Student's distribution. Where the reported difference exceeds the margin, it alone has to be shown to do so.
Otherwise all points have to be shown to be below the margin, and the one that needs the most scenes counts. Where a
difference lies within 20 % of the margin, no number is given: the estimate is too close to tell which of the two it is.
"""

from dataclasses import dataclass
from itertools import combinations
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, special

from tracknoise.inference.multiple_tests import best_by_chance, least_share, students, within
from tracknoise.inference.units import Resampled


@dataclass(frozen=True, slots=True)
class Differences:
    """Differences of every scene between every two levels."""

    # (scenes, pairs, points): the first level minus the second, NaN where a scene lacks one of them
    values: NDArray[np.float64]
    pairs: NDArray[np.intp]  # (pairs, 2): numbers of the levels
    # (scenes, pairs): which scenes were measured at both levels, whether or not they have a value
    both: NDArray[np.bool_]
    # (pairs, points): where a scene has a value of 0 at one of the two levels only, so that they have no ratio
    unlike: NDArray[np.bool_]
    # (pairs,): common horizon of the lifetimes of both levels, frames; NaN for other statistics
    horizon: NDArray[np.float64]
    # (pairs, 2): levels that have so few events that their value is too large rather than right
    scarce: NDArray[np.bool_]
    # why nothing can be shown to be alike, however similar the levels are; None if there is no such reason
    gap: str | None = None


def pairs_of(n_levels: int) -> NDArray[np.intp]:
    """Every two of some levels, (pairs, 2), in order."""
    return np.array(list(combinations(range(n_levels), 2)), dtype=np.intp).reshape(-1, 2)


def none_scarce(pairs: NDArray[np.intp]) -> NDArray[np.bool_]:
    """That no level of some pairs is scarce, (pairs, 2)."""
    return np.zeros(pairs.shape, dtype=np.bool_)


def differences(levels: NDArray[np.float64], measured: NDArray[np.bool_], *, logarithms: bool) -> Differences:
    """Differences of values that every level has on its own.

    Parameters
    ----------
    levels : (scenes, levels, points)
        Values of a scene, or their logarithms: -inf where a value is 0, NaN where there is none.
    measured : (scenes, levels)
        Which scenes were measured at which levels.
    logarithms
        Whether these are logarithms. Two values of 0 then differ by nothing; one of them has no ratio.
    """
    pairs = pairs_of(levels.shape[1])
    zero = levels == -np.inf
    if not (logarithms and zero.any()):
        values, unlike = _minus(levels, pairs), np.zeros((len(pairs), levels.shape[2]), dtype=np.bool_)
    else:
        a, b = (np.take(zero, pairs[:, side], axis=1) for side in (0, 1))
        values = np.where(a & b, 0.0, _minus(np.where(zero, np.nan, levels), pairs))
        defined = np.take(~np.isnan(levels), pairs, axis=1).all(axis=2)
        unlike = ((a != b) & defined).any(axis=0)
    return Differences(values, pairs, at_both(measured), unlike, np.full(len(pairs), np.nan), none_scarce(pairs))


def _minus(levels: NDArray[np.float64], pairs: NDArray[np.intp]) -> NDArray[np.float64]:
    return np.asarray(np.take(levels, pairs[:, 0], axis=1) - np.take(levels, pairs[:, 1], axis=1))


def at_both(measured: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which scenes were measured at both levels of each pair, (scenes, pairs)."""
    return np.asarray(measured[:, pairs_of(measured.shape[1])].all(axis=2), dtype=np.bool_)


@dataclass(frozen=True, slots=True)
class Averages:
    """Means over scenes, at any number of points."""

    # mean, error, degrees: (points,): means, their standard errors and degrees of freedom by (average)
    mean: NDArray[np.float64]
    error: NDArray[np.float64]
    degrees: NDArray[np.float64]
    # n_units, n_scenes: (points,): scenes or groups that are averaged, and scenes in them
    n_units: NDArray[np.intp]
    n_scenes: NDArray[np.intp]
    # (dimensions, points): what each scene, group, or direction within groups, adds to the error: the squares add up to
    # that of `error`
    parts: NDArray[np.float64]

    def of(self, points: NDArray[np.bool_]) -> "Averages":
        """Some of the points."""
        mean, error, degrees = self.mean[points], self.error[points], self.degrees[points]
        n_units, n_scenes = self.n_units[points], self.n_scenes[points]
        return Averages(mean, error, degrees, n_units, n_scenes, self.parts[:, points])


def average(values: NDArray[np.float64], group: NDArray[np.intp], resampled: Resampled) -> Averages:
    """Means over scenes by (average).

    Parameters
    ----------
    values : (scenes, points)
        NaN where a scene has none.
    group : (scenes,)
        Number of the group of each scene, from 0 on.
    resampled
        `scenes`, `groups` or `within`.
    """
    if resampled == Resampled.within:
        return _within(values, group)
    n_scenes = (~np.isnan(values)).sum(axis=0)
    return _between(values if resampled == Resampled.scenes else _group_means(values, group), n_scenes)


def _between(units: NDArray[np.float64], n_scenes: NDArray[np.intp]) -> Averages:
    """Means of independent units."""
    defined = ~np.isnan(units)
    n = defined.sum(axis=0)
    mean = np.where(defined, units, 0.0).sum(axis=0) / np.maximum(n, 1)
    parts = np.where(defined, units - mean, 0.0) / np.sqrt(np.maximum(n * (n - 1), 1))
    return Averages(mean, np.linalg.norm(parts, axis=0), np.maximum(n - 1.0, 1.0), n, n_scenes, parts)


def _group_means(values: NDArray[np.float64], group: NDArray[np.intp]) -> NDArray[np.float64]:
    """Means of the scenes of each group, (groups, points), NaN where none has a value."""
    defined = ~np.isnan(values)
    member = (group == np.arange(group.max(initial=-1) + 1)[:, None]).astype(np.float64)
    count = member @ defined
    return np.asarray(member @ np.where(defined, values, 0.0) / np.where(count > 0, count, np.nan), dtype=np.float64)


def _within(values: NDArray[np.float64], group: NDArray[np.intp]) -> Averages:
    """Means whose errors are of the scenes within their groups."""
    defined, of_groups = ~np.isnan(values), _group_means(values, group)
    n = defined.sum(axis=0)
    degrees = n - (~np.isnan(of_groups)).sum(axis=0).astype(np.float64)
    mean = np.where(defined, values, 0.0).sum(axis=0) / np.maximum(n, 1)
    residual = np.where(defined, values - of_groups[group], 0.0) / np.sqrt(np.maximum(n * degrees, 1.0))
    error = np.linalg.norm(residual, axis=0)
    return Averages(mean, error, np.maximum(degrees, 1.0), n, n, _directions_within(group) @ residual)


def _directions_within(group: NDArray[np.intp]) -> NDArray[np.float64]:
    """Orthonormal directions among the scenes of each group, and a last one without length: (n - G + 1, scenes).

    The last one makes the number of rows one more than the degrees of freedom, as it is for scenes.
    """
    rows = []
    for number in range(group.max(initial=-1) + 1):
        members = np.flatnonzero(group == number)
        row = np.zeros((len(members) - 1, len(group)))
        row[:, members] = linalg.helmert(len(members)) if len(members) > 1 else 0.0
        rows.append(row)
    return np.concatenate([*rows, np.zeros((1, len(group)))])


_ROUNDING = 1e-12
"""Standard errors below this, relative to the difference and the margin, are rounding."""
_HALVINGS = 30


@dataclass(frozen=True, slots=True)
class Best:
    """The clearest of several differences."""

    chosen: int  # which it is
    p: float  # P-value of the hypothesis that none of them exceeds the margin


def best_of_few(found: Averages, margin: float, directions: NDArray[np.float64]) -> Best:
    """The difference that exceeds the margin the most clearly by (above).

    Parameters
    ----------
    found
        At one point at least.
    margin
        Not negative.
    directions : (draws, dimensions)
        See `tracknoise.inference.multiple_tests.rotations`.
    """
    error = standard_errors(found, margin)
    alone = _at_margin(np.abs(found.mean) / error, margin / error, found.degrees)
    chosen, best = int(np.argmin(alone)), float(alone.min())
    if len(alone) == 1:
        return Best(chosen, best)
    parts, turned = taking_part(found, directions)
    shift = np.sign(found.mean) * margin / error
    as_clear = np.abs(students(parts, turned) + shift) >= _needed(np.abs(shift), best, max(len(parts) - 1.0, 1.0))
    return Best(chosen, p_of_best(best, int(as_clear.any(axis=1).sum()), len(directions), len(alone)))


def best_of_many(found: Averages, margin: float, directions: NDArray[np.float64], *, needed: float) -> Best:
    """The same for any number of differences: faster, and less often significant if the margin is large.

    Both tails of t are counted, which is more than (above). A p-value that is not below `needed` is not computed any
    more exactly.
    """
    excess = (np.abs(found.mean) - margin) / standard_errors(found, margin)
    chosen = _largest(excess, found.degrees)
    best, draws = min(float(2 * upper_tail(excess[chosen], found.degrees[chosen])), 1.0), len(directions)
    least = max(best, min(1 / (1 + draws), len(excess) * best))
    if least >= needed:
        return Best(chosen, least)
    by_chance = best_by_chance(*taking_part(found, directions))
    return Best(chosen, p_of_best(best, int(np.searchsorted(by_chance, best, side="right")), draws, len(excess)))


def p_below(found: Averages, margin: float) -> float:
    """Largest p-value by (below)."""
    short = (margin - np.abs(found.mean)) / standard_errors(found, margin)
    worst = _largest(-short, found.degrees)
    return float(upper_tail(short[worst], found.degrees[worst]))


def half_widths(found: Averages, directions: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Half widths of intervals that together miss any of the true differences with a probability of `share`."""
    if len(found.mean) == 1:
        return half_widths_alone(found, share)
    by_chance = best_by_chance(*taking_part(found, directions))
    return half_widths_alone(found, min(float(least_share(by_chance, share)), share))


def half_widths_alone(found: Averages, share: float) -> NDArray[np.float64]:
    """Half widths of intervals each of which misses its true difference with a probability of `share`."""
    degrees, place = np.unique(found.degrees, return_inverse=True)
    return np.asarray(found.error * -special.stdtrit(degrees, share / 2)[place], dtype=np.float64)


def taking_part(found: Averages, directions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Parts of errors, and directions, without the scenes that add to no error."""
    has_part = np.any(found.parts, axis=1)
    return found.parts[has_part], within(directions, has_part)


def _largest(t: NDArray[np.float64], degrees: NDArray[np.float64]) -> int:
    """The least probable of some values of t: only the largest of each number of degrees can be."""
    by_degrees = [np.flatnonzero(degrees == number) for number in np.unique(degrees)]
    largest = np.array([places[np.argmax(t[places])] for places in by_degrees])
    return int(largest[np.argmin(upper_tail(t[largest], degrees[largest]))])


def p_of_best(best: float, as_small: int, draws: int, count: int) -> float:
    """P-value of the best of `count` p-values, which is so small by chance in `as_small` rotations."""
    share = max(best, (1 + as_small) / (1 + draws))
    return share if as_small else min(share, count * best)


def _needed(margin: NDArray[np.float64], p: float, degrees: float) -> NDArray[np.float64]:
    """Size in standard errors whose p-value by (above) is p, by bisection."""
    low, high = (margin - special.stdtrit(degrees, tail) for tail in (p, p / 2))
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        above = _at_margin(middle, margin, degrees) > p
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return np.asarray(high, dtype=np.float64)


def _at_margin(
    size: NDArray[np.float64], margin: NDArray[np.float64], degrees: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """(above), of sizes and margins in standard errors."""
    return np.minimum(upper_tail(size - margin, degrees) + upper_tail(size + margin, degrees), 1.0)


def upper_tail(t: NDArray[np.float64], degrees: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Probability of a larger value, P above."""
    return np.asarray(special.stdtr(degrees, -t), dtype=np.float64)


def standard_errors(found: Averages, margin: float) -> NDArray[np.float64]:
    """Standard errors to divide by: those of scenes that are all alike are rounding."""
    return np.maximum(found.error, _ROUNDING * (np.abs(found.mean) + margin) + np.finfo(np.float64).tiny)


POWER = 0.8
TOO_CLOSE = 0.2
"""Differences this close to the margin, relative to it, give no number of scenes."""


def more_scenes(found: Averages, chosen: int, points: Averages, *, margin: float, level: float) -> int | None:
    """Scenes that are needed by (scenes) beyond those that there are, at least one; None where this is unknown.

    Parameters
    ----------
    found, chosen
        Differences, and which of them is reported.
    points
        Differences at all points.
    margin
        Largest difference that counts as no effect.
    level
        Probability that an interval contains the true difference.
    """
    is_chosen = np.arange(len(found.mean)) == chosen
    open_ = found.of(is_chosen) if abs(found.mean[chosen]) > margin else points
    away = np.abs(np.abs(open_.mean) - margin)
    if np.any(away <= TOO_CLOSE * margin):
        return None
    z = NormalDist().inv_cdf((1 + level) / 2) + NormalDist().inv_cdf(POWER)
    units = open_.n_units * (z * open_.error / away) ** 2 + 2
    scenes = np.ceil(units * open_.n_scenes / open_.n_units)
    worst = int(np.argmax(scenes - open_.n_scenes))
    return max(int(scenes[worst] - open_.n_scenes[worst]), 1)
