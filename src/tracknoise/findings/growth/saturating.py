"""A second moment that grows with age towards a limit: an Ornstein-Uhlenbeck process that begins at birth.

Over the ages k of a condition the second moment about zero M(k) is fitted by

    M(k) = white^2 + size^2 (1 - exp(-k / tau)),  neither size negative (saturating)

with weighted least squares. For a given tau only the two squares are unknown, and there are three subsets of the two
columns. All time constants of a grid are tried, from a quarter of the shortest to four times the longest age. The best
is refined by a parabola through the residuals of its neighbours.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRID = 100
"""Time constants that are tried, evenly spaced on the log scale."""
_SHORTEST, _LONGEST = 0.25, 4.0
"""Range of time constants, relative to the shortest and the longest age."""


def fit_saturating(second: Array, since: Array, weight: Array) -> Array:
    """white^2 and size^2 (px^2) and tau (frames) of (saturating), (3, ...).

    Parameters
    ----------
    second : (ages, ...)
        M, px^2.
    since : (ages,)
        k, frames; above 0.
    weight : (ages,)
        Of each squared residual.
    """
    observed = second.reshape(len(since), -1)
    grid = np.geomspace(_SHORTEST * since.min(), _LONGEST * since.max(), GRID)
    explained = np.stack([_squares(observed, since, weight, np.full(observed.shape[1], tau))[0] for tau in grid])
    tau = _refined(np.log(grid), explained)
    best = explained.max(axis=0)
    finer, squares = _squares(observed, since, weight, tau)
    coarse = grid[explained.argmax(axis=0)]
    kept = finer >= best
    squares = np.where(kept, squares, _squares(observed, since, weight, coarse)[1])
    return np.stack([*squares, np.where(kept, tau, coarse)]).reshape(3, *second.shape[1:])


def saturating_curve(coefficients: Array, since: Array) -> Array:
    """M(k) of (saturating), (ages, ...).

    Parameters
    ----------
    coefficients : (3, ...)
        What `fit_saturating` returned.
    since : (ages,)
        k, frames.
    """
    white, size, tau = coefficients
    ages = since.reshape(-1, *[1] * tau.ndim)
    return np.asarray(white - size * np.expm1(-ages / tau))


def _squares(observed: Array, since: Array, weight: Array, tau: Array) -> tuple[Array, Array]:
    """By how much the fit with each tau reduces the sum of squares, and white^2 and size^2."""
    column = -np.expm1(-since[:, None] / tau)
    weighted = weight[:, None] * observed
    b0, b1 = weighted.sum(axis=0), (column * weighted).sum(axis=0)
    a00, a01, a11 = weight.sum(), weight @ column, weight @ column**2
    determinant = np.maximum(a00 * a11 - a01**2, 1e-12 * a00 * a11)
    both = np.stack([a11 * b0 - a01 * b1, a00 * b1 - a01 * b0]) / determinant
    alone = np.maximum(np.stack([b0 / a00, b1 / a11]), 0.0)
    explained = alone * np.stack([b0, b1])
    zero = np.zeros_like(b0)
    single = np.where(explained[0] >= explained[1], np.stack([alone[0], zero]), np.stack([zero, alone[1]]))
    inside = (both >= 0).all(axis=0)
    found = np.where(inside, both, single)
    return np.where(inside, both[0] * b0 + both[1] * b1, explained.max(axis=0)), found


def _refined(log_tau: Array, explained: Array) -> Array:
    """Where the parabola through the best point of the grid and its neighbours has its highest point."""
    best = explained.argmax(axis=0)
    middle = np.clip(best, 1, len(log_tau) - 2)
    low, here, high = (np.take_along_axis(explained, (middle + shift)[None], axis=0)[0] for shift in (-1, 0, 1))
    bend = low - 2 * here + high
    bent = (bend < 0) & (middle == best)
    shift = np.where(bent, 0.5 * (low - high) / np.where(bent, bend, -1.0), best - middle)
    return np.asarray(np.exp(log_tau[middle] + shift * (log_tau[1] - log_tau[0])))
