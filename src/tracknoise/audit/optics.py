"""Cameras with corrected intrinsics: rays, projections, and how both change."""

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


@dataclass(frozen=True, slots=True)
class Projected:
    """Positions of points in images.

    Attributes
    ----------
    uv : (n, 2) float64
        px; NaN where a point has no image.
    by_point : (n, 2, 3) float64
        Derivative by the point, px per metre.
    by_optics : (n, 2, 4) float64
        Derivative by the numbers of the optics.
    """

    uv: NDArray[np.float64]
    by_point: NDArray[np.float64]
    by_optics: NDArray[np.float64]


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


def project(camera: Intrinsics, points: NDArray[np.float64]) -> Projected:
    """Project points (n, 3) of the camera frame."""
    with np.errstate(all="ignore"):
        uv = camera.project(points)
        return Projected(uv, projection_jacobian(camera, points), _by_optics(camera, points, uv))


def rays(camera: Intrinsics, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rays through pixels (n, 2), scaled to depth 1, and how they change with the optics.

    Returns
    -------
    rays : (n, 3) float64
        NaN where a pixel has none.
    by_optics : (n, 3, 4) float64
        Derivatives, of a fixed pixel.
    """
    found = camera.bearings(uv)
    there = project(camera, found)
    by_optics = np.zeros((len(uv), 3, INTRINSIC))
    (a, b), (c, d) = np.moveaxis(there.by_point[:, :, :2], 0, -1)
    with np.errstate(all="ignore"):
        inverse = np.moveaxis(np.array([[d, -b], [-c, a]]) / (a * d - b * c), -1, 0)
    by_optics[:, :2] = -inverse @ there.by_optics
    return found, by_optics


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
