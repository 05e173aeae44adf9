"""What all cameras with focal lengths and a principal point have in common, whatever their lens."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

_OUTLINE_POSITIONS = 1001
_ROUND_TRIP_PX = 1e-6


@dataclass(frozen=True, slots=True)
class Intrinsics(ABC):
    """Size, focal lengths and principal point of a camera. A subclass adds the lens: `_seen_at` and `_looking_along`.

    Parameters
    ----------
    width, height
        Size of the image, px.
    fx, fy
        Focal lengths, px.
    cx, cy
        Principal point, px; (0, 0) is the centre of the first pixel.

    Raises
    ------
    ValueError
        If a size or focal length is not positive.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1 or not (self.fx > 0 and self.fy > 0):
            raise ValueError(f"sizes and focal lengths must be positive: {self}")

    @abstractmethod
    def _seen_at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., 2): image positions in units of the focal length, from the principal point; NaN without an image."""

    @abstractmethod
    def _looking_along(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., 2): x / z and y / z of the rays through such positions; NaN without a ray in front of the camera."""

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The 3x3 float64 matrix K."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def is_invertible(self) -> bool:
        """Whether every position on the outline of the image has a ray, and this leads back to it within 1e-6 px."""
        u = np.linspace(-0.5, self.width - 0.5, _OUTLINE_POSITIONS)
        v = np.linspace(-0.5, self.height - 0.5, _OUTLINE_POSITIONS)
        left, top = np.full_like(v, u[0]), np.full_like(u, v[0])
        right, bottom = np.full_like(v, u[-1]), np.full_like(u, v[-1])
        sides = [(u, top), (u, bottom), (left, v), (right, v)]
        outline = np.concatenate([np.stack(side, axis=-1) for side in sides])
        with np.errstate(all="ignore"):
            there_and_back = self.project(self.bearings(outline))
            return bool(np.all(np.abs(there_and_back - outline) <= _ROUND_TRIP_PX))

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Project points of the camera frame: pi(X).

        Parameters
        ----------
        points
            (..., 3) float64, metres, camera frame.

        Returns
        -------
        (..., 2) float64
            Pixel coordinates u, v. NaN for points that have no image: those with z <= 0, and those so far from the
            axis that the distortion would fold them back.
        """
        return self._seen_at(points) * (self.fx, self.fy) + (self.cx, self.cy)

    def bearings(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rays through pixels, scaled to depth 1.

        Parameters
        ----------
        uv
            (..., 2) float64, px.

        Returns
        -------
        (..., 3) float64
            Camera frame, z = 1; x and y are NaN where the pixel has no ray with z > 0 (see `is_invertible`).
        """
        xy = self._looking_along((np.asarray(uv, dtype=np.float64) - (self.cx, self.cy)) / (self.fx, self.fy))
        return np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1)

    def unproject(self, uv: NDArray[np.float64], depth_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points of the camera frame at given depths: pi^-1(x, Z).

        Parameters
        ----------
        uv
            (..., 2) float64, px.
        depth_m
            (...) float64, depth along z, metres.

        Returns
        -------
        (..., 3) float64
            Metres, camera frame.
        """
        return self.bearings(uv) * np.asarray(depth_m, dtype=np.float64)[..., None]

    def contains(self, uv: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether pixels lie in the image, its outermost half pixels included; NaN does not.

        Parameters
        ----------
        uv
            (..., 2) float64, px.

        Returns
        -------
        (...) bool
        """
        u, v = uv[..., 0], uv[..., 1]
        return (u >= -0.5) & (u < self.width - 0.5) & (v >= -0.5) & (v < self.height - 0.5)

    def halved(self) -> Self:
        """The camera of the image at half size, where u becomes (u + 0.5) / 2 - 0.5."""
        return replace(
            self,
            width=self.width // 2,
            height=self.height // 2,
            fx=self.fx / 2,
            fy=self.fy / 2,
            cx=(self.cx + 0.5) / 2 - 0.5,
            cy=(self.cy + 0.5) / 2 - 0.5,
        )

    def turned(self) -> Self:
        """The camera of the image turned a quarter counter-clockwise, where (u, v) becomes (v, width - 1 - u).

        In its own axes (x', y') = (y, -x). A lens that is not symmetric about its axis turns with them.
        """
        return replace(
            self, width=self.height, height=self.width, fx=self.fy, fy=self.fx, cx=self.cy, cy=self.width - 1 - self.cx
        )


def ahead(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(...) float64: depth z of the points, metres; NaN for those with z <= 0, which have no image."""
    return np.where(points[..., 2] > 0.0, points[..., 2], np.nan)
