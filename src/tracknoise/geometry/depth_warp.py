"""A depth map of one camera, seen from another: what a colour camera needs of the depth sensor beside it."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import EDGE_RELATIVE_SPREAD, DepthMap
from tracknoise.geometry.pose import transform

_TOUCH = 1e-9
"""How far outside of a triangle a pixel may lie, in px and in barycentric coordinates: rounding must leave no holes."""

_STRIP = 16
"""Rows whose triangles are drawn together: few enough for the processor's cache."""


def reproject_depth(
    depth: DepthMap,
    camera: CameraModel,
    target: CameraModel,
    target_from_camera: NDArray[np.float64],
    *,
    spread: float = EDGE_RELATIVE_SPREAD,
) -> DepthMap:
    """Depth of every pixel of a target camera, from the dense depth map of another camera.

    Each four neighbouring pixels of the map are two triangles of the surface. A triangle across a discontinuity is left
    out. A target pixel gets the depth of the triangle on its ray, the nearest of several. Inverse depth is
    interpolated in the target image, so that planes stay exact. Pixels without a triangle have no depth: holes are not
    filled.

    Parameters
    ----------
    depth
        Dense depth along the z axis of `camera`.
    camera, target
        Both cameras.
    target_from_camera
        (4, 4) float64, metres: from the frame of `camera` to that of `target`.
    spread
        Largest relative difference between the depths of a triangle's corners, no unit.

    Returns
    -------
    DepthMap
        Of the target's size; depth in float64.
    """
    points = transform(target_from_camera, _points(depth, camera))
    ahead = depth.valid.ravel() & (points[:, 2] > 0.0)
    uv = target.project(np.where(ahead[:, None], points, np.nan))
    inverse = np.where(ahead, 1.0 / np.where(ahead, points[:, 2], 1.0), np.nan)
    vertices = np.stack([*uv.T, inverse]).reshape(3, *depth.valid.shape)
    nearest = np.zeros(target.height * target.width)
    for top in range(0, len(vertices[0]) - 1, _STRIP):
        _draw(nearest, target, _corners(vertices[:, top : top + _STRIP + 1]), spread)
    seen = nearest > 0.0
    depth_m = np.divide(1.0, nearest, out=np.zeros_like(nearest), where=seen)
    size = (target.height, target.width)
    return DepthMap(depth_m.reshape(size), seen.reshape(size), accuracy=depth.accuracy)


def _points(depth: DepthMap, camera: CameraModel) -> NDArray[np.float64]:
    """(pixels, 3) float64, metres, camera frame: arbitrary where the depth is not valid."""
    rows, columns = np.indices(depth.valid.shape, dtype=np.float64)
    uv = np.stack([columns, rows], axis=-1).reshape(-1, 2)
    return camera.unproject(uv, np.where(depth.valid, depth.depth_m, 1.0).astype(np.float64).ravel())


def _corners(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Upper left, upper right, lower left and lower right vertices of each four pixels: (4, 3, n)."""
    halves = (slice(None, -1), slice(1, None))
    return np.stack([vertices[:, rows, columns].reshape(3, -1) for rows in halves for columns in halves])


def _draw(nearest: NDArray[np.float64], target: CameraModel, corners: NDArray[np.float64], spread: float) -> None:
    """Enter the inverse depth of quadrilaterals where it is the largest of a pixel so far.

    Each corner has u and v in px, and inverse depth in 1/m; NaN where there is no depth.
    """
    size = np.array([[target.width], [target.height]], dtype=np.float64)
    low = np.maximum(np.ceil(_reduced(np.fmin, corners[:, :2]) - _TOUCH), 0.0)
    high = np.minimum(np.floor(_reduced(np.fmax, corners[:, :2]) + _TOUCH), size - 1.0)
    extent = high - low
    covering = np.flatnonzero((extent[0] >= 0.0) & (extent[1] >= 0.0))  # not where all corners are NaN
    low, extent, corners = low[:, covering], extent[:, covering], corners[:, :, covering]
    columns, rows = (extent.max(axis=1, initial=-1.0) + 1.0).astype(np.intp)
    for step in np.ndindex(int(columns), int(rows)):
        reached = slice(None) if not any(step) else (extent[0] >= step[0]) & (extent[1] >= step[1])
        u, v = low[0, reached] + step[0], low[1, reached] + step[1]
        value, inside = _interpolated(corners[:, :, reached], u, v, spread)
        np.maximum.at(nearest, (v[inside] * target.width + u[inside]).astype(np.intp), value[inside])


def _reduced(extreme: np.ufunc, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Minimum or maximum of four corners, as three calls: faster than a reduction along the first axis."""
    return np.asarray(extreme(extreme(corners[0], corners[1]), extreme(corners[2], corners[3])))


def _interpolated(
    corners: NDArray[np.float64], u: NDArray[np.float64], v: NDArray[np.float64], spread: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Inverse depth at one pixel of each quadrilateral, and whether one of its two smooth triangles covers the pixel.

    The triangles share the side from the upper right to the lower left.
    """
    first, right, below, last = corners
    u1, v1, inverse1 = below - right
    du, dv = u - right[0], v - right[1]
    with np.errstate(all="ignore"):  # of triangles without an area
        upper = (u1 * dv - v1 * du) * (u1 * (first[1] - right[1]) - v1 * (first[0] - right[0])) >= 0.0
        third = np.where(upper, first, last)
        u2, v2, inverse2 = third - right
        area = u1 * v2 - v1 * u2
        along, across = (du * v2 - dv * u2) / area, (u1 * dv - v1 * du) / area
        inside = (along >= -_TOUCH) & (across >= -_TOUCH) & (along + across <= 1.0 + _TOUCH)
        near = (right[2], below[2], third[2])
        inside &= np.maximum.reduce(near) <= (1.0 + spread) * np.minimum.reduce(near)
        return right[2] + along * inverse1 + across * inverse2, inside
