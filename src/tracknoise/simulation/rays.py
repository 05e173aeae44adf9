"""The rays of an image: several for each pixel, and by how much they differ from pixel to pixel."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera import Camera
from tracknoise.geometry.camera_model import CameraModel

_Floats = NDArray[np.float64]
Step = tuple[_Floats | float, _Floats | float]
"""Change of x and y of a bearing from one pixel to the next: one for all rays, or (n,) each."""


@dataclass(frozen=True, slots=True)
class Rays:
    """Rays of some rows of an image, with bearings (x, y, 1).

    Parameters
    ----------
    x, y
        (n,) float64.
    right, down
        Steps to the next pixel.
    blind
        (n,) bool, or one for all: there is no ray, and x and y are 0.
    """

    x: _Floats
    y: _Floats
    right: Step
    down: Step
    blind: NDArray[np.bool_] | bool


class ImageRays(Protocol):
    """The rays of one camera."""

    def rows(self, top: int, bottom: int) -> Rays:
        """Rays of some rows of pixels: by row, then by position in the pixel, then by column."""
        ...


class PinholeRays:
    """Rays of a camera without distortion: columns and rows are independent of each other.

    Parameters
    ----------
    camera
        The camera.
    offsets
        (samples, 2) float64, positions of the rays in a pixel, from its centre, px.
    """

    def __init__(self, camera: Camera, offsets: _Floats) -> None:
        right, down = offsets.T
        self._x = (np.arange(camera.width) + right[:, None] - camera.cx) / camera.fx
        self._y = (np.arange(camera.height)[:, None] + down - camera.cy) / camera.fy
        self._right, self._down = (1.0 / camera.fx, 0.0), (0.0, 1.0 / camera.fy)

    def rows(self, top: int, bottom: int) -> Rays:
        """See `ImageRays.rows`."""
        x, y = np.broadcast_arrays(self._x, self._y[top:bottom, :, None])
        return Rays(x.ravel(), y.ravel(), self._right, self._down, False)


class LensRays:
    """Rays of any camera, each computed with its model, once. Pixels without a ray are blind.

    Parameters
    ----------
    camera
        The camera.
    offsets
        (samples, 2) float64, positions of the rays in a pixel, from its centre, px.
    """

    def __init__(self, camera: CameraModel, offsets: _Floats) -> None:
        v, u = np.indices((camera.height, camera.width), dtype=np.float64)
        centres = np.stack([u, v], axis=-1)[:, None]  # (height, 1, width, 2)
        bearings = camera.bearings(centres + offsets[:, None])[..., :2]
        self._blind = np.isnan(bearings[..., 0])
        self._xy = np.where(self._blind[..., None], 0.0, bearings)
        self._right, self._down = (
            _per_sample(camera, centres, np.array(half), len(offsets)) for half in ((0.5, 0.0), (0.0, 0.5))
        )

    def rows(self, top: int, bottom: int) -> Rays:
        """See `ImageRays.rows`."""
        x, y = self._xy[top:bottom].reshape(-1, 2).T
        right, down = (step[top:bottom].reshape(-1, 2).T for step in (self._right, self._down))
        return Rays(x, y, (right[0], right[1]), (down[0], down[1]), self._blind[top:bottom].ravel())


def image_rays(camera: CameraModel, offsets: _Floats) -> ImageRays:
    """The rays of a camera; `offsets` as in `LensRays`."""
    if isinstance(camera, Camera) and not camera.distortion:
        return PinholeRays(camera, offsets)
    return LensRays(camera, offsets)


def _per_sample(camera: CameraModel, centres: _Floats, half: _Floats, samples: int) -> _Floats:
    """(height, samples, width, 2): difference of the bearings of a pixel's two sides; 0 where one has no ray."""
    step = (camera.bearings(centres + half) - camera.bearings(centres - half))[..., :2]
    return np.broadcast_to(np.nan_to_num(step, nan=0.0), (len(step), samples, *step.shape[2:]))
