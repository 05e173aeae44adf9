"""How a second moment grows with age: a constant part, a random walk, and a drift.

Over the ages k of a condition the second moment about zero M(k) is fitted by

    M(k) = white^2 + walk^2 k + drift^2 k^2,  none of the three negative (growth)

with weighted least squares. Three columns have only seven subsets. Unbounded least squares is solved for each, and the
best solution without a negative number is used (Lawson and Hanson 1974, without the search that more columns need).
The solutions are linear in M, so any number of draws takes one matrix product.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TERMS = ("white", "walk", "drift")
TERM_UNITS = ("px", "px per sqrt(frame)", "px per frame")
"""Units of the roots of their coefficients."""
_POWERS = np.arange(len(TERMS))
_SUBSETS = np.array([of for of in product((0.0, 1.0), repeat=len(TERMS)) if any(of)])
"""Which columns each subset has, (subsets, 3); the last has all."""


@dataclass(frozen=True, slots=True)
class GrowthFit:
    """Fits of (growth) at the same ages with the same weights: what they share does not depend on what is fitted.

    Attributes
    ----------
    root : (ages, 1)
        Of the weights.
    columns : (ages, 3)
        Of the fit, weighted.
    unit : (3, 1)
        What a coefficient of these columns is worth.
    inverses : (subsets, 3, ages)
        The pseudo-inverse of the columns of each subset; 0 for columns that are not of it.
    """

    root: Array
    columns: Array
    unit: Array
    inverses: Array

    @classmethod
    def at(cls, since: Array, weight: Array) -> "GrowthFit":
        """Prepare fits.

        Parameters
        ----------
        since : (ages,)
            k, frames; above 0.
        weight : (ages,)
            Of each squared residual.
        """
        root, longest = np.sqrt(weight)[:, None], since.max()
        columns = (since / longest)[:, None] ** _POWERS * root
        inverses = np.linalg.pinv(columns * _SUBSETS[:, None]) * _SUBSETS[..., None]
        return cls(root, columns, 1 / (longest**_POWERS)[:, None], inverses)

    def bounded(self, second: Array) -> Array:
        """white^2, walk^2 and drift^2 of (growth), (3, ...): px^2, px^2 per frame and px^2 per frame^2.

        Parameters
        ----------
        second : (ages, ...)
            M, px^2.
        """
        observed = self._observed(second)
        solutions = (self.inverses.reshape(-1, len(observed)) @ observed).reshape(*_SUBSETS.shape, -1)
        explained = np.einsum("stc,tc->sc", solutions, self.columns.T @ observed)  # what the sum of squares loses
        explained[solutions.min(axis=1) < 0] = 0.0
        best = explained.argmax(axis=0)[None]
        chosen = np.take_along_axis(solutions, best[None], axis=0)[0]
        coefficients = np.where(np.take_along_axis(explained, best, axis=0) > 0, chosen, 0.0)
        return (coefficients * self.unit).reshape(len(TERMS), *second.shape[1:])

    def free(self, second: Array) -> Array:
        """The same without bounds: coefficients that may come out negative, but are right on average."""
        solution: Array = self.inverses[-1] @ self._observed(second) * self.unit
        return solution.reshape(len(TERMS), *second.shape[1:])

    def alone(self, second: Array) -> Array:
        """Each coefficient if its term made all of the mean second moment of the ages: in (growth) none is larger."""
        whole = second.mean(axis=0).reshape(1, -1) / (self.columns / self.root).mean(axis=0)[:, None]
        return np.asarray(whole * self.unit).reshape(len(TERMS), *second.shape[1:])

    def _observed(self, second: Array) -> Array:
        """Weighted second moments, (ages, curves)."""
        return self.root * second.reshape(len(self.root), -1)


def contributions(coefficients: Array, since: Array) -> Array:
    """Share of each term in the fitted second moment, mean over the ages, (3, ...); NaN where all are zero.

    Parameters
    ----------
    coefficients : (3, ...)
        What `GrowthFit.bounded` returned.
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
        M and k of one curve, and what `GrowthFit.bounded` returned for it.
    """
    fitted = (since[:, None] ** _POWERS) @ coefficients
    return float(np.sqrt(np.mean((fitted / second - 1) ** 2)))
