"""Distance of observed positions from the epipolar line of the first one: what two frames and their poses tell.

The first position of a track has the ray m. With the pose R, t of the first camera in a later one, the position there
lies on the plane with the normal e = t x R m. For an observed position x with the ray b(x), f = e . b(x) is zero on the
epipolar line, and to first order

    d = f / |df/dx|    (truth.epipolar)

is the signed distance from it, px. White noise of variance s^2 in both positions gives d the variance
s^2 (1 + |df/dx_1|^2 / |df/dx|^2). This holds for every camera model. Errors along the line do not appear.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

LEAST_ANGLE = 0.02
"""Rays at a smaller angle to the translation, rad, have no epipolar line: its direction would depend on the noise."""
_STEP_PX = 1e-3

Rays = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Takes pixels (n, 2); returns rays (n, 3)."""


def epipolar_distances(
    uv: NDArray[np.float64],
    first_uv: NDArray[np.float64],
    rays: Rays,
    first_rays: Rays,
    camera_from_first: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Signed distances from epipolar lines, and their variances for white noise of 1 px: (truth.epipolar).

    Parameters
    ----------
    uv, first_uv
        (n, 2) float64, px: positions, and the first positions of their tracks.
    rays, first_rays
        Rays through pixels of the cameras of `uv`, and of those of `first_uv`.
    camera_from_first
        (n, 4, 4) float64: poses of the first cameras in those of `uv`.

    Returns
    -------
    (n, 2) float64
        Distance, px, and its variance, px^2; NaN where there is no epipolar line. A distance is positive on the side
        to which the normal t x R m points.
    """
    rotation, translation = camera_from_first[:, :3, :3], camera_from_first[:, :3, 3]
    turned = np.einsum("nij,nj->ni", rotation, first_rays(first_uv))
    normal = np.cross(translation, turned)
    seen = rays(uv)
    backward = np.einsum("nij,ni->nj", rotation, np.cross(seen, translation))
    here = np.einsum("ni,nij->nj", normal, _derivative(rays, uv))
    there = np.einsum("ni,nij->nj", backward, _derivative(first_rays, first_uv))
    length = np.linalg.norm(translation, axis=1) * np.linalg.norm(turned, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        apart = np.linalg.norm(normal, axis=1) / length >= LEAST_ANGLE
        slope = np.linalg.norm(here, axis=1)
        distance = np.einsum("ni,ni->n", normal, seen) / slope
        variance = 1.0 + np.square(there).sum(axis=1) / np.square(slope)
    return np.where(apart[:, None], np.column_stack([distance, variance]), np.nan)


def _derivative(rays: Rays, uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative of rays by pixels, (n, 3, 2)."""
    steps = (np.array([_STEP_PX, 0.0]), np.array([0.0, _STEP_PX]))
    return np.stack([(rays(uv + step) - rays(uv - step)) / (2.0 * _STEP_PX) for step in steps], axis=-1)
