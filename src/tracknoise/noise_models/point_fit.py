"""Points fitted to tracks by least squares with a covariance of all observations, to first order.

With F the derivatives of the positions by the point, e the errors and C their assumed covariance, the point errs by

    dX = P F' C^-1 e,  and its claimed covariance is  P = (F' C^-1 F)^-1    (point_fit)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.noise_models.linear_benchmark import EXACT

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FittedPoints:
    """Points of tracks, and what is left of the errors.

    Attributes
    ----------
    step : (tracks, 3) float64
        dX.
    claimed : (tracks, 3, 3) float64
        P.
    residuals : (tracks, n) float64
        e - F dX.
    """

    step: Array
    claimed: Array
    residuals: Array

    def along(self, directions: Array) -> tuple[Array, Array]:
        """Errors of the points along directions (tracks, 3), and these over their claimed standard deviations."""
        moved = np.einsum("ti,ti->t", directions, self.step)
        variance = np.einsum("ti,tij,tj->t", directions, self.claimed, directions)
        return moved, moved / np.sqrt(variance)


def fit_points(by_point: Array, errors: Array, covariance: Array) -> FittedPoints:
    """Fit points to tracks of equal length, (point_fit).

    Parameters
    ----------
    by_point
        (tracks, n, 3) float64: derivatives of the n coordinates of each track by its point.
    errors
        (tracks, n) float64, px.
    covariance
        (tracks, n, n) or (n, n) float64, px^2, of full rank.
    """
    weighted = np.asarray(np.linalg.solve(covariance, by_point), dtype=np.float64)
    claimed = np.asarray(np.linalg.inv(np.swapaxes(by_point, 1, 2) @ weighted), dtype=np.float64)
    step = np.einsum("tij,tnj,tn->ti", claimed, weighted, errors)
    return FittedPoints(step, claimed, errors - np.einsum("tni,ti->tn", by_point, step))


def of_full_rank(covariances: Array) -> Array:
    """Covariances (tracks, n, n) with a small variance added, so that no observation is exact."""
    size = covariances.shape[1]
    level = np.trace(covariances, axis1=1, axis2=2) / size
    added: Array = covariances + EXACT**2 * level[:, None, None] * np.eye(size)
    return added
