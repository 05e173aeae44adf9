"""The cameras of observations of many frames, so that all are projected at once."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.jacobians import projection_jacobian
from tracknoise.sequences.sequence import Sequence, camera_at


@dataclass(frozen=True, slots=True, eq=False)
class ObservedCameras:
    """Projects points into the frames of observations, and gives rays through their pixels.

    Parameters
    ----------
    cameras
        All different cameras.
    which
        (n,) integers: place of the camera of each observation.
    """

    cameras: tuple[CameraModel, ...]
    which: NDArray[np.intp]

    @classmethod
    def of(cls, sequence: Sequence, frames: NDArray[np.intp]) -> "ObservedCameras":
        """The cameras of observations in these frames, (n,), of a sequence."""
        cameras: list[CameraModel] = []
        numbers = np.zeros(int(frames.max(initial=-1)) + 1, np.intp)
        for index in np.unique(frames).tolist():
            camera = camera_at(sequence, index)
            if camera not in cameras:
                cameras.append(camera)
            numbers[index] = cameras.index(camera)
        return cls(tuple(cameras), numbers[frames])

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2) float64, px: points of the camera frames, (n, 3) float64; NaN where one has no image."""
        return self._each(lambda camera, rows: camera.project(points[rows]), 2)

    def bearings(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) float64: rays through pixels (n, 2), px, scaled to depth 1; NaN where a pixel has none."""
        return self._each(lambda camera, rows: camera.bearings(uv[rows]), 3)

    def contain(self, uv: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(n,) bool: whether pixels (n, 2) lie in the image."""
        return self._each(lambda camera, rows: camera.contains(uv[rows])[:, None], 1)[:, 0] > 0

    def jacobians(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2, 3) float64, px per metre: see `projection_jacobian`; points of the camera frames, (n, 3) float64."""
        flat = self._each(lambda camera, rows: projection_jacobian(camera, points[rows]).reshape(-1, 6), 6)
        return flat.reshape(-1, 2, 3)

    def centres(self) -> NDArray[np.float64]:
        """(n, 2) float64, px: the images of the optical axes."""
        axis = np.array([[0.0, 0.0, 1.0]])
        return self._each(lambda camera, rows: np.repeat(camera.project(axis), len(rows), axis=0), 2)

    def chosen(self, rows: NDArray[np.intp]) -> "ObservedCameras":
        """The cameras of some of the observations."""
        return ObservedCameras(self.cameras, self.which[rows])

    def _each(
        self, of: Callable[[CameraModel, NDArray[np.intp]], NDArray[np.generic]], width: int
    ) -> NDArray[np.float64]:
        """Values of each camera's observations, in their rows."""
        values = np.full((len(self.which), width), np.nan)
        for number, camera in enumerate(self.cameras):
            rows = np.flatnonzero(self.which == number)
            values[rows] = of(camera, rows)
        return values
