"""Distribution of the best of many tests by chance alone, from random rotations of the data.

The contributions of n scenes to an error form a vector e. It is multiplied with a random direction w, where the test
uses equal weights. The cosine r of their angle makes t = r sqrt(n - 1) / sqrt(1 - r^2), which has exactly Student's
distribution of n - 1 degrees of freedom for each e, while those of all e together depend on each other as the data do.
With few scenes and many tests the best of them tends to Scheffé's bound.

Source: Ø. Langsrud, Statistics and Computing 15 (2005).
"""

import numpy as np
from numpy.typing import NDArray
from scipy import special

_CHUNK = 4096
"""Vectors that are rotated at a time."""
_DECIMALS = 12
"""To which cosines are rounded, so that the order in which a processor adds up does not show."""


def rotations(n_scenes: int, *, n_draws: int, seed: int) -> NDArray[np.float64]:
    """Random directions in as many dimensions as there are scenes: (n_draws, n_scenes), rows of length 1."""
    return _unit_rows(np.random.default_rng(seed).standard_normal((n_draws, n_scenes)))


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


def range_by_chance(parts: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """One-sided p-values of ranges whose ends are where chance put them.

    Of curves that consist of error only, the highest and the lowest place are chosen in every rotation, and their
    difference is tested as if they had been chosen beforehand.

    Parameters
    ----------
    parts : (scenes, curves, places)
        What each scene adds to the error of each place.
    directions : (draws, scenes)
        Rows of length 1.

    Returns
    -------
    (curves, draws) float64
        Sorted by draws.
    """
    scenes, curves, places = parts.shape
    draws = len(directions)
    products = np.einsum("sck,scl->ckl", parts, parts, optimize=True)
    squares = np.einsum("ckk->ck", products)
    lengths = np.sqrt(np.maximum(squares[:, :, None] + squares[:, None] - 2 * products, 0.0))
    cosine = np.zeros((curves, draws))
    step = max(1, _CHUNK // places)
    for start in range(0, curves, step):
        some = slice(start, start + step)
        count = min(step, curves - start)
        turned = (directions @ parts[:, some].reshape(scenes, count * places)).reshape(draws, count, places)
        top, bottom = turned.argmax(axis=2), turned.argmin(axis=2)
        spread = np.take_along_axis(turned, top[..., None], 2) - np.take_along_axis(turned, bottom[..., None], 2)
        length = lengths[some][np.arange(count), top, bottom]
        cosine[some] = (spread[..., 0] / np.where(length > 0, length, 1.0)).T
    return np.sort(_upper_tail(cosine, scenes), axis=1)


def share_at_most(by_chance: NDArray[np.float64], p: float) -> float:
    """P-value of a p-value, given those by chance, sorted: what share is at most that, its own counted, too."""
    return (1 + int(np.searchsorted(by_chance, p, side="right"))) / (1 + len(by_chance))


def least_share(by_chance: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """The p-value whose own p-value (`share_at_most`) is `share`, along the last axis; 0 with too few draws."""
    rank = int(share * (by_chance.shape[-1] + 1) + 1e-9)
    return by_chance[..., rank - 1] if rank else np.zeros(by_chance.shape[:-1])


def _unit_rows(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    unit: NDArray[np.float64] = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit


def _upper_tail(cosine: NDArray[np.float64], n_scenes: int) -> NDArray[np.float64]:
    """Probability of a larger cosine."""
    r, degrees = np.clip(np.round(cosine, _DECIMALS), 0.0, 1.0), max(n_scenes - 1.0, 1.0)  # none: no error at all
    with np.errstate(divide="ignore"):
        student = r * np.sqrt(degrees) / np.sqrt(1 - r**2)
    tail: NDArray[np.float64] = special.stdtr(degrees, -student)
    return tail
