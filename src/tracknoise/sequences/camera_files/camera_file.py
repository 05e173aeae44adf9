"""What a calibration file says about one camera."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, first_line
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.lenses import KnownCamera, make_camera
from tracknoise.geometry.shutter import RollingShutter

_POSITIONS = 65
_ROUND_TRIP_PX = 1e-6
_LEAST_SHARE = 0.5
"""A lens that gives less of the image a ray is not the lens of these images."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraFile:
    """One camera of a calibration file.

    Parameters
    ----------
    camera
        The camera.
    body_from_camera
        (4, 4) float64, metres: X_body = body_from_camera X_camera, where the body is what the file relates the camera
        to, usually the IMU. None where the file does not say.
    time_shift_s
        To be added to the time of an image to get the time of the body's clock, seconds; None where unknown.
    rate_hz
        Frames per second; None where unknown.
    depth_unit_m
        Depth of the integer 1 in depth images, metres; None where unknown.
    shutter
        Rolling shutter of the camera; None where all rows are exposed together, or the file does not say.
    """

    camera: CameraModel
    body_from_camera: NDArray[np.float64] | None = None
    time_shift_s: float | None = None
    rate_hz: float | None = None
    depth_unit_m: float | None = None
    shutter: RollingShutter | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence where the lens gives a part of the image no ray."""
        share = share_with_ray(self.camera)
        if share == 1.0:
            return ()
        missing = max(round(100.0 * (1.0 - share)), 1)
        return (f"the camera model gives about {missing} % of the image no ray; features there have no truth",)


def share_with_ray(camera: CameraModel) -> float:
    """Share of the image whose pixels have a ray that leads back to them within 1e-6 px, 0 to 1."""
    u = np.linspace(-0.5, camera.width - 0.5, _POSITIONS)
    v = np.linspace(-0.5, camera.height - 0.5, _POSITIONS)
    uv = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    with np.errstate(all="ignore"):
        back = np.abs(camera.project(camera.bearings(uv)) - uv).max(axis=1)
        return float(np.mean(back <= _ROUND_TRIP_PX))


def checked_camera(
    place: str | Path,
    model: str,
    size: tuple[int, int],
    intrinsics: Sequence[float],
    coefficients: tuple[float, ...],
) -> KnownCamera:
    """Make a camera that sees something in at least half of its image.

    Parameters
    ----------
    place
        The file, for messages.
    model, size, intrinsics, coefficients
        As `tracknoise.geometry.lenses.make_camera` takes them.

    Raises
    ------
    DataError
        If a value is impossible, or more than half of the image has no ray.
    """
    try:
        camera = make_camera(model, size, intrinsics, coefficients)
    except ValueError as error:
        raise DataError(place, f"an impossible camera ({first_line(error)})", f"a {model} camera") from error
    share = share_with_ray(camera)
    if share < _LEAST_SHARE:
        found = f"intrinsics and distortion that give only {share:.0%} of the image a ray"
        raise DataError(place, found, "those of this image size")
    return camera
