"""Motion of the camera between two images, estimated from the images and, where there is depth, from depth."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.inspection.pairs import FEWEST_POINTS, Pair

_ITERATIONS, _CONVERGED_RAD = 12, 1e-8
_STEP_M = 1e-6
_TUKEY = 4.685
_SMALLEST = 1e-3
"""Lengths of epipolar lines below this count less: the direction of the point is almost that of the motion."""


def image_rotation(
    pair: Pair, camera: CameraModel, translation_m: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """(3,) float64: rotation vector of second_from_first in radians; NaN where it cannot be estimated.

    Parameters
    ----------
    pair
        Points of the two images. Their depths are used where there are enough.
    camera
        Intrinsics of both images.
    translation_m
        (3,) float64, metres: translation of second_from_first where it is known. It is used with depths only. Without
        it a small translation and a small rotation look much alike.
    """
    rotation = _from_depth(pair, camera, translation_m) if pair.has_depth else _from_directions(pair, camera)
    return rotation if np.isfinite(rotation).all() else np.full(3, np.nan)


def _from_depth(pair: Pair, camera: CameraModel, translation_m: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Rotation that, with the translation or any, moves the points of the first frame onto those of the second."""
    known = np.isfinite(pair.depth_first_m)
    points, observed = camera.unproject(pair.uv_first[known], pair.depth_first_m[known]), pair.uv_second[known]
    rotation = Rotation.identity()
    shift = np.zeros(3) if translation_m is None else translation_m
    for _ in range(_ITERATIONS):
        turned = rotation.apply(points)
        residual = observed - camera.project(turned + shift)
        usable = np.isfinite(residual).all(axis=1)
        if usable.sum() < FEWEST_POINTS:
            return np.full(3, np.nan)
        by_point = _by_point(camera, (turned + shift)[usable])
        jacobian = _by_rotation(by_point, turned[usable])
        if translation_m is None:
            jacobian = np.concatenate([jacobian, by_point], axis=-1)
        step = _weighted_step(jacobian, residual[usable])
        rotation = Rotation.from_rotvec(step[:3]) * rotation
        shift = shift if translation_m is not None else shift + step[3:]
        if np.linalg.norm(step[:3]) < _CONVERGED_RAD:
            break
    return np.asarray(rotation.as_rotvec(), dtype=np.float64)


def _by_point(camera: CameraModel, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2, 3) float64: derivative of pixels with respect to the points, px/m."""
    size = _STEP_M * points[:, 2:]
    sides = ((camera.project(points + size * axis), camera.project(points - size * axis)) for axis in np.eye(3))
    return np.stack([(above - below) / (2 * size) for above, below in sides], axis=-1)


def _by_rotation(by_point: NDArray[np.float64], turned: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2, 3) float64: derivative of pixels with respect to a small rotation of the points, px/rad."""
    return np.stack([np.einsum("nij,nj->ni", by_point, np.cross(axis, turned)) for axis in np.eye(3)], axis=-1)


def _weighted_step(jacobian: NDArray[np.float64], residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3 or 6,) float64: least squares with Tukey's weights, whose scale is the median residual."""
    length = np.linalg.norm(residual, axis=1)
    ratio = length / (_TUKEY * max(1.4826 * float(np.median(length)), 1e-3))
    root = np.where(ratio < 1.0, 1.0 - ratio**2, 0.0)[:, None]
    rows = (jacobian * root[..., None]).reshape(-1, jacobian.shape[-1])
    return np.asarray(np.linalg.lstsq(rows, (residual * root).ravel(), rcond=1e-9)[0], dtype=np.float64)


def _from_directions(pair: Pair, camera: CameraModel) -> NDArray[np.float64]:
    """Rotation for which, with the best direction of translation, points lie on their epipolar lines."""
    first, second = (_unit(camera.bearings(uv)) for uv in (pair.uv_first, pair.uv_second))
    usable = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
    first, second = first[usable], second[usable]
    if len(first) < FEWEST_POINTS:
        return np.full(3, np.nan)

    def distances(motion: NDArray[np.float64]) -> NDArray[np.float64]:
        lines = np.cross(motion[3:] / np.linalg.norm(motion[3:]), Rotation.from_rotvec(motion[:3]).apply(first))
        length = np.sqrt((lines**2).sum(axis=1) + _SMALLEST**2)
        return np.asarray((lines * second).sum(axis=1) / length, dtype=np.float64)

    scale = 0.5 / camera.width
    fits = [
        least_squares(distances, np.concatenate([np.zeros(3), axis]), loss="soft_l1", f_scale=scale)
        for axis in np.eye(3)
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    return np.asarray(best.x[:3], dtype=np.float64)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    unit: NDArray[np.float64] = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit
