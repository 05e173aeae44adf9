"""Where a feature is in the camera that found it, for each metre of its stated depth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """Points of n features at a stated depth of 1 m: w r with w = 1 - k + k / |r| (audit.prediction).

    Attributes
    ----------
    ray : (n, 3) float64
        r, with z = 1.
    kind
        k: 0 if depth is along the optical axis, 1 if it is along the ray.
    inverse, share : (n, 1) float64
        1 / |r|, and w.
    """

    ray: NDArray[np.float64]
    kind: float
    inverse: NDArray[np.float64]
    share: NDArray[np.float64]

    @classmethod
    def along(cls, ray: NDArray[np.float64], kind: float) -> "Sight":
        """Look along rays (n, 3) at depths of a kind."""
        inverse = 1.0 / np.linalg.norm(ray, axis=1, keepdims=True)
        return cls(ray, kind, inverse, 1.0 - kind + kind * inverse)

    @property
    def point(self) -> NDArray[np.float64]:
        """Points in the camera frame, (n, 3), metres."""
        return self.share * self.ray

    @property
    def by_kind(self) -> NDArray[np.float64]:
        """Derivatives of the points by the kind of depth, (n, 3)."""
        return (self.inverse - 1.0) * self.ray

    def by_optics(self, ray_by_optics: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives of the points by the numbers of the optics, from those of the rays, both (n, 3, 4)."""
        turned = np.einsum("ni,nij->nj", self.ray, ray_by_optics)
        shrinks = self.kind * (self.ray * self.inverse**3)[:, :, None] * turned[:, None, :]
        return np.asarray(self.share[:, :, None] * ray_by_optics - shrinks)
