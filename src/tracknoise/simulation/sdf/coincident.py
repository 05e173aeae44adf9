"""Faces that are modelled twice, once for each side, as some programs write them.

Gazebo shows the face of each pair that faces the camera. A ray hits both at the same distance, and float32 rounding
would select one of them. Each face is therefore moved slightly to its own side.
"""

import numpy as np
from numpy.typing import NDArray

HAIR_M = 1e-4
_SAME_M = 1e-5


def set_apart(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Move triangles that share all three corners with another one to the side that they face.

    Parameters
    ----------
    corners
        (t, 3, 3) float64, metres, each with an area; counter-clockwise seen from its front.

    Returns
    -------
    (t, 3, 3) float64
        All other triangles are unchanged.
    """
    places = np.rint(corners.reshape(-1, 3) / _SAME_M).astype(np.int64)
    _, vertex = np.unique(places, axis=0, return_inverse=True)
    _, group, count = np.unique(np.sort(vertex.reshape(-1, 3), axis=1), axis=0, return_inverse=True, return_counts=True)
    twice = count[group.reshape(-1)] > 1
    apart = corners.copy()
    normals = np.cross(corners[twice, 1] - corners[twice, 0], corners[twice, 2] - corners[twice, 0])
    apart[twice] += HAIR_M * (normals / np.linalg.norm(normals, axis=1, keepdims=True))[:, None]
    return apart
