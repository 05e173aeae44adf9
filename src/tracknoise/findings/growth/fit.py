"""How a second moment grows with age: a constant part, a random walk, and a drift.

Over the ages k of a condition the second moment about zero M(k) is fitted by

    M(k) = white^2 + walk^2 k + drift^2 k^2,  none of the three negative (growth)

with weighted least squares. Three columns have only seven subsets. Unbounded least squares is solved for each, and the
best solution without a negative number is used (Lawson and Hanson 1974, without the search that more columns need).
The solutions are linear in M, so any number of draws takes one matrix product.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TERMS = ("white", "walk", "drift")
TERM_UNITS = ("px", "px per sqrt(frame)", "px per frame")
"""Units of the roots of their coefficients."""
_POWERS = np.arange(len(TERMS))
_SUBSETS = [list(combinations(range(len(TERMS)), size)) for size in (1, 2, 3)]
"""Of the columns, by size: those of one size are inverted together."""
_ALL = _SUBSETS[-1][0]


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
    inverses
        The pseudo-inverse of the columns of each subset, (columns, ages).
    """

    root: Array
    columns: Array
    unit: Array
    inverses: Mapping[tuple[int, ...], Array]

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
        inverses: dict[tuple[int, ...], Array] = {}
        for subsets in _SUBSETS:
            together = np.linalg.pinv(np.stack([columns[:, subset] for subset in subsets]))
            inverses |= dict(zip(subsets, together, strict=True))
        return cls(root, columns, 1 / (longest**_POWERS)[:, None], inverses)

    def bounded(self, second: Array) -> Array:
        """white^2, walk^2 and drift^2 of (growth), (3, ...): px^2, px^2 per frame and px^2 per frame^2.

        Parameters
        ----------
        second : (ages, ...)
            M, px^2.
        """
        observed = self._observed(second)
        aligned = self.columns.T @ observed
        best, coefficients = np.zeros(observed.shape[1]), np.zeros_like(aligned)
        for subset, inverse in self.inverses.items():
            solution, places = inverse @ observed, list(subset)
            explained = (solution * aligned[places]).sum(axis=0)  # what the sum of squares loses by it
            better = (solution >= 0).all(axis=0) & (explained > best)
            best = np.where(better, explained, best)
            full = np.zeros_like(aligned)
            full[places] = solution
            coefficients = np.where(better, full, coefficients)
        return (coefficients * self.unit).reshape(len(TERMS), *second.shape[1:])

    def free(self, second: Array) -> Array:
        """The same without bounds: coefficients that may come out negative, but are right on average."""
        solution: Array = self.inverses[_ALL] @ self._observed(second) * self.unit
        return solution.reshape(len(TERMS), *second.shape[1:])

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
