"""Points of tracks: triangulated from known poses, and residuals of their observations with derivatives.

A pose errs by (a, b): the true one is (R exp(a), c + b), as in `tracknoise.geometry.projection`. Points are refined as
position and inverse depth (x / z, y / z, 1 / z) in a frame: their errors in these are nearly normal, even far away.
"""

import numpy as np
from numpy.typing import NDArray

from benchmarks.filter_tracks import Pieces
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.projection import cross_matrices

_REFINEMENTS = 2
_NEAREST_M, _FARTHEST_M, _WORST_CONDITION = 0.1, 60.0, 1e4
"""Points are used at these depths in the first frame of their track, and if its rays determine them so well."""


def from_inverse(frames: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 3) of positions and inverse depths (n, 3) in frames (n, 4, 4)."""
    local = np.column_stack([values[:, :2], np.ones(len(values))]) / values[:, 2:]
    return np.asarray(frames[:, :3, 3] + np.einsum("nij,nj->ni", frames[:, :3, :3], local))


def to_inverse(
    frames: NDArray[np.float64], points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions and inverse depths (n, 3) of points (n, 3) in frames (n, 4, 4), and the points' derivatives by them."""
    turned = frames[:, :3, :3]
    local = np.einsum("nji,nj->ni", turned, points - frames[:, :3, 3])
    depth = local[:, 2:]
    derivative = np.concatenate([turned[:, :, :2], -(turned @ local[:, :, None])], axis=2) * depth[:, :, None]
    return np.column_stack([local[:, :2], np.ones(len(points))]) / depth, derivative


def seen_from(poses: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(tracks, n, 3): points (tracks, 3) in the cameras (tracks, n, 4, 4) that see them."""
    return np.asarray(np.einsum("tnji,tnj->tni", poses[:, :, :3, :3], points[:, None] - poses[:, :, :3, 3]))


def residuals(
    camera: Camera,
    poses: NDArray[np.float64],
    points: NDArray[np.float64],
    uv: NDArray[np.float64],
    there: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """(tracks, 2 n): observed less predicted positions, px; 0 where there is no observation.

    Shapes: poses (tracks, n, 4, 4), points (tracks, 3), uv (tracks, n, 2), there (tracks, n).
    """
    slope = _slopes(seen_from(poses, points))
    images = np.array([camera.fx, camera.fy]) * slope + (camera.cx, camera.cy)
    return np.asarray(np.where(there[:, :, None], uv - images, 0.0).reshape(len(points), 2 * there.shape[1]))


def derivatives(
    camera: Camera, poses: NDArray[np.float64], points: NDArray[np.float64], there: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Of predictions, by poses (tracks, n, 2, 6) and by the point (tracks, 2 n, 3); shapes as in `residuals`."""
    count, length = poses.shape[:2]
    seen = seen_from(poses, points)
    focal = np.where(there[:, :, None], (camera.fx, camera.fy), 0.0) / seen[:, :, 2:]
    projected = np.zeros((count, length, 2, 3))
    projected[:, :, (0, 1), (0, 1)] = focal
    projected[:, :, :, 2] = -focal * _slopes(seen)
    by_point = projected @ np.swapaxes(poses[:, :, :3, :3], 2, 3)
    turned = projected @ cross_matrices(seen.reshape(-1, 3)).reshape(count, length, 3, 3)
    return np.concatenate([turned, -by_point], axis=3), by_point.reshape(count, 2 * length, 3)


def _slopes(seen: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(seen[:, :, :2] / seen[:, :, 2:])


def triangulated(
    camera: Camera, poses: NDArray[np.float64], tracks: Pieces
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Points (tracks, 3) nearest to the rays of tracks, refined in the image, and which of them are usable (tracks,).

    Shapes: poses (tracks, CLONES, 4, 4). Refined are position and inverse depth in the first frame.
    """
    there = tracks.there
    count, length = there.shape
    rays = camera.unproject(tracks.uv.reshape(-1, 2), np.ones(count * length)).reshape(count, length, 3)
    rays = np.einsum("tnij,tnj->tni", poses[:, :, :3, :3], rays / np.linalg.norm(rays, axis=2, keepdims=True))
    across = there[:, :, None, None] * (np.eye(3) - rays[:, :, :, None] * rays[:, :, None, :])
    system, centres = across.sum(axis=1), poses[:, :, :3, 3]
    usable = np.linalg.cond(system) < _WORST_CONDITION
    system[~usable] = np.eye(3)
    points = np.linalg.solve(system, np.einsum("tnij,tnj->ti", across, centres)[:, :, None])[:, :, 0]
    first = poses[:, 0]
    for _ in range(_REFINEMENTS):
        usable &= within(seen_from(poses, points))
        points[~usable] = (first[:, :3, 3] + first[:, :3, 2])[~usable]
        values, by_inverse = to_inverse(first, points)
        residual = residuals(camera, poses, points, tracks.uv, there)
        derivative = derivatives(camera, poses, points, there)[1] @ by_inverse
        derivative[~usable], residual[~usable] = np.eye(2 * length, 3), 0.0
        transposed = np.swapaxes(derivative, 1, 2)
        moved = values + np.linalg.solve(transposed @ derivative, transposed @ residual[:, :, None])[:, :, 0]
        usable &= moved[:, 2] > 1.0 / _FARTHEST_M
        moved[~usable, 2] = 1.0
        points = from_inverse(first, moved)
    return points, np.asarray(usable & within(seen_from(poses, points)))


def within(seen: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether points (tracks, n, 3) are before all cameras, and at a usable depth in the first."""
    ahead = (seen[:, :, 2] > _NEAREST_M).all(axis=1)
    return np.asarray(ahead & (seen[:, 0, 2] < _FARTHEST_M))
