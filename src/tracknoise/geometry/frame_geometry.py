"""The stated poses and cameras of the frames of a sequence, as arrays."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.jacobians import projection_jacobian
from tracknoise.geometry.pose import invert, transform


@dataclass(frozen=True, slots=True, eq=False)
class FrameGeometry:
    """Pose and camera of each frame of a sequence.

    Parameters
    ----------
    world_from_camera
        (frames, 4, 4) float64: the stated poses; NaN where there is none.
    cameras
        All different cameras.
    which
        (frames,) integers: place of the camera of each frame in `cameras`.
    """

    world_from_camera: NDArray[np.float64]
    cameras: tuple[CameraModel, ...]
    which: NDArray[np.intp]

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
        of: Callable[[CameraModel, NDArray[np.intp]], NDArray[np.float64]],
    ) -> NDArray[np.float64]:
        """Values of the rows of each camera, in their places."""
        values = np.full((len(frame), *shape), np.nan)
        used = self.which[frame]
        for number, camera in enumerate(self.cameras):
            rows = np.flatnonzero(used == number)
            values[rows] = of(camera, rows)
        return values
