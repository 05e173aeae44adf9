"""Covariances of the errors of observations, of changes and of whole tracks, from the components of a model.

All are of (noise_model.error). In the form ``birth`` errors are about the first position, and its own error is part of
all of them. In the form ``free`` each observation has its own error only: the first one that of A, the others the rest.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Reference(StrEnum):
    """What the errors of a track are counted from."""

    BIRTH = "birth"
    """The first observation. Its error is part of all others."""
    FREE = "free"
    """The true positions: for estimators that solve for the point and have a residual for the first observation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Covariances:
    """A, W, Q and D, each (2, 2) float64, px^2 (Q per frame, D per frame^2)."""

    first: Array
    white: Array
    walk: Array
    drift: Array

    def of_errors(self, age: Array, magnification: Array, factor: Array) -> Array:
        """Covariances of errors about the first position, (n, 2, 2) px^2, at magnifications and factors (n,).

        The magnification is taken to have changed evenly since birth, and the factor to have been the same.
        """
        carried = age * (1.0 + magnification + magnification**2) / 3.0
        parts = (
            (magnification**2, self.first),
            (factor, self.white),
            (factor * carried, self.walk),
            (age**2, self.drift),
        )
        return sum((_scaled(scale, covariance) for scale, covariance in parts), np.zeros((len(age), 2, 2)))

    def of_changes(self, frames: Array, factor: Array) -> Array:
        """Covariances of changes over a number of frames after the first one, (n, 2, 2) px^2."""
        parts = (2.0 * factor, self.white), (factor * frames, self.walk), (frames**2, self.drift)
        return sum((_scaled(scale, covariance) for scale, covariance in parts), np.zeros((len(frames), 2, 2)))

    def of_track(self, ages: Array, reference: Reference, magnification: Array, factor: Array) -> Array:
        """Covariance of the errors of a track, (2 m, 2 m) px^2, u and v in turn.

        Parameters
        ----------
        ages
            (m,) float64, increasing, frames.
        reference
            What errors are counted from.
        magnification, factor
            (m,) float64: M_k, and the factor on W and on the walk since the observation before.
        """
        later = ages > 0
        carried = np.outer(magnification, magnification)
        first = carried * np.outer(later, later) if reference == Reference.BIRTH else np.diag(1.0 * ~later)
        white, drift = np.diag(factor * later), np.outer(ages, ages)
        parts = (first, self.first), (white, self.white), (carried * _walked(ages, magnification, factor), self.walk)
        return np.asarray(sum(np.kron(scale, covariance) for scale, covariance in (*parts, (drift, self.drift))))


def _scaled(scale: Array, covariance: Array) -> Array:
    return np.asarray(scale[:, None, None] * covariance)


def _walked(ages: Array, magnification: Array, factor: Array) -> Array:
    """Sums of frames times factor / M_i^2 over the steps up to the earlier one of two observations, (m, m)."""
    steps = np.diff(ages, prepend=0.0) * factor / magnification**2
    total = np.cumsum(steps)
    return np.minimum.outer(total, total)
