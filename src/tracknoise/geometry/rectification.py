"""Two cameras seen as a rectified pair: pinhole cameras side by side, whose rows are the same.

The rectified x axis points from the first camera to the second, wherever that is, so that disparities are positive. The
rectified image covers what the first camera sees, up to 60 degrees from its axis.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera import Camera
from tracknoise.geometry.camera_model import CameraModel

_WIDEST_SLOPE = np.sqrt(3.0)
_SMALL = 1e-4
_OUTLINE_POSITIONS = 65


@dataclass(frozen=True, slots=True, eq=False)
class Rectification:
    """A rectified pair.

    Parameters
    ----------
    camera
        The camera of both rectified images.
    baseline_m
        Distance between the two cameras, metres.
    first_from_rectified, second_from_rectified
        (3, 3) float64, rotations of directions.
    """

    camera: Camera
    baseline_m: float
    first_from_rectified: NDArray[np.float64]
    second_from_rectified: NDArray[np.float64]


def rectify(first: CameraModel, first_from_second: NDArray[np.float64]) -> Rectification:
    """Rectify two cameras.

    Parameters
    ----------
    first
        The first camera; the rectified images have its focal length.
    first_from_second
        (4, 4) float64, metres, rigid: pose of the second camera in the first.

    Raises
    ------
    ValueError
        If the cameras are in one place, or one is ahead of the other.
    """
    across = first_from_second[:3, 3]
    baseline_m = float(np.linalg.norm(across))
    ahead = first_from_second[:3, 2] + (0.0, 0.0, 1.0)
    if not baseline_m > 0.0 or np.linalg.norm(np.cross(across, ahead)) < 0.5 * baseline_m * np.linalg.norm(ahead):
        raise ValueError(f"the second camera is at {across.tolist()} m from the first, expected it beside the first")
    x = across / baseline_m
    y = np.cross(ahead, x) / np.linalg.norm(np.cross(ahead, x))
    rotation = np.stack([x, y, np.cross(x, y)], axis=1)
    camera = _covering(first, rotation)
    return Rectification(camera, baseline_m, rotation, first_from_second[:3, :3].T @ rotation)


def origins(rectified: Camera, camera: CameraModel, camera_from_rectified: NDArray[np.float64]) -> NDArray[np.float64]:
    """(height, width, 2) float64: where a camera shows each pixel of its rectified image, px; NaN where it does not."""
    v, u = np.indices((rectified.height, rectified.width), dtype=np.float64)
    return camera.project(rectified.bearings(np.stack([u, v], axis=-1)) @ camera_from_rectified.T)


def _covering(first: CameraModel, first_from_rectified: NDArray[np.float64]) -> Camera:
    """The pinhole camera, with the focal length of the first camera, that covers what this sees."""
    on_axis, beside = first.project(np.array([[0.0, 0.0, 1.0], [_SMALL, 0.0, 1.0]]))
    focal = float(np.linalg.norm(beside - on_axis)) / _SMALL
    u, v = (np.linspace(0.0, side - 1.0, _OUTLINE_POSITIONS) for side in (first.width, first.height))
    rays = first.bearings(np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)) @ first_from_rectified
    slopes = rays[:, :2] / np.where(rays[:, 2:] > 0.0, rays[:, 2:], np.nan)
    slopes = np.clip(slopes[np.isfinite(slopes).all(axis=1)], -_WIDEST_SLOPE, _WIDEST_SLOPE)
    least, most = slopes.min(axis=0), slopes.max(axis=0)
    width, height = (int(side) for side in np.rint((most - least) * focal) + 1)
    return Camera(width, height, focal, focal, *(-least * focal).tolist())
