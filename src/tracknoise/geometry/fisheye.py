"""The equidistant fisheye camera of Kannala and Brandt, as OpenCV's fisheye module and Kalibr have it.

A ray at the angle theta from the axis is seen at the radius
r(theta) = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8), in units of the focal length.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.intrinsics import Intrinsics, ahead

_STEPS = 100
_SOLVED_RAD = 1e-9
"""A step below this is the last one: the error of a Newton step is of the order of its square."""
_COEFFICIENTS = 4


@dataclass(frozen=True, slots=True)
class EquidistantCamera(Intrinsics):
    """Intrinsics of one fisheye camera. Points at 90 degrees from its axis or more (z <= 0) have no image here.

    Parameters
    ----------
    width, height
        Size of the image, px.
    fx, fy
        Focal lengths, px.
    cx, cy
        Principal point, px; (0, 0) is the centre of the first pixel.
    distortion
        ``(k1, k2, k3, k4)`` of the odd polynomial in the angle.

    Raises
    ------
    ValueError
        If a size or focal length is not positive, or the distortion has another count of coefficients.
    """

    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        Intrinsics.__post_init__(self)
        if len(self.distortion) != _COEFFICIENTS:
            raise ValueError(f"distortion must have {_COEFFICIENTS} coefficients, not {len(self.distortion)}")

    def _seen_at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        depth = ahead(points)
        aside = np.hypot(points[..., 0], points[..., 1])
        theta = np.arctan2(aside, depth)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            radius = np.where(theta < _widest(self.distortion), _radius(theta, self.distortion), np.nan)
            scale = np.where(aside > 0.0, radius / aside, radius + 1.0 / depth)
            return points[..., :2] * scale[..., None]

    def _looking_along(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        radius = np.hypot(xy[..., 0], xy[..., 1])
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            slope = np.tan(_angle(radius, self.distortion))
            scale = np.where(radius > 0.0, slope / radius, slope + 1.0)
            return xy * scale[..., None]


def _radius(theta: NDArray[np.float64], k: tuple[float, ...]) -> NDArray[np.float64]:
    t2 = theta * theta
    return theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))))


def _growth(theta: NDArray[np.float64], k: tuple[float, ...]) -> NDArray[np.float64]:
    """Derivative of the radius with respect to the angle."""
    t2 = theta * theta
    return 1.0 + t2 * (3.0 * k[0] + t2 * (5.0 * k[1] + t2 * (7.0 * k[2] + t2 * 9.0 * k[3])))


def _angle(radius: NDArray[np.float64], k: tuple[float, ...]) -> NDArray[np.float64]:
    """Invert `_radius` by Newton steps, each position for itself; an interval is halved where a step would leave it.

    NaN where no angle below `_widest` has this radius.
    """
    widest = _widest(k)
    low, high = np.zeros_like(radius), np.full_like(radius, widest)
    theta = np.minimum(radius, 0.5 * widest)
    active = (radius >= 0.0) & (radius < _radius(np.array(widest), k))
    solvable = active
    for _ in range(_STEPS):
        excess = _radius(theta, k) - radius
        low, high = np.where(excess <= 0.0, theta, low), np.where(excess >= 0.0, theta, high)
        newton = theta - excess / _growth(theta, k)
        trial = np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
        step = np.abs(trial - theta)
        theta = np.where(active, trial, theta)
        active = active & (step > _SOLVED_RAD)
        if not active.any():
            break
    return np.where(solvable, theta, np.nan)


@lru_cache(maxsize=64)
def _widest(k: tuple[float, ...]) -> float:
    """Angle at which the radius first stops growing, at most 90 degrees, rad; 0 where it cannot be computed."""
    growth = np.array([1.0, *(np.arange(3, 10, 2) * k)])
    if not np.isfinite(growth).all():
        return 0.0
    inverse = np.roots(growth)  # of the inverse square, which needs no division by the highest coefficient
    positive = inverse.real[np.isreal(inverse) & (inverse.real > 0.0)]
    return min(float(positive.max()) ** -0.5, np.pi / 2.0) if len(positive) else np.pi / 2.0
