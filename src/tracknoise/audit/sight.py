"""Where a feature is in the camera that found it, for each metre of its stated depth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Sight:
    """Points of n features at a stated depth of 1 m.

    Attributes
    ----------
    point : (n, 3) float64
        Camera frame, metres.
    by_optics : (n, 3, 4) float64
        Derivative by the numbers of the optics, of a fixed pixel.
    by_kind : (n, 3) float64
        Derivative by the kind of depth.
    """

    point: NDArray[np.float64]
    by_optics: NDArray[np.float64]
    by_kind: NDArray[np.float64]


def sight(ray: NDArray[np.float64], by_optics: NDArray[np.float64], kind: float) -> Sight:
    """Scale rays to depths of a kind: w r with w = 1 - k + k / |r| (audit.prediction).

    Parameters
    ----------
    ray : (n, 3) float64
        z = 1.
    by_optics : (n, 3, 4) float64
        Its derivative by the numbers of the optics.
    kind
        k: 0 if depth is along the optical axis, 1 if it is along the ray.
    """
    inverse = 1.0 / np.linalg.norm(ray, axis=1, keepdims=True)
    share = 1.0 - kind + kind * inverse
    turned = np.einsum("ni,nij->nj", ray, by_optics)
    shrinks = kind * (ray * inverse**3)[:, :, None] * turned[:, None, :]
    return Sight(share * ray, share[:, :, None] * by_optics - shrinks, (inverse - 1.0) * ray)
