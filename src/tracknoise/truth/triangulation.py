"""World points of tracks by least squares of their reprojection errors in all frames, for all tracks at once.

A point lies at (a, b, 1) / r in the camera of the track's first frame: (a, b) is its direction, r its inverse depth.
In frame i, with the pose R_i, t_i of the first camera in that of frame i, it has the position

    x_i = pi(R_i (a, b, 1) + r t_i)    (truth.triangulated)

which is smooth where a point is far. (a, b, r) minimise the sum of the squares of observed minus true positions, by
Gauss-Newton steps with Levenberg's damping. They begin at the direction of the first observation and the inverse depth
that brings its epipolar planes closest to the other rays.

The fit absorbs part of the noise. With J_i the derivative of x_i and A the sum of J_i^T J_i, the covariance of x_i is
H_i = J_i A^-1 J_i^T in units of the variance of the noise, if this is white. That of an error is then 1 - H_i, and the
sum of the squares of all N errors is 2 N - 3 times the variance.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LEAST_OBSERVATIONS = 3
"""Tracks with fewer observations have no more than one degree of freedom left, and get no point."""
LEAST_PARALLAX = 2.0
"""The depth counts as known where the inverse depth exceeds so many times the error that noise of 1 px gives it.

With 2, noise of 1 px in every position changes the depth by half. The rule uses the fitted depth, which is independent
of the errors of the fit, so that it does not change their variance.
"""

_MOST_STEPS = 30
_DIRECTION = [0, 1, 3]
"""What is fitted of (a, b, 1, r)."""
_SETTLED = 1e-10
_LEAST_DAMPING, _HOPELESS = 1e-12, 1e8
_STEP = 1e-6
_SINGULAR = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class TrackViews:
    """Observations of tracks, in the order of tracks, then frames.

    Attributes
    ----------
    uv : (n, 2) float64
        Observed positions, px.
    bearings : (n, 3) float64
        Rays through them, in their cameras.
    camera_from_first : (n, 4, 4) float64
        Pose of the track's first camera in the camera of each observation.
    start : (m,) intp
        Row of each track's first observation.
    track : (n,) intp
        Place of each observation's track, from 0.
    project
        Projects points (n, 3) of the cameras of the observations, (n, 2) px.
    """

    uv: NDArray[np.float64]
    bearings: NDArray[np.float64]
    camera_from_first: NDArray[np.float64]
    start: NDArray[np.intp]
    track: NDArray[np.intp]
    project: Callable[[NDArray[np.float64]], NDArray[np.float64]]

    def sums(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sums over the observations of each track, (m, ...), of values (n, ...)."""
        return np.asarray(np.add.reduceat(values, self.start, axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class Triangulation:
    """Points that were fitted to tracks.

    Attributes
    ----------
    uv : (n, 2) float64
        Position of the point in each frame, px; NaN where the point is unknown.
    leverage : (n, 2, 2) float64
        H_i: covariance of `uv` for white noise of 1 px.
    points : (m, 3) float64
        The point in the first camera of each track, metres; NaN where it is unknown.
    known : (m,) bool
        Whether the fit has a point whose depth is known.
    """

    uv: NDArray[np.float64]
    leverage: NDArray[np.float64]
    points: NDArray[np.float64]
    known: NDArray[np.bool_]


def triangulate(views: TrackViews) -> Triangulation:
    """Fit a point to each track: (truth.triangulated).

    Parameters
    ----------
    views
        Observations of tracks with at least `LEAST_OBSERVATIONS` each.
    """
    baseline = np.maximum.reduceat(np.linalg.norm(views.camera_from_first[:, :3, 3], axis=1), views.start)
    unit = np.where(baseline > 0, baseline, 1.0)  # inverse depths are of the order of 1 in it
    motion = views.camera_from_first[:, :3].copy()
    motion[:, :, 3] /= unit[views.track, None]
    point, cost = _fit(views, motion)
    uv, jacobian = _linearised(views, motion, point)
    inverse, regular = _inverse(views.sums(np.swapaxes(jacobian, 1, 2) @ jacobian))
    error = np.sqrt(inverse[:, 2, 2])
    known = regular & np.isfinite(cost) & (baseline > 0) & (point[:, 3] >= LEAST_PARALLAX * error)
    uv[~known[views.track]] = np.nan
    leverage = jacobian @ inverse[views.track] @ np.swapaxes(jacobian, 1, 2)
    leverage[~known[views.track]] = np.nan
    depth_m = np.where(known, unit / np.where(known, point[:, 3], 1.0), np.nan)
    return Triangulation(uv, leverage, point[:, :3] * depth_m[:, None], known)


def _fit(views: TrackViews, motion: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(a, b, 1, r) of each track, (m, 4), and the sum of its squared errors, (m,), infinite where there is none."""
    point = _first_guess(views, motion)
    cost = _cost(views, motion, point)
    damping = np.full(len(cost), 1e-3)
    for _ in range(_MOST_STEPS):
        uv, jacobian = _linearised(views, motion, point)
        transposed = np.swapaxes(jacobian, 1, 2)
        gradient = views.sums((transposed @ (views.uv - uv)[:, :, None])[:, :, 0])
        trial = point.copy()
        trial[:, _DIRECTION] += _step(views.sums(transposed @ jacobian), gradient, damping)
        found = _cost(views, motion, trial)
        better = found <= cost
        known = np.where(np.isfinite(cost), cost, 0.0)  # without a cost there is nothing to improve
        settled = (np.abs(found - known) <= _SETTLED * known) | (damping > _HOPELESS) | np.isinf(cost)
        point, cost = np.where(better[:, None], trial, point), np.where(better, found, cost)
        damping = np.maximum(damping * np.where(better, 0.1, 10.0), _LEAST_DAMPING)
        if settled.all():
            break
    return point, cost


def _first_guess(views: TrackViews, motion: NDArray[np.float64]) -> NDArray[np.float64]:
    """The first direction, and the inverse depth by linear least squares; 0 where it has no image in every frame."""
    point = np.zeros((len(views.start), 4))
    point[:, :3] = views.bearings[views.start]
    rays = views.bearings / np.linalg.norm(views.bearings, axis=1, keepdims=True)
    turned = np.einsum("nij,nj->ni", motion[:, :, :3], point[views.track, :3])
    away, moved = np.cross(rays, turned), np.cross(rays, motion[:, :, 3])
    most = views.sums(np.square(moved).sum(axis=1))
    slope = -views.sums((away * moved).sum(axis=1)) / np.where(most > 0, most, 1.0)
    near = point.copy()
    near[:, 3] = slope
    return np.where(np.isfinite(_cost(views, motion, near))[:, None], near, point)


def _points(views: TrackViews, motion: NDArray[np.float64], point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points in the camera of each observation, (n, 3), up to their scale."""
    return np.asarray(np.einsum("nij,nj->ni", motion, point[views.track]))


def _cost(views: TrackViews, motion: NDArray[np.float64], point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum of the squared errors of each track, (m,); infinite where a position is unknown."""
    error = views.uv - views.project(_points(views, motion, point))
    total = views.sums(np.square(error).sum(axis=1))
    return np.where(np.isnan(total), np.inf, total)


def _linearised(
    views: TrackViews, motion: NDArray[np.float64], point: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions (n, 2), and their derivatives by (a, b, r), (n, 2, 3); 0 where there is none."""
    points = _points(views, motion, point)
    step = _STEP * np.linalg.norm(points, axis=1, keepdims=True)
    columns = []
    for axis in np.eye(3):
        change = views.project(points + step * axis) - views.project(points - step * axis)
        columns.append(change / (2.0 * step))
    jacobian = np.stack(columns, axis=-1) @ motion[:, :, _DIRECTION]
    return views.project(points), np.where(np.isfinite(jacobian), jacobian, 0.0)


def _step(
    normal: NDArray[np.float64], gradient: NDArray[np.float64], damping: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Damped Gauss-Newton step of each track, (m, 3)."""
    scaled, size = _scaled(normal)
    damped = scaled + np.eye(3) * damping[:, None, None]
    towards = np.nan_to_num(gradient / size)[:, :, None]
    return np.asarray(np.linalg.solve(damped, towards)[:, :, 0] / size)


def _inverse(normal: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Inverses of normal matrices (m, 3, 3), and whether they have one, (m,)."""
    scaled, size = _scaled(normal)
    regular = np.linalg.eigvalsh(scaled)[:, 0] > _SINGULAR
    safe = np.where(regular[:, None, None], scaled, np.eye(3))
    size = np.where(regular[:, None], size, 1.0)
    return np.linalg.inv(safe) / size[:, :, None] / size[:, None, :], regular


def _scaled(normal: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Normal matrices with ones, or zeros, on the diagonal, and the roots of the diagonal, (m, 3), 1 where it is 0."""
    diagonal = np.einsum("mii->mi", normal)
    size = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    return normal / size[:, :, None] / size[:, None, :], size
