"""Projection of points into images of known poses, how pixels change with both, and rectified pairs of images.

A rectified pair are pinhole cameras side by side, whose rows are the same. The rectified x axis points from the first
camera to the second, wherever that is, so that disparities are positive. The rectified image covers what the first
camera sees, up to 60 degrees from its axis.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.cameras import Camera, CameraModel
from tracknoise.geometry.pose import invert, transform

_STEP = 1e-5
"""Step of the differences, relative to the depth: their relative error is about 1e-10."""


def projection_jacobian(camera: CameraModel, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative of the image of points: d pi(X) / dX.

    The derivatives by x and y are central differences, so that any lens will do. A camera with a single centre maps all
    points of a ray to one pixel, so that the derivative along the ray is 0; this gives the derivative by z.

    Parameters
    ----------
    camera
        The camera.
    points
        (n, 3) float64, metres, camera frame, not at z = 0.

    Returns
    -------
    (n, 2, 3) float64
        px per metre; NaN where a point has no image.
    """
    jacobian = np.empty((len(points), 2, 3))
    step_m = _STEP * np.abs(points[:, 2])
    for axis in (0, 1):
        moved = np.zeros_like(points)
        moved[:, axis] = step_m
        jacobian[:, :, axis] = (camera.project(points + moved) - camera.project(points - moved)) / (
            2.0 * step_m[:, None]
        )
    along = jacobian[:, :, 0] * points[:, :1] + jacobian[:, :, 1] * points[:, 1:2]
    jacobian[:, :, 2] = -along / points[:, 2:]
    return jacobian


def image_derivatives(
    camera: CameraModel, world_from_camera: NDArray[np.float64], points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Derivatives of the images of points by the pose that sees them, and by the point.

    A pose (R, c) is moved by (a, b) to (R exp(a), c + b): a turns the camera about its own axes, b moves it along
    those of the world.

    Parameters
    ----------
    camera
        The camera.
    world_from_camera
        (n, 4, 4) float64: one pose for each point.
    points
        (n, 3) float64, world, metres.

    Returns
    -------
    by_pose : (n, 2, 6) float64
        px per radian about x, y, z, then px per metre along x, y, z.
    by_point : (n, 2, 3) float64
        px per metre along x, y, z of the world.
    """
    camera_from_world = invert(world_from_camera)
    seen = transform(camera_from_world, points)
    projected = projection_jacobian(camera, seen)
    by_point = projected @ camera_from_world[:, :3, :3]
    return np.concatenate([projected @ cross_matrices(seen), -by_point], axis=2), by_point


def cross_matrices(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3, 3) float64: matrices of the cross product with vectors (n, 3) on the left."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


@dataclass(frozen=True, slots=True, eq=False)
class FrameGeometry:
    """Pose and camera of each frame of a sequence."""

    world_from_camera: NDArray[np.float64]  # (frames, 4, 4) float64: the stated poses; NaN where there is none
    cameras: tuple[CameraModel, ...]  # all different cameras
    which: NDArray[np.intp]  # (frames,) integers: place of the camera of each frame in `cameras`

    def in_units_of(self, length_m: float) -> "FrameGeometry":
        """The same with another unit of length, and the mean position of the camera as the origin of the world."""
        poses = self.world_from_camera.copy()
        poses[:, :3, 3] = (poses[:, :3, 3] - np.nanmean(poses[:, :3, 3], axis=0)) / length_m
        return replace(self, world_from_camera=poses)

    def to_world(self, frame: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) float64: points of the camera frames of frames (n,), in the world."""
        return transform(self.world_from_camera[frame], points)

    def to_camera(self, frame: NDArray[np.int64], points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) float64: points of the world, in the camera frames of frames (n,)."""
        return transform(invert(self.world_from_camera)[frame], points_world)

    def unproject(
        self, frame: NDArray[np.int64], uv: NDArray[np.float64], depth: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(n, 3) float64, world: the points at pixels (n, 2) of frames (n,), at depths (n,)."""
        points = self._each(frame, (3,), lambda camera, rows: camera.unproject(uv[rows], depth[rows]))
        return self.to_world(frame, points)

    def jacobian(self, frame: NDArray[np.int64], points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2, 3) float64, px per unit: derivative of the images of points by their position in the world."""
        points = self.to_camera(frame, points_world)
        by_camera = self._each(frame, (2, 3), lambda camera, rows: projection_jacobian(camera, points[rows]))
        camera_from_world = np.swapaxes(self.world_from_camera[:, :3, :3], 1, 2)
        return np.asarray(by_camera @ camera_from_world[frame])

    def _each(
        self,
        frame: NDArray[np.int64],
        shape: tuple[int, ...],
        compute: Callable[[CameraModel, NDArray[np.intp]], NDArray[np.float64]],
    ) -> NDArray[np.float64]:
        """Values of the rows of each camera, in their places."""
        values = np.full((len(frame), *shape), np.nan)
        used = self.which[frame]
        for number, camera in enumerate(self.cameras):
            rows = np.flatnonzero(used == number)
            values[rows] = compute(camera, rows)
        return values


_WIDEST_SLOPE = np.sqrt(3.0)
_SMALL = 1e-4
_OUTLINE_POSITIONS = 65


@dataclass(frozen=True, slots=True, eq=False)
class Rectification:
    """A rectified pair."""

    camera: Camera  # the camera of both rectified images
    baseline_m: float  # distance between the two cameras, metres
    # first_from_rectified, second_from_rectified: (3, 3) float64, rotations of directions
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


def rectifying_maps(
    pair: Rectification, first: CameraModel, second: CameraModel
) -> tuple[tuple[NDArray[np.float32], NDArray[np.float32]], ...]:
    """Columns and rows (height, width), px, at which both images are read for the rectified ones, as OpenCV takes them.

    Positions outside of an image are far outside.
    """
    maps = []
    for camera, rotation in ((first, pair.first_from_rectified), (second, pair.second_from_rectified)):
        finite = np.nan_to_num(origins(pair.camera, camera, rotation), nan=-1e4).astype(np.float32)
        maps.append((np.ascontiguousarray(finite[..., 0]), np.ascontiguousarray(finite[..., 1])))
    return tuple(maps)


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
