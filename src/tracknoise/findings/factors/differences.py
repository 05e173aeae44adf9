"""Differences between the levels of a factor, paired by scene: arrays only."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Differences:
    """Differences of every scene between every two levels.

    Attributes
    ----------
    values : (scenes, pairs, points) float64
        The first level minus the second, NaN where a scene lacks one of them.
    pairs : (pairs, 2) intp
        Numbers of the levels.
    both : (scenes, pairs) bool
        Which scenes were measured at both levels, whether or not they have a value.
    unlike : (pairs, points) bool
        Where a scene has a value of 0 at one of the two levels only, so that they have no ratio.
    horizon : (pairs,) float64
        Common horizon of the lifetimes of both levels, frames; NaN for other statistics.
    scarce : (pairs, 2) bool
        Levels that have so few events that their value is too large rather than right.
    gap
        Why nothing can be shown to be alike, however similar the levels are; None if there is no such reason.
    """

    values: NDArray[np.float64]
    pairs: NDArray[np.intp]
    both: NDArray[np.bool_]
    unlike: NDArray[np.bool_]
    horizon: NDArray[np.float64]
    scarce: NDArray[np.bool_]
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
        there = np.take(~np.isnan(levels), pairs, axis=1).all(axis=2)
        unlike = ((a != b) & there).any(axis=0)
    return Differences(values, pairs, at_both(measured), unlike, np.full(len(pairs), np.nan), none_scarce(pairs))


def _minus(levels: NDArray[np.float64], pairs: NDArray[np.intp]) -> NDArray[np.float64]:
    return np.asarray(np.take(levels, pairs[:, 0], axis=1) - np.take(levels, pairs[:, 1], axis=1))


def at_both(measured: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which scenes were measured at both levels of each pair, (scenes, pairs)."""
    return np.asarray(measured[:, pairs_of(measured.shape[1])].all(axis=2), dtype=np.bool_)
