"""A second moment that grows with age towards a limit: an Ornstein-Uhlenbeck process that begins at birth.

Over the ages k of a condition the second moment about zero M(k) is fitted by

    M(k) = white^2 + size^2 (1 - exp(-k / tau)),  neither size negative (saturating)

with weighted least squares. For a given tau only the two squares are unknown, and there are three subsets of the two
columns. All time constants of a grid are tried, from a quarter of the shortest to four times the longest age. The best
is refined by a parabola through the residuals of its neighbours.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRID = 80
"""Time constants that are tried, evenly spaced on the log scale."""
_SHORTEST, _LONGEST = 0.25, 4.0
"""Range of time constants, relative to the shortest and the longest age."""


@dataclass(frozen=True, slots=True)
class SaturatingFit:
    """Fits of (saturating) at the same ages with the same weights.

    Attributes
    ----------
    since, weight : (ages,)
        k, frames, and the weight of each squared residual.
    grid : (taus,)
        Time constants that are tried, frames.
    columns : (taus, ages)
        1 - exp(-k / tau), weighted.
    alike : two of (taus, 1)
        Weighted products of that column with the constant and with itself.
    """

    since: Array
    weight: Array
    grid: Array
    columns: Array
    alike: tuple[Array, Array]

    @classmethod
    def at(cls, since: Array, weight: Array) -> "SaturatingFit":
        """Prepare fits.

        Parameters
        ----------
        since : (ages,)
            k, frames; above 0.
        weight : (ages,)
            Of each squared residual.
        """
        grid = np.geomspace(*range_tried(since), GRID)
        columns = -np.expm1(-since / grid[:, None])
        return cls(since, weight, grid, columns * weight, ((columns @ weight)[:, None], (columns**2 @ weight)[:, None]))

    def fit(self, second: Array) -> Array:
        """white^2 and size^2 (px^2) and tau (frames) of (saturating), (3, ...).

        Parameters
        ----------
        second : (ages, ...)
            M, px^2.
        """
        weight, observed = self.weight, second.reshape(len(self.since), -1)
        constant, total = weight @ observed, weight.sum()
        products = self.columns @ observed
        explained = _explained(constant, products, total, *self.alike)
        best, curve = explained.argmax(axis=0), np.arange(observed.shape[1])
        tau = _refined(np.log(self.grid), explained, best)
        own = -np.expm1(-self.since[:, None] / tau)
        finer = weight @ (own * observed), total, weight @ own, weight @ own**2
        kept = _explained(constant, *finer) >= explained[best, curve]
        on_grid = products[best, curve], total, *(alike[best, 0] for alike in self.alike)
        both = zip(_squares(constant, *finer), _squares(constant, *on_grid), strict=True)
        chosen = [np.where(kept, one, other) for one, other in both]
        return np.stack([*chosen, np.where(kept, tau, self.grid[best])]).reshape(3, *second.shape[1:])


def range_tried(since: Array) -> tuple[float, float]:
    """Shortest and longest time constant that are tried at some ages (ages,), frames."""
    return _SHORTEST * float(since.min()), _LONGEST * float(since.max())


def saturating_curve(coefficients: Array, since: Array) -> Array:
    """M(k) of (saturating), (ages, ...).

    Parameters
    ----------
    coefficients : (3, ...)
        What `SaturatingFit.fit` returned.
    since : (ages,)
        k, frames.
    """
    white, size, tau = coefficients
    ages = since.reshape(-1, *[1] * tau.ndim)
    return np.asarray(white - size * np.expm1(-ages / tau))


def _explained(b0: Array, b1: Array, a00: float, a01: Array, a11: Array) -> Array:
    """By how much the fit of `_squares` reduces the sum of squares."""
    white, size = _unbounded(b0, b1, a00, a01, a11)
    alone = np.maximum(np.maximum(b0 / a00, 0.0) * b0, np.maximum(b1 / a11, 0.0) * b1)
    return np.where((white >= 0) & (size >= 0), white * b0 + size * b1, alone)


def _squares(b0: Array, b1: Array, a00: float, a01: Array, a11: Array) -> tuple[Array, Array]:
    """white^2 and size^2, from weighted products of the columns.

    `b0` and `b1` are those of the constant and of 1 - exp(-k / tau) with what was observed, the others those of the
    columns with each other.
    """
    white, size = _unbounded(b0, b1, a00, a01, a11)
    only_white, only_size = np.maximum(b0 / a00, 0.0), np.maximum(b1 / a11, 0.0)
    inside = (white >= 0) & (size >= 0)
    constant = only_white * b0 >= only_size * b1
    white = np.where(inside, white, np.where(constant, only_white, 0.0))
    return white, np.where(inside, size, np.where(constant, 0.0, only_size))


def _unbounded(b0: Array, b1: Array, a00: float, a01: Array, a11: Array) -> tuple[Array, Array]:
    """The same where they may be negative."""
    determinant = np.maximum(a00 * a11 - a01**2, 1e-12 * a00 * a11)
    return (a11 * b0 - a01 * b1) / determinant, (a00 * b1 - a01 * b0) / determinant


def _refined(log_tau: Array, explained: Array, best: NDArray[np.intp]) -> Array:
    """Where the parabola through the best point of the grid and its neighbours has its highest point."""
    middle = np.clip(best, 1, len(log_tau) - 2)
    low, here, high = (np.take_along_axis(explained, (middle + shift)[None], axis=0)[0] for shift in (-1, 0, 1))
    bend = low - 2 * here + high
    bent = (bend < 0) & (middle == best)
    shift = np.where(bent, 0.5 * (low - high) / np.where(bent, bend, -1.0), best - middle)
    return np.asarray(np.exp(log_tau[middle] + shift * (log_tau[1] - log_tau[0])))
