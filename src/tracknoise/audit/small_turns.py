"""How turned vectors change with the vector of the rotation."""

import numpy as np
from numpy.typing import NDArray


def crossed(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3, 3): the matrices whose products with others are cross products with these vectors (n, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.asarray(np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), -1, 0))


def right_jacobian(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """J with Exp(v + d) = Exp(v) Exp(J d) for small d: of a rotation vector (3,) (Sola et al. 2018, eq. 143)."""
    angle = float(np.linalg.norm(vector))
    cross = crossed(vector[None])[0]
    if angle < 1e-4:
        return np.asarray(np.eye(3) - 0.5 * cross)
    first, second = (1.0 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.asarray(np.eye(3) - first * cross + second * cross @ cross)
