"""Radial-tangential (Brown-Conrady) lens distortion and its inverse, in the plane at depth 1.

The model is a polynomial: far enough from the axis it turns round and leads back into the image. A point out there has
no image, although the polynomial gives it one.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

_STEPS = 100
_SOLVED = 1e-13
"""Residual at which a position counts as found, at depth 1; where double precision allows it, steps go on below it."""


def distort(xy: NDArray[np.float64], coefficients: tuple[float, ...]) -> NDArray[np.float64]:
    """Where a lens shows the points of the plane at depth 1.

    Parameters
    ----------
    xy
        (..., 2) float64, no unit.
    coefficients
        k1, k2, p1, p2, k3, in OpenCV's order.

    Returns
    -------
    (..., 2) float64
        NaN where the model is not one-to-one between the point and the axis: such a point has no image.
    """
    k1, k2, p1, p2, k3 = coefficients
    x, y = xy[..., 0], xy[..., 1]
    with np.errstate(over="ignore", invalid="ignore"):
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
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


def undistort(distorted: NDArray[np.float64], coefficients: tuple[float, ...]) -> NDArray[np.float64]:
    """Invert `distort` by Newton steps from the axis outwards, halved where they would not come closer.

    Each position is solved for itself: its result does not depend on what else is in the array.

    Parameters
    ----------
    distorted
        (..., 2) float64, no unit.
    coefficients
        k1, k2, p1, p2, k3, in OpenCV's order.

    Returns
    -------
    (..., 2) float64
        NaN where no point has this image.
    """
    xy = np.zeros_like(distorted)
    residual = distorted.copy()
    share = np.ones(distorted.shape[:-1])
    active = np.ones(distorted.shape[:-1], np.bool_)
    with np.errstate(over="ignore", invalid="ignore"):
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


def _jacobian(xy: NDArray[np.float64], coefficients: tuple[float, ...]) -> _Symmetric:
    """Derivative of the model, entries xx, xy and yy: it is symmetric."""
    k1, k2, p1, p2, k3 = coefficients
    x, y = xy[..., 0], xy[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
    return (
        radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
        x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y,
        radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
    )


def _newton_step(jacobian: _Symmetric, residual: NDArray[np.float64]) -> NDArray[np.float64]:
    xx, xy, yy = jacobian
    u, v = residual[..., 0], residual[..., 1]
    return np.stack([yy * u - xy * v, xx * v - xy * u], axis=-1) / (xx * yy - xy * xy)[..., None]


def _size(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.hypot(vectors[..., 0], vectors[..., 1])


@lru_cache(maxsize=64)
def _turning_r2(coefficients: tuple[float, ...]) -> float:
    """Squared radius at which r (1 + k1 r^2 + k2 r^4 + k3 r^6) first stops growing; infinity where it never does.

    Its slope 1 + 3 k1 s + 5 k2 s^2 + 7 k3 s^3 in s = r^2 is solved for 1 / s, which needs no division by a coefficient.
    """
    k1, k2, _, _, k3 = coefficients
    slope = np.array([1.0, 3.0 * k1, 5.0 * k2, 7.0 * k3])
    if not np.isfinite(slope).all():
        return 0.0
    inverse = np.roots(slope)
    turning = inverse.real[np.isreal(inverse) & (inverse.real > 0.0)]
    return 1.0 / float(turning.max()) if len(turning) else np.inf
