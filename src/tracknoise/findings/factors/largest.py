"""The largest of many relative differences: an interval for it, and tests of whether it exceeds a margin.

At points k (pairs of levels, coordinates, ages) there are differences d(k) and common variations c(k) >= 0, both
estimated from scenes. The effect is E = max over k of |d(k)| / c(k). The largest of many noisy values is biased
upwards, and it cannot be resampled where it is near zero. But at a single point, for a ratio e, the studentised

    t(k, e) = (|d(k)| - e c(k)) / se(|d(k)| - e c(k))

has about Student's distribution if e is the ratio there, even where c(k) is so uncertain that |d(k)| / c(k) has no
standard error (Fieller 1954). From that:

- E is more than e if a single point's ratio is. The best point's p-value counts only as far as the best of as many
  points is seldom so small by chance (Westfall and Young's min-p): of errors of d, or of d - margin c, rotated.
  Where there are too few rotations to estimate this, it counts as often as there are points (Bonferroni).
- E is less than e if that holds at all points, so that each is tested on its own, and the worst p-value counts
  (intersection and union). There, c(k) must differ from 0, too. Where c(k) is the range of a curve, whose ends were
  chosen from the data and are therefore too far apart, p-values count only as far as ends chosen from errors alone
  seldom have them.

`low` is the largest of the points' lower bounds, taken together; `high` the largest of their upper bounds, each alone.

Sources: E. Fieller, Journal of the Royal Statistical Society B 16 (1954); P. Westfall, S. Young, Resampling-based
multiple testing (1993).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.findings.factors.ratios import Ratios
from tracknoise.findings.factors.rotation import best_by_chance, least_share, range_by_chance, share_at_most, within


@dataclass(frozen=True, slots=True)
class Largest:
    """The largest relative difference.

    Attributes
    ----------
    effect
        Its estimate, infinite where levels differ and have nothing in common.
    low, high
        Its interval; `high` is infinite where what is common may be zero.
    p_yes, p_no
        P-values of the hypotheses that it is at most, and at least, the margin. `low` exceeds the margin where p_yes is
        at most 1 - level, `high` is under it where p_no is at most half of that.
    """

    effect: float
    low: float
    high: float
    p_yes: float
    p_no: float


@dataclass(frozen=True, slots=True)
class _Points:
    """|d|, c, their variances and covariance, and degrees of freedom; (points,) each."""

    size: NDArray[np.float64]
    common: NDArray[np.float64]
    differs: NDArray[np.float64]
    varies: NDArray[np.float64]
    mixed: NDArray[np.float64]
    degrees: NDArray[np.float64]


def largest(ratios: Ratios, directions: NDArray[np.float64], *, margin: float, level: float) -> Largest:
    """Interval of the largest relative difference, and whether it exceeds the margin.

    Parameters
    ----------
    ratios
        At one point at least, with two scenes at least.
    directions : (draws, scenes)
        See `tracknoise.findings.factors.rotation.rotations`.
    margin
        Largest relative difference that counts as no effect.
    level
        Minimum probability that the interval contains the true value.
    """
    points = _points(ratios)
    low, p_yes = _from_below(ratios, points, directions, margin, 1 - level)
    high, p_no = _from_above(ratios, points, directions, margin, (1 - level) / 2)
    return Largest(float(_over(points.size, points.common).max()), low, high, p_yes, p_no)


def _points(ratios: Ratios) -> _Points:
    differs, varies = (np.square(parts).sum(axis=0) for parts in (ratios.difference_parts, ratios.common_parts))
    mixed = np.einsum("sk,sk->k", ratios.difference_parts, ratios.common_parts) * np.sign(ratios.difference)
    return _Points(np.abs(ratios.difference), ratios.common, differs, varies, mixed, ratios.degrees)


def _from_below(
    ratios: Ratios, points: _Points, directions: NDArray[np.float64], margin: float, share: float
) -> tuple[float, float]:
    """Lower bound, and p-value of the hypothesis that the effect is at most the margin."""
    signed = np.sign(ratios.difference) * ratios.common_parts
    scenes = np.any(ratios.difference_parts, axis=1)
    turned = within(directions, scenes)
    errors = [ratios.difference_parts[scenes], (ratios.difference_parts - margin * signed)[scenes]]
    by_chance = np.minimum(*(best_by_chance(each, turned) for each in errors))
    excess = np.minimum(_over(points.size, np.sqrt(points.differs)), -_short_of(points, margin))
    best = float(2 * special.stdtr(points.degrees, -np.maximum(excess, 0.0)).min())
    t = _quantile(points, least_share(by_chance, share) / 2)
    p_yes = share_at_most(by_chance, best)
    too_few_rotations = best < by_chance[0]
    return float(_lower(points, t).max()), min(p_yes, len(excess) * best) if too_few_rotations else p_yes


def _from_above(
    ratios: Ratios, points: _Points, directions: NDArray[np.float64], margin: float, share: float
) -> tuple[float, float]:
    """Upper bound, and p-value of the hypothesis that the effect is at least the margin."""
    short = np.minimum(_short_of(points, margin), _over(points.common, np.sqrt(points.varies)))
    p = special.stdtr(points.degrees, -short)
    if not ratios.curve_parts.size:
        return float(_upper(points, _quantile(points, share)).max()), float(p.max())
    scenes = np.any(ratios.curve_parts, axis=(1, 2))
    by_chance = range_by_chance(ratios.curve_parts[scenes], within(directions, scenes))
    alone: NDArray[np.float64] = np.minimum(least_share(by_chance, share), share)[ratios.curve]
    worst = np.zeros(len(by_chance))
    np.maximum.at(worst, ratios.curve, p)
    p_no = max(share_at_most(chance, value) for chance, value in zip(by_chance, worst, strict=True))
    return float(_upper(points, _quantile(points, alone)).max()), max(p_no, float(p.max()))


def _quantile(points: _Points, tail: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Student's t that is exceeded with the given probability."""
    return np.asarray(-special.stdtrit(points.degrees, tail), dtype=np.float64)


def _short_of(points: _Points, ratio: float) -> NDArray[np.float64]:
    """By how many standard errors |d| is less than ratio times c."""
    variance = points.differs - 2 * ratio * points.mixed + ratio**2 * points.varies
    return _over(ratio * points.common - points.size, np.sqrt(np.maximum(variance, 0.0)))


def _lower(points: _Points, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least ratio e at which |d| - e c is at most t standard errors; 0 where |d| itself is."""
    square, linear, constant = _quadratic(points, t)
    root = np.sqrt(np.maximum(linear**2 - square * constant, 0.0))
    exceeds = points.size > t * np.sqrt(points.differs)
    return np.where(exceeds, _over(constant, np.maximum(linear + root, 0.0)), 0.0)


def _upper(points: _Points, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least ratio e beyond which e c - |d| is always t standard errors or more; infinite where c itself is not."""
    square, linear, constant = _quadratic(points, t)
    root = np.sqrt(np.maximum(linear**2 - square * constant, 0.0))
    return np.where(square > 0, (linear + root) / np.where(square > 0, square, 1.0), np.inf)


def _quadratic(points: _Points, t: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """a, b, c of a e^2 - 2 b e + c = 0, which holds where | |d| - e c | is t standard errors."""
    square = points.common**2 - t**2 * points.varies
    linear = points.size * points.common - t**2 * points.mixed
    return square, linear, points.size**2 - t**2 * points.differs


def _over(value: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """One by the other, which is not negative; where the other is 0: 0 by 0 is 0, all else infinite."""
    some = scale > 0
    beyond = np.where(value == 0, 0.0, np.copysign(np.inf, value))
    return np.where(some, value / np.where(some, scale, 1.0), beyond)
