"""Camera models: what all offer, and the pinhole, fisheye, omnidirectional and sphere cameras.

The module begins with what every camera model offers, and with what all cameras with focal lengths and a principal
point have in common, whatever their lens. The cameras follow, and last the models by name, as files and settings call
them.

The pinhole camera has radial-tangential (Brown-Conrady) lens distortion or none. The distortion and its inverse are in
the plane at depth 1. A point at radius r is moved to the radius r N(r^2) / D(r^2), with
N = 1 + k1 r^2 + k2 r^4 + k3 r^6 and, in the rational model, D = 1 + k4 r^2 + k5 r^4 + k6 r^6, otherwise D = 1. The
tangential terms p1 and p2 come on top of it. Far from the axis the distorted radius may decrease again, back into the
image. A point there has no image, although the model gives it one.

The equidistant fisheye camera is that of Kannala and Brandt, as OpenCV's fisheye module and Kalibr have it. A ray at
the angle theta from the axis is seen at the radius
r(theta) = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8), in units of the focal length.

The double sphere camera is that of Usenko, Demmel and Cremers (2018), as Basalt and Kalibr have it. A point is moved to
the unit sphere, then to a second one whose centre lies xi ahead on the axis, and is seen by a pinhole camera that lies
alpha / (1 - alpha) behind that centre.

The omnidirectional camera is that of Mei and Rives (2007), as Kalibr, camodocal and OpenCV's omnidir have it. A point
is moved to the unit sphere and seen from xi behind its centre: at (x, y) / (z + xi). The lens distorts that as it does
the plane of a pinhole camera.

The enhanced unified camera is that of Khomutenko, Garcia and Martinet (2016). With d = sqrt(beta (x^2 + y^2) + z^2), a
point is seen at (x, y) / (alpha d + (1 - alpha) z). With beta = 1 it is the unified camera.

The field-of-view camera is that of Devernay and Faugeras (2001), as PTAM's ATAN, Kalibr's fov and COLMAP's FOV have it.
A point at the radius r of the plane at depth 1 is seen at the radius atan(2 r tan(omega / 2)) / omega.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray


@runtime_checkable
class CameraModel(Protocol):
    """Intrinsics of one camera: how points of its frame and pixels belong together.

    `tracknoise.geometry.cameras.Camera` is one. A model is immutable, can be compared and hashed, and can be pickled.
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
    def _seen_at(self, points: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., 2): image positions in units of the focal length, from the principal point; NaN without an image.

        `depth`: of the points, `ahead`.
        """

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
        """Pixels (..., 2) of points (..., 3): see `CameraModel.project`.

        NaN for points that have no image: those with z <= 0, and those so far from the axis that the distortion would
        fold them back.
        """
        return self._seen_at(points, ahead(points)) * (self.fx, self.fy) + (self.cx, self.cy)

    def bearings(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rays (..., 3) through pixels (..., 2): see `CameraModel.bearings`, and `is_invertible`."""
        xy = self._looking_along((np.asarray(uv, dtype=np.float64) - (self.cx, self.cy)) / (self.fx, self.fy))
        return np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1)

    def unproject(self, uv: NDArray[np.float64], depth_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (..., 3) under pixels (..., 2): see `CameraModel.unproject`."""
        return self.bearings(uv) * np.asarray(depth_m, dtype=np.float64)[..., None]

    def contains(self, uv: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether pixels (..., 2) lie in the image: see `CameraModel.contains`."""
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


_STEPS = 100
_SOLVED = 1e-13
"""Residual, at depth 1, at which a position counts as found. Iteration continues below it if precision allows."""

Coefficients = tuple[float, ...]
"""k1, k2, p1, p2, then k3, then k4, k5, k6, in OpenCV's order; those that are missing are 0."""


_Symmetric = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
"""Entries xx, xy and yy of symmetric matrices."""


def distort(xy: NDArray[np.float64], coefficients: Coefficients) -> NDArray[np.float64]:
    """Where a lens shows the points of the plane at depth 1.

    Shapes: xy (..., 2); returns (..., 2). NaN where the model is not one-to-one between the point and the axis: such a
    point has no image.
    """
    return _distorted(xy, coefficients)[0]


def undistort(distorted: NDArray[np.float64], coefficients: Coefficients) -> NDArray[np.float64]:
    """Invert `distort` by Newton steps from the axis outwards, halved where they would not come closer.

    Each position is solved for itself: its result does not depend on what else is in the array. Shapes: distorted
    (..., 2); returns (..., 2). NaN where no point has this image.
    """
    left = distorted.reshape(-1, 2)
    undistorted, place = np.full_like(left, np.nan), np.arange(len(left))
    xy, residual, share = np.zeros_like(left), left, np.ones(len(left))
    _, jacobian = _distorted(xy, coefficients)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for _ in range(_STEPS):
            trial = xy + share[:, None] * _newton_step(jacobian, residual)
            shown, there = _distorted(trial, coefficients)
            remains = left - shown
            closer = _size(remains) < _size(residual)
            xy = np.where(closer[:, None], trial, xy)
            residual = np.where(closer[:, None], remains, residual)
            jacobian = _chosen(closer, there, jacobian)
            share = np.where(closer, np.minimum(2.0 * share, 1.0), 0.5 * share)
            solved = _size(residual) <= _SOLVED
            undistorted[place[solved]] = xy[solved]
            active = closer | (_size(residual) > _SOLVED)
            if not active.all():  # a few that have no solution take many steps more than all others
                place, left, share = place[active], left[active], share[active]
                xy, residual = xy[active], residual[active]
                xx, xy_, yy = jacobian
                jacobian = xx[active], xy_[active], yy[active]
            if not len(place):
                break
    return undistorted.reshape(distorted.shape)


def _distorted(xy: NDArray[np.float64], coefficients: Coefficients) -> tuple[NDArray[np.float64], _Symmetric]:
    """`distort`, and the derivative of the model."""
    k1, k2, p1, p2, k3, k4, k5, k6 = (*coefficients, 0.0, 0.0, 0.0, 0.0)[:8]
    x, y = xy[..., 0], xy[..., 1]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))  # N / D, and twice its derivative by the squared radius
        slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
        if k4 or k5 or k6:
            below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
            below_slope = 2.0 * (k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6))
            radial, slope = radial / below, (slope - radial / below * below_slope) / below
        shown = np.stack(
            [
                x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
            ],
            axis=-1,
        )
        xx = radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
        xy_ = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y
        yy = radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
        one_to_one = (r2 < _turning_r2(coefficients)) & (xx + yy > 0.0) & (xx * yy > xy_ * xy_)
    return np.where(one_to_one[..., None], shown, np.nan), (xx, xy_, yy)


def _chosen(which: NDArray[np.bool_], where_true: _Symmetric, where_false: _Symmetric) -> _Symmetric:
    xx, xy, yy = (np.where(which, *both) for both in zip(where_true, where_false, strict=True))
    return xx, xy, yy


def _newton_step(jacobian: _Symmetric, residual: NDArray[np.float64]) -> NDArray[np.float64]:
    xx, xy, yy = jacobian
    u, v = residual[..., 0], residual[..., 1]
    return np.stack([yy * u - xy * v, xx * v - xy * u], axis=-1) / (xx * yy - xy * xy)[..., None]


def _size(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.hypot(vectors[..., 0], vectors[..., 1])


@lru_cache(maxsize=64)
def _turning_r2(coefficients: Coefficients) -> float:
    """Squared radius at which r N / D first stops growing, or D vanishes; infinity where neither happens.

    With s = r^2, the numerator of its derivative is (N + 2 s N') D - 2 s N D'.
    """
    k1, k2, _, _, k3, k4, k5, k6 = (*coefficients, 0.0, 0.0, 0.0, 0.0)[:8]
    above, below = np.array([1.0, k1, k2, k3]), np.array([1.0, k4, k5, k6])
    power = 2.0 * np.arange(4)
    with np.errstate(over="ignore", invalid="ignore"):
        growth = np.convolve((1.0 + power) * above, below) - np.convolve(above, power * below)
    if not np.isfinite([*growth, *below]).all():
        return 0.0
    return min(_first_positive_root(growth), _first_positive_root(below))


def _first_positive_root(ascending: NDArray[np.float64]) -> float:
    """Smallest positive root of a polynomial that is 1 at 0; infinity where there is none.

    It is solved for the inverse of the root, which needs no division by the highest coefficient.
    """
    inverse = np.roots(ascending)
    positive = inverse.real[np.isreal(inverse) & (inverse.real > 0.0)]
    return 1.0 / float(positive.max()) if len(positive) else np.inf


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

    def _seen_at(self, points: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.float64]:
        xy = points[..., :2] / depth[..., None]
        return distort(xy, self.distortion) if self.distortion else xy

    def _looking_along(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        return undistort(xy, self.distortion) if self.distortion else xy

    def turned(self) -> Self:
        """The camera of the image turned a quarter counter-clockwise, where (u, v) becomes (v, width - 1 - u).

        In its own axes (x', y') = (y, -x). The tangential distortion turns with them: p1' = -p2, p2' = p1.
        """
        return replace(Intrinsics.turned(self), distortion=_turned(self.distortion))


def _turned(distortion: Coefficients) -> Coefficients:
    if not distortion:
        return distortion
    k1, k2, p1, p2, *higher = distortion
    return (k1, k2, -p2, p1, *higher)


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

    def _seen_at(self, points: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.float64]:
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

    def _seen_at(self, points: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.float64]:
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


_OMNI_COUNTS = (0, 4)


@dataclass(frozen=True, slots=True)
class OmniCamera(Intrinsics):
    """Intrinsics of one omnidirectional camera. Points at 90 degrees from its axis or more (z <= 0) have no image here.

    Parameters
    ----------
    width, height
        Size of the image, px.
    fx, fy
        Focal lengths, px. The model's magnification on the axis is 1 / (1 + xi) of them.
    cx, cy
        Principal point, px; (0, 0) is the centre of the first pixel.
    xi
        Place of the pinhole behind the centre of the sphere, no unit, above -1; 0 is a pinhole camera.
    distortion
        ``()`` or ``(k1, k2, p1, p2)``, as of `Camera`.

    Raises
    ------
    ValueError
        If a size or focal length is not positive, xi is outside of its range, or the distortion has another count of
        coefficients.
    """

    xi: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        Intrinsics.__post_init__(self)
        if not -1.0 < self.xi < np.inf:
            raise ValueError(f"xi must be above -1, not {self.xi}")
        if len(self.distortion) not in _OMNI_COUNTS:
            raise ValueError(f"distortion must have 0 or 4 coefficients, not {len(self.distortion)}")

    def _seen_at(self, points: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.float64]:
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            below = depth + self.xi * np.hypot(np.hypot(points[..., 0], points[..., 1]), depth)
            xy = points[..., :2] / np.where(below > 0.0, below, np.nan)[..., None]
        return distort(xy, self.distortion) if self.distortion else xy

    def _looking_along(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        xy = undistort(xy, self.distortion) if self.distortion else xy
        r2 = np.sum(xy * xy, axis=-1)
        with np.errstate(invalid="ignore", over="ignore"):
            scale = (self.xi + np.sqrt(1.0 + (1.0 - self.xi * self.xi) * r2)) / (r2 + 1.0)
            depth = scale - self.xi
            return np.asarray(xy * (scale / np.where(depth > 0.0, depth, np.nan))[..., None])

    def turned(self) -> Self:
        """The camera of the image turned a quarter counter-clockwise: see `Camera.turned`."""
        return replace(Intrinsics.turned(self), distortion=_turned(self.distortion))


@dataclass(frozen=True, slots=True)
class EucmCamera(Intrinsics):
    """Intrinsics of one enhanced unified camera. Points at 90 degrees from its axis or more have no image here.

    Parameters
    ----------
    width, height
        Size of the image, px.
    fx, fy
        Focal lengths, px.
    cx, cy
        Principal point, px; (0, 0) is the centre of the first pixel.
    alpha
        Share of the distance in the denominator, no unit, 0 to 1; 0 is a pinhole camera.
    beta
        Shape of the surface that points are moved to, no unit, above 0; 1 is a sphere.

    Raises
    ------
    ValueError
        If a size or focal length is not positive, or alpha or beta is outside of its range.
    """

    alpha: float
    beta: float

    def __post_init__(self) -> None:
        Intrinsics.__post_init__(self)
        if not 0.0 <= self.alpha <= 1.0:
            raise ValueError(f"alpha must be 0 to 1, not {self.alpha}")
        if not 0.0 < self.beta < np.inf:
            raise ValueError(f"beta must be above 0, not {self.beta}")

    def _seen_at(self, points: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.float64]:
        with np.errstate(invalid="ignore", over="ignore"):
            distance = np.hypot(np.sqrt(self.beta) * np.hypot(points[..., 0], points[..., 1]), depth)
            below = self.alpha * distance + (1.0 - self.alpha) * depth
            return np.asarray(points[..., :2] / below[..., None])

    def _looking_along(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        alpha, r2 = self.alpha, self.beta * np.sum(xy * xy, axis=-1)
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            depth = (1.0 - alpha * alpha * r2) / (alpha * np.sqrt(1.0 - (2.0 * alpha - 1.0) * r2) + 1.0 - alpha)
            return xy / np.where(depth > 0.0, depth, np.nan)[..., None]


@dataclass(frozen=True, slots=True)
class FovCamera(Intrinsics):
    """Intrinsics of one field-of-view camera. Points at 90 degrees from its axis or more (z <= 0) have no image here.

    Parameters
    ----------
    width, height
        Size of the image, px.
    fx, fy
        Focal lengths, px.
    cx, cy
        Principal point, px; (0, 0) is the centre of the first pixel.
    omega
        Field of view of the ideal lens, rad, 0 to below pi; 0 is a pinhole camera.

    Raises
    ------
    ValueError
        If a size or focal length is not positive, or omega is outside of its range.
    """

    omega: float

    def __post_init__(self) -> None:
        Intrinsics.__post_init__(self)
        if not 0.0 <= self.omega < np.pi:
            raise ValueError(f"omega must be 0 to below pi, not {self.omega}")

    def _seen_at(self, points: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.float64]:
        xy = points[..., :2] / depth[..., None]
        if not self.omega:
            return xy
        radius = np.hypot(xy[..., 0], xy[..., 1])
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            shown = np.arctan(self._widening * radius) / self.omega
            return np.asarray(xy * np.where(radius > 0.0, shown / radius, self._widening / self.omega)[..., None])

    def _looking_along(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        if not self.omega:
            return xy
        shown = np.hypot(xy[..., 0], xy[..., 1])
        angle = shown * self.omega
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            radius = np.where(angle < np.pi / 2.0, np.tan(angle), np.nan) / self._widening
            return xy * np.where(shown > 0.0, radius / shown, self.omega / self._widening)[..., None]

    @property
    def _widening(self) -> float:
        return float(2.0 * np.tan(self.omega / 2.0))


KnownCamera = Camera | EquidistantCamera | DoubleSphereCamera | OmniCamera | EucmCamera | FovCamera


@dataclass(frozen=True, slots=True)
class Lens:
    """A camera model: its class, and what its coefficients are."""

    camera: type[KnownCamera]
    numbers: tuple[str, ...] = ()  # fields of the class, which come first
    counts: tuple[int, ...] = ()  # how many numbers the field `distortion` can have; none where there is no such field
    names: str = ""  # of these

    @property
    def all_counts(self) -> tuple[int, ...]:
        """How many coefficients there can be."""
        return tuple(len(self.numbers) + count for count in self.counts or (0,))

    @property
    def words(self) -> str:
        """What its coefficients are, such as ``2 numbers (xi, alpha)``."""
        return described(self.all_counts, ", ".join(filter(None, (*self.numbers, self.names))))


def described(counts: Sequence[int], names: str) -> str:
    """Of some numbers with names, how many there can be."""
    if not any(counts):
        return "no numbers"
    *rest, last = map(str, counts)
    of = f"{', '.join(rest)} or {last}" if rest else last
    return f"{of} {'number' if counts == (1,) else 'numbers'} ({names})"


LENSES = MappingProxyType(
    {
        "pinhole": Lens(Camera, counts=(0,)),
        "radtan": Lens(Camera, counts=DISTORTION_COUNTS, names="k1, k2, p1, p2, k3, k4, k5, k6"),
        "equidistant": Lens(EquidistantCamera, counts=(_COEFFICIENTS,), names="k1, k2, k3, k4"),
        "double_sphere": Lens(DoubleSphereCamera, ("xi", "alpha")),
        "omni": Lens(OmniCamera, ("xi",), _OMNI_COUNTS, "k1, k2, p1, p2"),
        "eucm": Lens(EucmCamera, ("alpha", "beta")),
        "fov": Lens(FovCamera, ("omega",)),
    }
)
"""Camera models by name."""
_NAMES: Mapping[type[KnownCamera], str] = {lens.camera: name for name, lens in LENSES.items()}


def make_camera(
    model: str, size: tuple[int, int], intrinsics: Sequence[float], coefficients: tuple[float, ...]
) -> KnownCamera:
    """Make a camera of a model in `LENSES`.

    Parameters
    ----------
    model
        Name of the model.
    size
        Width and height, px.
    intrinsics
        fx, fy, cx, cy, px.
    coefficients
        Of the lens, as the model has them.

    Raises
    ------
    ValueError
        If the model does not have so many coefficients, or a value is impossible; the message begins with the field.
    """
    lens = LENSES[model]
    if len(coefficients) not in lens.all_counts:
        raise ValueError(f"distortion is {[*coefficients]}, expected {lens.words} for the model {model}")
    numbers, distortion = coefficients[: len(lens.numbers)], coefficients[len(lens.numbers) :]
    fields: dict[str, Any] = dict(zip(lens.numbers, numbers, strict=True))
    if lens.counts:
        fields["distortion"] = distortion
    fx, fy, cx, cy = intrinsics
    return lens.camera(*size, fx, fy, cx, cy, **fields)


def model_of(camera: KnownCamera) -> str:
    """Name of a camera's model in `LENSES`; ``radtan`` for a pinhole camera, whose distortion is none."""
    return _NAMES[type(camera)]


def coefficients_of(camera: KnownCamera) -> tuple[float, ...]:
    """Coefficients of a camera's lens, as `make_camera` takes them."""
    lens = LENSES[model_of(camera)]
    distortion: tuple[float, ...] = getattr(camera, "distortion", ())
    return (*(getattr(camera, name) for name in lens.numbers), *distortion)
