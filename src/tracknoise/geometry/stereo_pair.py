"""Two cameras at fixed places beside each other, and points that both see at one time.

Let r be the unit ray of a point in the first camera, d that in the second, turned into the frame of the first, and t
the position of the second camera there. In the directions m, opposite to the part of t across r, and n = r x m,

    across = d . n,    parallax = atan2(d . m, d . r),    range = t . r + |t x r| / tan(parallax)    (pair.rays)

across is 0 without errors, whatever the range of the point.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.cameras import CameraModel

Array = NDArray[np.float64]

_UNIT_ANGLE = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class PairRays:
    """(pair.rays) of n points."""

    unit: Array  # (n, 3): unit rays r of the first camera
    aside_m: Array  # (n,): distance of the second camera from the ray, metres: |t x r|
    across: Array  # (n,): rad
    parallax: Array  # (n,): rad; negative where rays meet behind the cameras
    range_m: Array  # (n,): metres; infinite without parallax, negative behind the cameras


@dataclass(frozen=True, slots=True, eq=False)
class StereoPair:
    """Two calibrated cameras."""

    first: CameraModel
    second: CameraModel
    first_from_second: Array  # (4, 4), metres: pose of the second camera in the frame of the first

    def rays(self, first_uv: Array, second_uv: Array) -> PairRays:
        """(pair.rays) of positions (n, 2) in both images, px; NaN where one has no ray."""
        return self.of_rays(unit_rays(self.first, first_uv), unit_rays(self.second, second_uv))

    def of_rays(self, unit: Array, other: Array) -> PairRays:
        """(pair.rays) of unit rays (n, 3) in the frames of both cameras."""
        seen, t = other @ self.first_from_second[:3, :3].T, self.first_from_second[:3, 3]
        towards = (unit @ t)[:, None] * unit - t
        length = np.linalg.norm(towards, axis=1)
        towards = towards / length[:, None]
        across = np.sum(seen * np.cross(unit, towards), axis=1)
        parallax = np.arctan2(np.sum(seen * towards, axis=1), np.sum(seen * unit, axis=1))
        with np.errstate(divide="ignore"):
            range_m = unit @ t + length / np.tan(parallax)
        return PairRays(unit, length, across, parallax, range_m)

    def parallax(self, rays: PairRays, inverse_m: Array) -> Array:
        """(n,): parallax, rad, of points of inverse distances (n,), 1/m, on rays of the first camera."""
        ahead_m = rays.unit @ self.first_from_second[:3, 3]
        return np.asarray(np.arctan2(rays.aside_m * inverse_m, 1.0 - inverse_m * ahead_m))

    def epipolar_px(self, first_uv: Array, second_uv: Array) -> Array:
        """(n,): signed distances, px, of positions (n, 2) in the second image from epipolar lines of the first."""
        return self.px_per_angle(second_uv) * self.rays(first_uv, second_uv).across

    def errors_px(
        self, first_uv: Array, second_uv: Array, first_true: Array, second_true: Array
    ) -> tuple[Array, Array]:
        """(n,) each, px: distances from epipolar lines, and errors along them, of positions (n, 2) by true ones."""
        seen, true = self.rays(first_uv, second_uv), self.rays(first_true, second_true)
        scale = self.px_per_angle(second_uv)
        return scale * seen.across, scale * (seen.parallax - true.parallax)

    def depth_m(self, first_uv: Array, second_uv: Array) -> Array:
        """(n,): depths along z of the first camera, by both positions (n, 2), metres; NaN where there is none."""
        rays = self.rays(first_uv, second_uv)
        depth_m = rays.range_m * rays.unit[:, 2]
        return np.where(np.isfinite(depth_m) & (rays.range_m > 0.0), depth_m, np.nan)

    def at_infinity(self, first_uv: Array) -> Array:
        """(n, 2): where the second camera shows points without parallax, of positions (n, 2) in the first, px."""
        return self.second.project(self.first.bearings(first_uv) @ self.first_from_second[:3, :3])

    def px_per_angle(self, second_uv: Array) -> Array:
        """(n,): pixels of the second camera for a unit of angle, at positions (n, 2)."""
        rays = unit_rays(self.second, second_uv)
        turned = (self.second.project(rays + _UNIT_ANGLE * np.cross(axis, rays)) for axis in np.eye(3))
        squares = sum(np.sum((uv - second_uv) ** 2, axis=1) for uv in turned)
        return np.asarray(np.sqrt(squares / 2.0) / _UNIT_ANGLE)


def unit_rays(camera: CameraModel, uv: Array) -> Array:
    """(n, 3): unit rays of positions (n, 2), px; NaN where one has no ray."""
    rays = camera.bearings(uv)
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))
