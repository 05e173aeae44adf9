"""What every camera model offers, whatever its lens."""

from typing import Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray


@runtime_checkable
class CameraModel(Protocol):
    """Intrinsics of one camera: how points of its frame and pixels belong together.

    `tracknoise.geometry.camera.Camera` is one. A model is immutable, can be compared and hashed, and can be pickled.
    """

    @property
    def width(self) -> int:
        """Width of the image, px."""
        ...

    @property
    def height(self) -> int:
        """Height of the image, px."""
        ...

    @property
    def is_invertible(self) -> bool:
        """Whether every position on the outline of the image has a ray that leads back to it."""
        ...

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Project points of the camera frame: pi(X).

        Parameters
        ----------
        points
            (..., 3) float64, metres, camera frame.

        Returns
        -------
        (..., 2) float64
            Pixel coordinates u, v. NaN for points that have no image.
        """
        ...

    def bearings(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rays through pixels, scaled to depth 1.

        Parameters
        ----------
        uv
            (..., 2) float64, px.

        Returns
        -------
        (..., 3) float64
            Camera frame, z = 1. NaN in x and y where a pixel has no ray with positive depth.
        """
        ...

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
        ...

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
        ...

    def turned(self) -> Self:
        """The camera of the image turned a quarter counter-clockwise, where (u, v) becomes (v, width - 1 - u)."""
        ...

    def __hash__(self) -> int:
        """Equal models have equal hashes."""
        ...
