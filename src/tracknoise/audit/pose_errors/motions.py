"""Small rigid motions (rho, phi), as vectors of six numbers, in the axes of different frames."""

import numpy as np
from numpy.typing import NDArray


def adjoints(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ad(T): a small motion in the axes of the source of T, in the axes of its target.

    With T = (R, t), Ad(T) (rho, phi) = (R rho + t x R phi, R phi).

    Parameters
    ----------
    poses
        (n, 4, 4) float64: target_from_source.

    Returns
    -------
    (n, 6, 6) float64
    """
    rotation, position = poses[:, :3, :3], poses[:, :3, 3]
    found = np.zeros((len(poses), 6, 6))
    found[:, :3, :3] = found[:, 3:, 3:] = rotation
    found[:, :3, 3:] = np.cross(position[:, :, None], rotation, axis=1)
    return found
