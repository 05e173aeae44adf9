"""Several tests at once: adjusted p-values, intervals after a choice, and the best of many tests by chance alone.

Adjusted p-values and intervals
-------------------------------

With p_(1) <= ... <= p_(m) the p-values that there are, those that are missing left out:

- Holm's adjusted p_(i) = max over j <= i of min(1, (m - j + 1) p_(j)) (holm): to reject where it is at most alpha keeps
  the probability of any false rejection under alpha, however the tests depend on each other.
- Hochberg's adjusted p_(i) = min over j >= i of (m - j + 1) p_(j) (hochberg): the same if the tests are independent or
  positively dependent, as two-sided ones about two numbers are. It is never larger than Holm's.
- Benjamini and Hochberg's q_(i) = min over j >= i of min(1, m p_(j) / j) (bh): to reject where it is at most alpha
  keeps the expected share of false rejections among all rejections under alpha, if the tests are independent or
  positively dependent.

Questions that are answered on their own, such as those about sizes and those about lifetimes, are families: each of
them has the whole level (families). Then what is asked in one family makes no answer of another one harder to get. What
is promised above holds in each family, not for all of them together.

The interval of a number that was chosen among k has the level 1 - (1 - level) / k (bonferroni): then all k hold
together with at least the probability `level`, however they depend on each other. Student's intervals grow by the ratio
of the quantiles of both levels.

Sources: S. Holm, Scandinavian Journal of Statistics 6 (1979); Y. Hochberg, Biometrika 75 (1988), and S. Sarkar, Annals
of Statistics 26 (1998), on dependence; Y. Benjamini and Y. Hochberg, Journal of the Royal Statistical Society B 57
(1995); B. Efron, Annals of Applied Statistics 2 (2008), on separate families.

The best of many tests
----------------------

How good the best of many tests is by chance alone follows from random rotations of the data. The contributions of n
scenes (or groups of scenes) to an error form a vector e. It is multiplied with a random direction w, where the test
uses equal weights. The cosine r of their angle makes t = r sqrt(n - 1) / sqrt(1 - r^2), which has exactly Student's
distribution of n - 1 degrees of freedom for each e, while those of all e together depend on each other as the data do.
With few scenes and many tests the best of them tends to Scheffé's bound.

Source: Ø. Langsrud, Statistics and Computing 15 (2005).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from tracknoise.inference.estimates import Estimate

Values = Sequence[float | None] | ArrayLike


def holm(p: Values) -> NDArray[np.float64]:
    """Adjusted p-values by (holm).

    Parameters
    ----------
    p : (tests,)
        P-values; None or NaN where there was no test, which then does not count.

    Returns
    -------
    (tests,) float64
        NaN where there was no test.
    """
    return _adjusted(p, lambda ordered: np.maximum.accumulate(np.arange(len(ordered), 0, -1) * ordered))


def hochberg(p: Values) -> NDArray[np.float64]:
    """Adjusted p-values by (hochberg): see `holm`."""
    return _adjusted(p, lambda ordered: _least_from(np.arange(len(ordered), 0, -1) * ordered))


def benjamini_hochberg(p: Values) -> NDArray[np.float64]:
    """q-values by (bh): see `holm`."""
    return _adjusted(p, lambda ordered: _least_from(len(ordered) / np.arange(1, len(ordered) + 1) * ordered))


def in_families(adjust: Callable[[Values], NDArray[np.float64]], p: Values, family: ArrayLike) -> NDArray[np.float64]:
    """Adjusted p-values by (families).

    Parameters
    ----------
    adjust
        `holm`, `hochberg` or `benjamini_hochberg`.
    p : (tests,)
        P-values; None or NaN where there was no test, which then does not count.
    family : (tests,)
        Name or number of the family of each test.

    Returns
    -------
    (tests,) float64
        NaN where there was no test.
    """
    values = np.array(p, dtype=np.float64)
    names, number = np.unique(np.asarray(family), return_inverse=True)
    for index in range(len(names)):
        values[number == index] = adjust(values[number == index])
    return values


def chosen_among(one: Estimate, choices: int, *, degrees: float) -> Estimate:
    """An estimate whose interval allows for a choice by (bonferroni).

    Parameters
    ----------
    one
        A number without limits, such as a mean, with Student's interval and its level.
    choices
        How many numbers it was chosen among; with one, nothing changes.
    degrees
        Degrees of freedom of the interval.
    """
    if choices == 1 or one.value is None or one.low is None or one.high is None or one.level is None:
        return one
    level = 1 - (1 - one.level) / choices
    before, after = (special.stdtrit(max(degrees, 1.0), (1 + share) / 2) for share in (one.level, level))
    low, high = (one.value + float(after / before) * (end - one.value) for end in (one.low, one.high))
    return replace(one, low=low, high=high, level=level)


def _least_from(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The least of each value and all after it."""
    return np.minimum.accumulate(values[::-1])[::-1]


def _adjusted(p: Values, adjust: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> NDArray[np.float64]:
    """What `adjust` makes of the p-values that there are, from the least to the largest, put back in their places."""
    values = np.array(p, dtype=np.float64)
    places = np.flatnonzero(~np.isnan(values))
    order = places[np.argsort(values[places], kind="stable")]
    values[order] = np.minimum(adjust(values[order]), 1.0)
    return values


_CHUNK = 4096
"""Vectors that are rotated at a time."""
_DECIMALS = 12
"""To which cosines are rounded, so that the order in which a processor adds up does not show."""


@lru_cache(maxsize=16)
def rotations(n_scenes: int, *, n_draws: int, seed: int) -> NDArray[np.float64]:
    """Random directions in as many dimensions as there are scenes: (n_draws, n_scenes), rows of length 1, read-only."""
    directions = _unit_rows(np.random.default_rng(seed).standard_normal((n_draws, n_scenes)))
    directions.setflags(write=False)
    return directions


def within(directions: NDArray[np.float64], scenes: NDArray[np.bool_]) -> NDArray[np.float64]:
    """The same directions among some of the scenes only: as uniform there as they were among all."""
    return directions if scenes.all() else _unit_rows(directions[:, scenes])


def best_by_chance(parts: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least two-sided p-value of all vectors in every rotation.

    Parameters
    ----------
    parts : (scenes, vectors)
        Of any length; those of length 0 do not count.
    directions : (draws, scenes)
        Rows of length 1.

    Returns
    -------
    (draws,) float64
        Sorted.
    """
    length = np.linalg.norm(parts, axis=0)
    unit = parts / np.where(length > 0, length, 1.0)
    cosine = np.zeros(len(directions))
    for start in range(0, unit.shape[1], _CHUNK):
        turned = directions @ unit[:, start : start + _CHUNK]
        np.maximum(cosine, np.maximum(turned.max(axis=1), -turned.min(axis=1)), out=cosine)
    return np.sort(2 * _upper_tail(cosine, len(parts)))


def students(parts: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Student's t of each vector in every rotation, (draws, vectors), with a sign; 0 for vectors of length 0."""
    length = np.linalg.norm(parts, axis=0)
    return _student(directions @ (parts / np.where(length > 0, length, 1.0)), len(parts))


def share_at_most(by_chance: NDArray[np.float64], p: float) -> float:
    """P-value of a p-value, given those by chance, sorted: the share that is at most that, its own included."""
    return (1 + int(np.searchsorted(by_chance, p, side="right"))) / (1 + len(by_chance))


def least_share(by_chance: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """The p-value that a given share of p-values by chance, sorted along the last axis, is at most; 0 with too few."""
    rank = int(share * (by_chance.shape[-1] + 1) + 1e-9)
    return by_chance[..., rank - 1] if rank else np.zeros(by_chance.shape[:-1])


def _unit_rows(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    unit: NDArray[np.float64] = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit


def _upper_tail(cosine: NDArray[np.float64], dimensions: int) -> NDArray[np.float64]:
    """Probability of a larger cosine."""
    return np.asarray(special.stdtr(max(dimensions - 1.0, 1.0), -_student(cosine, dimensions)), dtype=np.float64)


def _student(cosine: NDArray[np.float64], dimensions: int) -> NDArray[np.float64]:
    """Student's t of cosines; no dimensions: no error at all."""
    r = np.clip(np.round(cosine, _DECIMALS), -1.0, 1.0)
    with np.errstate(divide="ignore"):
        return np.asarray(r * np.sqrt(max(dimensions - 1.0, 1.0)) / np.sqrt(1 - r**2), dtype=np.float64)
