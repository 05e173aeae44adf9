"""Poses from which the rows of an image are taken: at the time of each row, and during the exposure."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.interpolation import PosePath
from tracknoise.simulation.imaging import Imaging


@dataclass(frozen=True, slots=True, eq=False)
class CameraPath:
    """The path of a camera between its frames (truth.shutter).

    Between frames the position is linear in time and the rotation spherically linear. Times are counted in frames.

    Parameters
    ----------
    world_from_camera
        (n, 4, 4) float64: the pose of each frame; n at least 2 if poses between frames are requested.
    imaging
        Rate, shutter and exposure.
    """

    world_from_camera: NDArray[np.float64]
    imaging: Imaging

    def of_rows(self, frame: float, camera: CameraModel, *, late_s: float = 0.0) -> NDArray[np.float64]:
        """Pose of an image: (4, 4) float64, or (height, 4, 4), one for each row, with a rolling shutter.

        Parameters
        ----------
        frame
            Time of the middle of the image, in frames; times before the first and after the last frame are allowed.
        camera
            Of the image.
        late_s
            Seconds after this time.
        """
        rows = np.arange(camera.height, dtype=np.float64)
        return self._at(frame, camera, np.stack([np.zeros_like(rows), rows], axis=-1), late_s)

    def of_pixels(self, frame: float, camera: CameraModel, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pose of pixels (n, 2): (4, 4) float64, or (n, 4, 4) with a rolling shutter. Parameters as for `of_rows`."""
        return self._at(frame, camera, uv, 0.0)

    def during_exposure(self, frame: float, camera: CameraModel) -> Iterator[NDArray[np.float64]]:
        """Poses of the images whose mean is taken, each as from `of_rows`."""
        if not self.imaging.exposure_s:
            yield self.of_rows(frame, camera)
            return
        count = self.imaging.exposure_renders
        for index in range(count):
            late_s = self.imaging.exposure_s * ((index + 0.5) / count - 0.5)
            yield self.of_rows(frame, camera, late_s=late_s)

    def _at(self, frame: float, camera: CameraModel, uv: NDArray[np.float64], late_s: float) -> NDArray[np.float64]:
        shutter = self.imaging.shutter
        if shutter is not None:
            return self._between(frame + (shutter.delays_s(camera, uv) + late_s) * self.imaging.rate_hz)
        time = frame + late_s * self.imaging.rate_hz
        if time == int(time) and 0 <= time < len(self.world_from_camera):
            return np.asarray(self.world_from_camera[int(time)])
        return np.asarray(self._between(np.array([time]))[0])

    def _between(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        return PosePath(np.arange(len(self.world_from_camera), dtype=np.float64), self.world_from_camera).at(times)
