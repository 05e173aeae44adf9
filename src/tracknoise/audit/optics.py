"""Cameras with corrected intrinsics: rays, projections, and how both change."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.audit.parameters import SLICES, Parameter
from tracknoise.geometry.camera import Camera
from tracknoise.geometry.intrinsics import Intrinsics
from tracknoise.geometry.jacobians import projection_jacobian

INTRINSIC = 4
"""Numbers of the optics: focal length, principal point in u and v, k1."""
_FOCAL, _CENTRE, _K1 = 0, slice(1, 3), 3


def has_k1(cameras: tuple[Intrinsics, ...]) -> bool:
    """Whether a first radial coefficient can be added to all cameras."""
    return all(isinstance(camera, Camera) for camera in cameras)


def corrected(camera: Intrinsics, theta: NDArray[np.float64]) -> Intrinsics:
    """The camera with corrected intrinsics; k1 is 0 where a lens has none.

    Parameters
    ----------
    camera
        As stated.
    theta
        Numbers of all parameters.
    """
    scale = 1.0 + float(theta[SLICES[Parameter.focal_length]][0])
    u, v = theta[SLICES[Parameter.principal_point]].tolist()
    changed = replace(camera, fx=scale * camera.fx, fy=scale * camera.fy, cx=camera.cx + u, cy=camera.cy + v)
    more = float(theta[SLICES[Parameter.k1]][0])
    if more and isinstance(changed, Camera):
        first, *others = changed.distortion or (0.0, 0.0, 0.0, 0.0)
        return replace(changed, distortion=(first + more, *others))
    return changed


@dataclass(frozen=True, slots=True, eq=False)
class Optics:
    """Corrected cameras of n observations.

    Attributes
    ----------
    cameras
        The different ones.
    which : (n,) intp
        Place of each observation's camera among them.
    units : (4,) float64
        Derivatives are by the logarithm of the focal length; over its factor they are by the factor.
    """

    cameras: tuple[Intrinsics, ...]
    which: NDArray[np.intp]
    units: NDArray[np.float64]

    @classmethod
    def of(cls, stated: Sequence[Intrinsics], which: NDArray[np.intp], theta: NDArray[np.float64]) -> "Optics":
        """Stated cameras under corrections, the numbers of all parameters."""
        units = np.array([1.0 + theta[SLICES[Parameter.focal_length]][0], 1.0, 1.0, 1.0])
        return cls(tuple(corrected(camera, theta) for camera in stated), which, units)

    def rays(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rays through pixels (n, 2), scaled to depth 1, (n, 3); NaN where a pixel has none."""
        return self._each((3,), lambda camera, pixels: camera.bearings(pixels), uv)

    def rays_by_optics(self, ray: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives of the rays of fixed pixels by the numbers of the optics, (n, 3, 4)."""
        return self._each((3, INTRINSIC), _rays_by_optics, ray) / self.units

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions of points (n, 3) of the camera frame, (n, 2), px; NaN where a point has no image."""
        return self._each((2,), lambda camera, some: camera.project(some), points)

    def by_point(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives of positions by the points, (n, 2, 3), px per metre."""
        return self._each((2, 3), projection_jacobian, points)

    def by_optics(self, points: NDArray[np.float64], uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives of the positions uv (n, 2) of fixed points by the numbers of the optics, (n, 2, 4)."""
        return self._each((2, INTRINSIC), _by_optics, points, uv) / self.units

    def _each(
        self, shape: tuple[int, ...], function: Callable[..., NDArray[np.float64]], *arrays: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """What a function of a camera and of rows of arrays gives for all observations, (n, *shape)."""
        found = np.empty((len(self.which), *shape))
        with np.errstate(all="ignore"):
            for number, camera in enumerate(self.cameras):
                rows = np.flatnonzero(self.which == number)
                if len(rows):
                    found[rows] = function(camera, *(array[rows] for array in arrays))
        return found


def _rays_by_optics(camera: Intrinsics, ray: NDArray[np.float64]) -> NDArray[np.float64]:
    found = np.zeros((len(ray), 3, INTRINSIC))
    (a, b), (c, d) = np.moveaxis(projection_jacobian(camera, ray)[:, :, :2], 0, -1)
    inverse = np.moveaxis(np.array([[d, -b], [-c, a]]) / (a * d - b * c), -1, 0)
    found[:, :2] = -inverse @ _by_optics(camera, ray, camera.project(ray))
    return found


def _by_optics(camera: Intrinsics, points: NDArray[np.float64], uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives of pixels; that of the focal length is by the logarithm of both."""
    found = np.zeros((len(points), 2, INTRINSIC))
    found[:, :, _FOCAL] = uv - (camera.cx, camera.cy)
    found[:, :, _CENTRE] = np.eye(2)
    if isinstance(camera, Camera):
        found[:, :, _K1] = _by_k1(camera, points)
    return found


def _by_k1(camera: Camera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """F x r^2 / D: the first radial term; D is the denominator of the rational model."""
    xy = points[:, :2] / points[:, 2:]
    r2 = np.sum(xy * xy, axis=1, keepdims=True)
    k4, k5, k6 = camera.distortion[5:] if len(camera.distortion) == 8 else (0.0, 0.0, 0.0)
    return np.asarray(xy * (r2 / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))) * (camera.fx, camera.fy))
