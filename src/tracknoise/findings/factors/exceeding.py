"""Tests of whether differences exceed a margin, one at a time and the best of many: arrays only.

For a mean difference d with standard error se, a margin m, and Student's distribution of its degrees of freedom, with
t = (|d| - m) / se and upper tail P:

- p_above = P(t) + P(t + 2 m / se) (above): that the difference is at most m. It is the probability of so large a |d|
  if the true one is at the margin. With m = 0 it is that of the paired t test.
- p_below = P(-t) (below): that the difference is at least m.

Of several, the best p-value is an answer only as far as it is seldom so small by chance (Westfall and Young's min-p).
Chance is that of the scenes' differences rotated (`tracknoise.findings.sampling.rotation`). Where there are too few
rotations to estimate this, a p-value is multiplied by the number of tests (Bonferroni).

Source: P. Westfall, S. Young, Resampling-based multiple testing (1993).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.findings.factors.averages import Averages
from tracknoise.findings.sampling.rotation import best_by_chance, least_share, students, within

_ROUNDING = 1e-12
"""Standard errors below this, relative to the difference and the margin, are rounding."""
_HALVINGS = 30


@dataclass(frozen=True, slots=True)
class Best:
    """The clearest of several differences.

    Attributes
    ----------
    chosen
        Which it is.
    p
        P-value of the hypothesis that none of them exceeds the margin.
    """

    chosen: int
    p: float


def best_of_few(found: Averages, margin: float, directions: NDArray[np.float64]) -> Best:
    """The difference that exceeds the margin the most clearly by (above).

    Parameters
    ----------
    found
        At one point at least.
    margin
        Not negative.
    directions : (draws, dimensions)
        See `tracknoise.findings.sampling.rotation.rotations`.
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
    some = np.any(found.parts, axis=1)
    return found.parts[some], within(directions, some)


def _largest(t: NDArray[np.float64], degrees: NDArray[np.float64]) -> int:
    """The least probable of some values of t: only the largest of each number of degrees can be."""
    each = [np.flatnonzero(degrees == number) for number in np.unique(degrees)]
    largest = np.array([places[np.argmax(t[places])] for places in each])
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
