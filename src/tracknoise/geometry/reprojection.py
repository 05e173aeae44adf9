"""Images of points seen from poses, and how they change with both."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.jacobians import projection_jacobian
from tracknoise.geometry.pose import invert, transform


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
