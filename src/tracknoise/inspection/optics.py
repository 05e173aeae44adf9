"""Focal length and principal point of any camera model."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel


def focal_px(camera: CameraModel) -> float:
    """Pixels per unit of slope at the centre of the image."""
    centre = np.array([(camera.width - 1) / 2, (camera.height - 1) / 2])
    rays = camera.bearings(centre + np.array([[-0.5, 0.0], [0.5, 0.0]]))
    return float(1.0 / abs(rays[1, 0] - rays[0, 0]))


@lru_cache
def principal_point(camera: CameraModel) -> NDArray[np.float64]:
    """(2,) float64: pixel of the optical axis."""
    centre: NDArray[np.float64] = camera.project(np.array([[0.0, 0.0, 1.0]]))[0]
    return centre
