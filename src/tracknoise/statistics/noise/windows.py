"""Windows of the first N observations of a track, as an estimator sees them: with a 3-D point that is fitted to them.

Errors e about the true point X are 2 N numbers. The point that least squares fit to the observations, with the true
poses, absorbs the part F dX, where F are the derivatives of the true positions by X. To first order the residuals are

    r = (I - F F^+) e    (window.residual)

They do not depend on the error of the first position, which moves all true positions by F dX, too. The point is moved
across the ray of its first observation, in two directions, and along it, by a share of its distance. With g for the
part of the derivative by this share that the other two cannot replace, the distance errs by

    (g e) / (g g) = z / |g|,  z = (g e) / |g|    (window.depth)

For independent noise of s px in each coordinate, z has the standard deviation s, whatever the motion. |g| is the
parallax of the window, px: the noise of s px leaves the distance uncertain by the share s / |g|. Where it is below
`LEAST_PARALLAX_PX` the window does not show the depth. Two degrees of freedom are then absorbed, else three.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LEAST_PARALLAX_PX = 1.0
"""Parallax |g| of a window that shows the depth of its point, px: noise of 1 px leaves it uncertain by 100 %."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedWindows:
    """Windows of N observations each, after the fit of their points.

    Attributes
    ----------
    squares : (windows, 2) float64
        Sums of the squared residuals in u and v, px^2.
    freedom : (windows, 2) float64
        Their degrees of freedom; 2 N - 3 in all, or 2 N - 2 where the window does not show the depth.
    z_px : (windows,) float64
        (window.depth), px; NaN where the window does not show the depth.
    """

    squares: NDArray[np.float64]
    freedom: NDArray[np.float64]
    z_px: NDArray[np.float64]


def fit_windows(
    errors_px: NDArray[np.float64], jacobian: NDArray[np.float64], ray_m: NDArray[np.float64]
) -> FittedWindows:
    """Fit a point to each window, (window.residual) and (window.depth).

    Parameters
    ----------
    errors_px
        (windows, N, 2) float64: observed minus true positions, px.
    jacobian
        (windows, N, 2, 3) float64, px per metre: derivatives of the true positions by the true point.
    ray_m
        (windows, 3) float64, metres: from the camera of the first observation to the true point, not of length 0.
    """
    across, along = directions(ray_m)
    lateral = np.linalg.qr((jacobian @ across[:, None]).reshape(len(ray_m), -1, 2))[0]
    depth = (jacobian @ along[:, None, :, None]).reshape(len(ray_m), -1)
    errors = errors_px.reshape(len(ray_m), -1)
    g = _without(depth, lateral)
    parallax_px = np.linalg.norm(g, axis=1)
    shown = parallax_px >= LEAST_PARALLAX_PX
    unit = g / np.where(shown, parallax_px, 1.0)[:, None]
    left = _without(errors, lateral)
    z_px = np.einsum("wi,wi->w", unit, left)
    left = np.where(shown[:, None], left - z_px[:, None] * unit, left)
    taken = np.square(lateral).sum(axis=2) + np.where(shown[:, None], unit**2, 0.0)
    return FittedWindows(_by_axis(left**2), _by_axis(1.0 - taken), np.where(shown, z_px, np.nan))


def directions(ray_m: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two directions across each ray (n, 3), as columns (n, 3, 2), metres, as long as the ray; and the ray itself."""
    length = np.linalg.norm(ray_m, axis=1)
    least = np.argmin(np.abs(ray_m), axis=1)
    axis = np.eye(3)[least]
    first = np.cross(ray_m, axis)
    first *= (length / np.linalg.norm(first, axis=1))[:, None]
    second = np.cross(ray_m, first) / length[:, None]
    return np.stack([first, second], axis=2), ray_m


def _without(values: NDArray[np.float64], basis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (windows, n) without their parts in the span of orthonormal ones (windows, n, k)."""
    parts = np.einsum("wnk,wn->wk", basis, values)
    left: NDArray[np.float64] = values - np.einsum("wnk,wk->wn", basis, parts)
    return left


def _by_axis(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums over the observations of windows, (windows, 2 N) with u and v in turn, by axis: (windows, 2)."""
    return np.asarray(values.reshape(len(values), -1, 2).sum(axis=1))
