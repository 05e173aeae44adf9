"""The pinhole camera, with radial-tangential distortion or without."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.distortion import distort, undistort
from tracknoise.geometry.intrinsics import Intrinsics, ahead

DISTORTION_COUNTS = (0, 4, 5, 8)
"""How many distortion coefficients a camera can have."""


@dataclass(frozen=True, slots=True)
class Camera(Intrinsics):
    """Intrinsics of one camera.

    Parameters
    ----------
    width, height
        Size of the image, px.
    fx, fy
        Focal lengths, px.
    cx, cy
        Principal point, px; (0, 0) is the centre of the first pixel.
    distortion
        ``()``, or radial-tangential (Brown-Conrady) coefficients as OpenCV orders them: ``(k1, k2, p1, p2)``,
        ``(k1, k2, p1, p2, k3)``, or the rational model's ``(k1, k2, p1, p2, k3, k4, k5, k6)``.

    Raises
    ------
    ValueError
        If a size or focal length is not positive, or the distortion has another count of coefficients.
    """

    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        Intrinsics.__post_init__(self)
        if len(self.distortion) not in DISTORTION_COUNTS:
            expected = "0, 4, 5 or 8"
            raise ValueError(f"distortion must have {expected} coefficients, not {len(self.distortion)}")

    def _seen_at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        xy = points[..., :2] / ahead(points)[..., None]
        return distort(xy, self.distortion) if self.distortion else xy

    def _looking_along(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        return undistort(xy, self.distortion) if self.distortion else xy

    def turned(self) -> Self:
        """The camera of the image turned a quarter counter-clockwise, where (u, v) becomes (v, width - 1 - u).

        In its own axes (x', y') = (y, -x). The tangential distortion turns with them: p1' = -p2, p2' = p1.
        """
        turned = Intrinsics.turned(self)
        if not self.distortion:
            return turned
        k1, k2, p1, p2, *higher = self.distortion
        return replace(turned, distortion=(k1, k2, -p2, p1, *higher))
