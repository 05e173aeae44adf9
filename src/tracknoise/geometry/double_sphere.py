"""The double sphere camera of Usenko, Demmel and Cremers (2018), as Basalt and Kalibr have it.

A point is moved to the unit sphere, then to a second one whose centre lies xi ahead on the axis, and is seen by a
pinhole camera that lies alpha / (1 - alpha) behind that centre.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.intrinsics import Intrinsics, ahead


@dataclass(frozen=True, slots=True)
class DoubleSphereCamera(Intrinsics):
    """Intrinsics of one fisheye camera. Points at 90 degrees from its axis or more (z <= 0) have no image here.

    Parameters
    ----------
    width, height
        Size of the image, px.
    fx, fy
        Focal lengths, px. The model's magnification on the axis is 1 / (1 + (1 - alpha) xi) of them.
    cx, cy
        Principal point, px; (0, 0) is the centre of the first pixel.
    xi
        Distance of the two spheres' centres, no unit, above -1 and at most 1.
    alpha
        Place of the pinhole, no unit, 0 to 1.

    Raises
    ------
    ValueError
        If a size or focal length is not positive, or xi or alpha is outside of its range.
    """

    xi: float
    alpha: float

    def __post_init__(self) -> None:
        Intrinsics.__post_init__(self)
        if not -1.0 < self.xi <= 1.0:
            raise ValueError(f"xi must be above -1 and at most 1, not {self.xi}")
        if not 0.0 <= self.alpha <= 1.0:
            raise ValueError(f"alpha must be 0 to 1, not {self.alpha}")

    def _seen_at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        depth = ahead(points)
        aside = np.hypot(points[..., 0], points[..., 1])
        with np.errstate(invalid="ignore", over="ignore"):
            first = np.hypot(aside, depth)
            shifted = self.xi * first + depth
            below = self.alpha * np.hypot(aside, shifted) + (1.0 - self.alpha) * shifted
            return points[..., :2] / np.where(depth > -self._steepest * first, below, np.nan)[..., None]

    def _looking_along(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        xi, alpha = self.xi, self.alpha
        r2 = np.sum(xy * xy, axis=-1)
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            forward = (1.0 - alpha * alpha * r2) / (alpha * np.sqrt(1.0 - (2.0 * alpha - 1.0) * r2) + 1.0 - alpha)
            scale = (forward * xi + np.sqrt(forward * forward + (1.0 - xi * xi) * r2)) / (forward * forward + r2)
            depth = scale * forward - xi
            return xy * np.where(depth > 0.0, scale / depth, np.nan)[..., None]

    @property
    def _steepest(self) -> float:
        """Negative cosine of the widest angle at which the model is one-to-one: the paper's w2."""
        near = min(self.alpha, 1.0 - self.alpha) / max(self.alpha, 1.0 - self.alpha)
        return float((near + self.xi) / np.sqrt(2.0 * near * self.xi + self.xi * self.xi + 1.0))
