"""How pixels change with the points that they show."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel

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
