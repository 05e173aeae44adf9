"""Radial-tangential (Brown-Conrady) lens distortion and its inverse, in the plane at depth 1.

A point at radius r is moved to the radius r N(r^2) / D(r^2), with N = 1 + k1 r^2 + k2 r^4 + k3 r^6 and, in the rational
model, D = 1 + k4 r^2 + k5 r^4 + k6 r^6, otherwise D = 1. The tangential terms p1 and p2 come on top of it.

Far from the axis the distorted radius may decrease again, back into the image. A point there has no image, although
the model gives it one.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

_STEPS = 100
_SOLVED = 1e-13
"""Residual, at depth 1, at which a position counts as found. Iteration continues below it if precision allows."""

Coefficients = tuple[float, ...]
"""k1, k2, p1, p2, then k3, then k4, k5, k6, in OpenCV's order; those that are missing are 0."""


def distort(xy: NDArray[np.float64], coefficients: Coefficients) -> NDArray[np.float64]:
    """Where a lens shows the points of the plane at depth 1.

    Parameters
    ----------
    xy
        (..., 2) float64, no unit.
    coefficients
        4, 5 or 8 of them.

    Returns
    -------
    (..., 2) float64
        NaN where the model is not one-to-one between the point and the axis: such a point has no image.
    """
    p1, p2 = coefficients[2:4]
    x, y = xy[..., 0], xy[..., 1]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        r2 = x * x + y * y
        radial, _ = _radial(r2, coefficients)
        distorted = np.stack(
            [
                x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
            ],
            axis=-1,
        )
        xx, xy_, yy = _jacobian(xy, coefficients)
        one_to_one = (r2 < _turning_r2(coefficients)) & (xx + yy > 0.0) & (xx * yy > xy_ * xy_)
    return np.where(one_to_one[..., None], distorted, np.nan)


def undistort(distorted: NDArray[np.float64], coefficients: Coefficients) -> NDArray[np.float64]:
    """Invert `distort` by Newton steps from the axis outwards, halved where they would not come closer.

    Each position is solved for itself: its result does not depend on what else is in the array.

    Parameters
    ----------
    distorted
        (..., 2) float64, no unit.
    coefficients
        4, 5 or 8 of them.

    Returns
    -------
    (..., 2) float64
        NaN where no point has this image.
    """
    xy = np.zeros_like(distorted)
    residual = distorted.copy()
    share = np.ones(distorted.shape[:-1])
    active = np.ones(distorted.shape[:-1], np.bool_)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for _ in range(_STEPS):
            trial = xy + share[..., None] * _newton_step(_jacobian(xy, coefficients), residual)
            remains = distorted - distort(trial, coefficients)
            closer = active & (_size(remains) < _size(residual))
            xy = np.where(closer[..., None], trial, xy)
            residual = np.where(closer[..., None], remains, residual)
            share = np.where(closer, np.minimum(2.0 * share, 1.0), 0.5 * share)
            active &= closer | (_size(residual) > _SOLVED)
            if not active.any():
                break
        return np.where((_size(residual) <= _SOLVED)[..., None], xy, np.nan)


_Symmetric = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def _jacobian(xy: NDArray[np.float64], coefficients: Coefficients) -> _Symmetric:
    """Derivative of the model, entries xx, xy and yy: it is symmetric."""
    p1, p2 = coefficients[2:4]
    x, y = xy[..., 0], xy[..., 1]
    radial, slope = _radial(x * x + y * y, coefficients)
    return (
        radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
        x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y,
        radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
    )


def _radial(r2: NDArray[np.float64], coefficients: Coefficients) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """N / D at squared radii, and twice its derivative with respect to them."""
    (k1, k2, k3), (k4, k5, k6) = _numerator_and_denominator(coefficients)
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
    if not (k4 or k5 or k6):
        return radial, slope
    below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
    below_slope = 2.0 * (k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6))
    return radial / below, (slope - radial / below * below_slope) / below


def _numerator_and_denominator(
    coefficients: Coefficients,
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    k1, k2, _, _, k3, k4, k5, k6 = (*coefficients, 0.0, 0.0, 0.0, 0.0)[:8]
    return (k1, k2, k3), (k4, k5, k6)


def _newton_step(jacobian: _Symmetric, residual: NDArray[np.float64]) -> NDArray[np.float64]:
    xx, xy, yy = jacobian
    u, v = residual[..., 0], residual[..., 1]
    return np.stack([yy * u - xy * v, xx * v - xy * u], axis=-1) / (xx * yy - xy * xy)[..., None]


def _size(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.hypot(vectors[..., 0], vectors[..., 1])


@lru_cache(maxsize=64)
def _turning_r2(coefficients: Coefficients) -> float:
    """Squared radius at which r N / D first stops growing, or D vanishes; infinity where neither happens.

    With s = r^2, the numerator of its derivative is (N + 2 s N') D - 2 s N D'.
    """
    above, below = (np.array([1.0, *terms]) for terms in _numerator_and_denominator(coefficients))
    power = 2.0 * np.arange(4)
    with np.errstate(over="ignore", invalid="ignore"):
        growth = np.convolve((1.0 + power) * above, below) - np.convolve(above, power * below)
    if not np.isfinite([*growth, *below]).all():
        return 0.0
    return min(_first_positive_root(growth), _first_positive_root(below))


def _first_positive_root(ascending: NDArray[np.float64]) -> float:
    """Smallest positive root of a polynomial that is 1 at 0; infinity where there is none.

    It is solved for the inverse of the root, which needs no division by the highest coefficient.
    """
    inverse = np.roots(ascending)
    positive = inverse.real[np.isreal(inverse) & (inverse.real > 0.0)]
    return 1.0 / float(positive.max()) if len(positive) else np.inf
