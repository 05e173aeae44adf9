"""How a second moment grows with age: a constant part, a random walk, and a drift.

Over the ages k of a condition the second moment about zero M(k) is fitted by

    M(k) = white^2 + walk^2 k + drift^2 k^2,  none of the three negative (growth)

with weighted least squares. Three columns have only seven subsets. Unbounded least squares is solved for each, and the
best solution without a negative number is used (Lawson and Hanson 1974, without the search that more columns need).
The solutions are linear in M, so any number of draws takes one matrix product.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TERMS = ("white", "walk", "drift")
TERM_UNITS = ("px", "px per sqrt(frame)", "px per frame")
"""Units of the roots of their coefficients."""
_POWERS = np.arange(len(TERMS))
_SUBSETS = [list(subset) for size in (1, 2, 3) for subset in combinations(range(len(TERMS)), size)]


def fit_growth(second: Array, since: Array, weight: Array) -> Array:
    """white^2, walk^2 and drift^2 of (growth), (3, ...): px^2, px^2 per frame and px^2 per frame^2.

    Parameters
    ----------
    second : (ages, ...)
        M, px^2.
    since : (ages,)
        k, frames; above 0.
    weight : (ages,)
        Of each squared residual.
    """
    columns, observed, unit = _weighted(second, since, weight)
    aligned = columns.T @ observed
    best, coefficients = np.zeros(observed.shape[1]), np.zeros_like(aligned)
    for subset in _SUBSETS:
        solution = np.linalg.pinv(columns[:, subset]) @ observed
        explained = (solution * aligned[subset]).sum(axis=0)  # what the sum of squares loses by it
        better = (solution >= 0).all(axis=0) & (explained > best)
        best = np.where(better, explained, best)
        full = np.zeros_like(aligned)
        full[subset] = solution
        coefficients = np.where(better, full, coefficients)
    return (coefficients * unit).reshape(len(TERMS), *second.shape[1:])


def fit_freely(second: Array, since: Array, weight: Array) -> Array:
    """The same without bounds: coefficients of (growth) that may come out negative, but are right on average.

    Parameters
    ----------
    second, since, weight
        As in `fit_growth`.
    """
    columns, observed, unit = _weighted(second, since, weight)
    solution: Array = np.linalg.pinv(columns) @ observed * unit
    return solution.reshape(len(TERMS), *second.shape[1:])


def contributions(coefficients: Array, since: Array) -> Array:
    """Share of each term in the fitted second moment, mean over the ages, (3, ...); NaN where all are zero.

    Parameters
    ----------
    coefficients : (3, ...)
        What `fit_growth` returned.
    since : (ages,)
        k, frames.
    """
    mean = (since[:, None] ** _POWERS).mean(axis=0)
    parts = coefficients * mean.reshape(-1, *[1] * (coefficients.ndim - 1))
    total = parts.sum(axis=0)
    shares: Array = parts / np.where(total > 0, total, np.nan)
    return shares


def misfit(second: Array, since: Array, coefficients: Array) -> float:
    """Root mean square of what the fit (3,) misses of the second moment (ages,), relative to it.

    Parameters
    ----------
    second, since, coefficients
        As in `fit_growth`, of one curve.
    """
    fitted = (since[:, None] ** _POWERS) @ coefficients
    return float(np.sqrt(np.mean((fitted / second - 1) ** 2)))


def _weighted(second: Array, since: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Columns of the fit and what was observed, both weighted; and what a coefficient of theirs is worth, (3, 1)."""
    root = np.sqrt(weight)[:, None]
    longest = since.max()
    columns = (since / longest)[:, None] ** _POWERS * root
    return columns, root * second.reshape(len(since), -1), 1 / (longest**_POWERS)[:, None]
