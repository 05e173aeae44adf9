"""Robust losses on whitened residuals, and the NEES that a right model has under one.

A right model has a NEES of its own under a robust loss. Solvers report the inverse of the Gauss-Newton Hessian,
1 / E[w] for residuals of covariance 1. The estimate has the variance E[psi^2] / E[psi']^2. For blocks of two residuals
of norm r, with weights w(r) and psi = w r,

    NEES / dof = E[w] E[w^2 r^2] / 2 / E[w + r w' / 2]^2    (loss.nees)

This is not 1. A right model that is judged without it looks wrong.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

OF_POINT = 3
"""Numbers that a point of a track takes from its residuals."""


class LossKind(StrEnum):
    """How the cost grows with the squared norm of a whitened residual."""

    SQUARED = "squared"
    HUBER = "huber"
    CAUCHY = "cauchy"


@dataclass(frozen=True, slots=True)
class Loss:
    """A loss, as Ceres, GTSAM and g2o define it."""

    kind: LossKind = LossKind.SQUARED  # which one
    knee: float = np.inf  # where it begins to differ from the square: in standard deviations

    def weights(self, whitened: NDArray[np.float64]) -> NDArray[np.float64]:
        """(tracks, 2 n) float64: how much each residual counts, 1 under the squared loss."""
        return np.repeat(self._weights(squared_norms(whitened)), 2, axis=1)

    def _weights(self, squares: NDArray[np.float64]) -> NDArray[np.float64]:
        match self.kind:
            case LossKind.HUBER:
                return np.asarray(self.knee / np.maximum(np.sqrt(squares), self.knee))
            case LossKind.CAUCHY:
                return np.asarray(1.0 / (1.0 + squares / self.knee**2))
            case _:
                return np.ones_like(squares)


def squared_norms(whitened: NDArray[np.float64]) -> NDArray[np.float64]:
    """(tracks, n) float64: squared norms of the residuals of observations, (tracks, 2 n)."""
    return np.asarray(np.square(whitened).reshape(len(whitened), -1, 2).sum(axis=2))


PLAIN = Loss()
"""The squared loss."""


_NORMS = np.concatenate([np.linspace(0.0, 40.0, 80_001), np.geomspace(40.0, 1e5, 20_001)[1:]])


def expected_nees(loss: Loss, *, nu: float = np.inf, scale: float = 1.0) -> float:
    """(loss.nees) of observations.

    `loss`: of whitened observations; `nu`: degrees of freedom of Student's distribution of the errors; infinite for a
    Gaussian; `scale`: standard deviation of a Gaussian, or square root of the scale of a Student, in units of the
    assumed one.
    """
    density = _density(_NORMS / scale, nu) / scale
    weight = loss.weights(np.stack([_NORMS, np.zeros_like(_NORMS)], axis=1))[:, 0]
    slope = np.gradient(weight, _NORMS)
    claimed = _mean(weight, density)
    spread = _mean(weight**2 * _NORMS**2, density) / 2.0
    return claimed * spread / _mean(weight + _NORMS * slope / 2.0, density) ** 2


def _density(norms: NDArray[np.float64], nu: float) -> NDArray[np.float64]:
    """Of the norm of two coordinates of scale 1."""
    if np.isfinite(nu):
        return np.asarray(norms * (1.0 + norms**2 / nu) ** (-nu / 2.0 - 1.0))
    return np.asarray(norms * np.exp(-(norms**2) / 2.0))


def _mean(values: NDArray[np.float64], density: NDArray[np.float64]) -> float:
    return float(np.trapezoid(values * density, _NORMS))
