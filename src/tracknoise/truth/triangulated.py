"""Truth without depth: the point that fits a track best, from the known poses and the track itself.

It is self-referential: what a point can absorb, such as drift along the epipolar line, is not in its errors. The module
computes distances from epipolar lines, which need no point, and fits points to tracks. With a rolling shutter, a point
is fitted with the poses of the observed rows; its true positions are those in its own.

Epipolar lines
--------------

What two frames and their poses tell is the distance of observed positions from the epipolar line of the first one. The
first position of a track has the ray m. With the pose R, t of the first camera in a later one, the position there lies
on the plane with the normal e = t x R m. For an observed position x with the ray b(x), f = e . b(x) is zero on the
epipolar line, and to first order

    d = f / |df/dx|    (truth.epipolar)

is the signed distance from it, px. White noise of variance s^2 in both positions gives d the variance
s^2 (1 + |df/dx_1|^2 / |df/dx|^2). This holds for every camera model. Errors along the line do not appear.

Points
------

World points of tracks are fitted by least squares of their reprojection errors in all frames, for all tracks at once. A
point lies at (a, b, 1) / r in the camera of the track's first frame: (a, b) is its direction, r its inverse depth. In
frame i, with the pose R_i, t_i of the first camera in that of frame i, it has the position

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
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.poses import require_some_poses
from tracknoise.sequences.row_poses import RowPoses
from tracknoise.sequences.sequence import TRIANGULATED, Sequence, camera_at
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.truth import TruePositions
from tracknoise.truth.uncertainty import ObservedCameras
from tracknoise.truth.visibility import project_by_rows

LEAST_ANGLE = 0.02
"""Rays at a smaller angle to the translation, rad, have no epipolar line: its direction would depend on the noise."""
_STEP_PX = 1e-3

Rays = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Takes pixels (n, 2); returns rays (n, 3)."""


def epipolar_distances(
    uv: NDArray[np.float64],
    first_uv: NDArray[np.float64],
    rays: Rays,
    first_rays: Rays,
    camera_from_first: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Signed distances from epipolar lines, and their variances for white noise of 1 px: (truth.epipolar).

    Shapes: uv, first_uv (n, 2) px, camera_from_first (n, 4, 4); returns (n, 2). Distance, px, and its variance, px^2.
    NaN where there is no epipolar line. A distance is positive on the side to which the normal t x R m points.
    """
    rotation, translation = camera_from_first[:, :3, :3], camera_from_first[:, :3, 3]
    turned = np.einsum("nij,nj->ni", rotation, first_rays(first_uv))
    normal = np.cross(translation, turned)
    seen = rays(uv)
    backward = np.einsum("nij,ni->nj", rotation, np.cross(seen, translation))
    here = np.einsum("ni,nij->nj", normal, _derivative(rays, uv))
    there = np.einsum("ni,nij->nj", backward, _derivative(first_rays, first_uv))
    length = np.linalg.norm(translation, axis=1) * np.linalg.norm(turned, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        apart = np.linalg.norm(normal, axis=1) / length >= LEAST_ANGLE
        slope = np.linalg.norm(here, axis=1)
        distance = np.einsum("ni,ni->n", normal, seen) / slope
        variance = 1.0 + np.square(there).sum(axis=1) / np.square(slope)
    return np.where(apart[:, None], np.column_stack([distance, variance]), np.nan)


def _derivative(rays: Rays, uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative of rays by pixels, (n, 3, 2)."""
    steps = (np.array([_STEP_PX, 0.0]), np.array([0.0, _STEP_PX]))
    return np.stack([(rays(uv + step) - rays(uv - step)) / (2.0 * _STEP_PX) for step in steps], axis=-1)


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
    """Observations of tracks, in the order of tracks, then frames."""

    uv: NDArray[np.float64]  # (n, 2): observed positions, px
    bearings: NDArray[np.float64]  # (n, 3): rays through them, in their cameras
    # (n, 4, 4): pose of the track's first camera in the camera of each observation
    camera_from_first: NDArray[np.float64]
    start: NDArray[np.intp]  # (m,): row of each track's first observation
    track: NDArray[np.intp]  # (n,): place of each observation's track, from 0
    # projects points (n, 3) of the cameras of the observations, (n, 2) px
    project: Callable[[NDArray[np.float64]], NDArray[np.float64]]

    def sums(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sums over the observations of each track, (m, ...), of values (n, ...)."""
        return np.asarray(np.add.reduceat(values, self.start, axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class Triangulation:
    """Points that were fitted to tracks."""

    uv: NDArray[np.float64]  # (n, 2): position of the point in each frame, px; NaN where the point is unknown
    leverage: NDArray[np.float64]  # (n, 2, 2): H_i: covariance of `uv` for white noise of 1 px
    points: NDArray[np.float64]  # (m, 3): the point in the first camera of each track, metres; NaN where it is unknown
    known: NDArray[np.bool_]  # (m,): whether the fit has a point whose depth is known


def triangulate(views: TrackViews) -> Triangulation:
    """Fit a point to each track: (truth.triangulated)."""
    baseline = np.maximum.reduceat(np.linalg.norm(views.camera_from_first[:, :3, 3], axis=1), views.start)
    unit = np.where(baseline > 0, baseline, 1.0)  # inverse depths are of the order of 1 in it
    motion = views.camera_from_first[:, :3].copy()
    motion[:, :, 3] /= unit[views.track, None]
    point, cost = _fit(views, motion)
    uv, jacobian = _linearised(views, motion, point)
    inverse, regular = _inverse(views.sums(np.swapaxes(jacobian, 1, 2) @ jacobian))
    error = np.sqrt(inverse[:, 2, 2])
    valid = regular & np.isfinite(cost) & (baseline > 0) & (point[:, 3] >= LEAST_PARALLAX * error)
    uv[~valid[views.track]] = np.nan
    leverage = jacobian @ inverse[views.track] @ np.swapaxes(jacobian, 1, 2)
    leverage[~valid[views.track]] = np.nan
    depth_m = np.where(valid, unit / np.where(valid, point[:, 3], 1.0), np.nan)
    return Triangulation(uv, leverage, point[:, :3] * depth_m[:, None], valid)


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
        trial_cost = _cost(views, motion, trial)
        better = trial_cost <= cost
        finite_cost = np.where(np.isfinite(cost), cost, 0.0)  # without a cost there is nothing to improve
        settled = (np.abs(trial_cost - finite_cost) <= _SETTLED * finite_cost) | (damping > _HOPELESS) | np.isinf(cost)
        point, cost = np.where(better[:, None], trial, point), np.where(better, trial_cost, cost)
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


@dataclass(frozen=True, slots=True)
class Triangulated:
    """The point that fits a track best in all frames with a pose: (truth.triangulated).

    Tracks with fewer than three observations, or whose depth is unknown by
    `tracknoise.truth.triangulated.LEAST_PARALLAX`, have no true positions. All observations after the first have a
    distance from their epipolar line.
    """

    kind: ClassVar[str] = TRIANGULATED

    def open(self, sequence: Sequence) -> "TriangulatedTruth":
        """Make the truth of one sequence.

        Raises
        ------
        DataError
            If fewer than two frames have a pose.
        """
        require_some_poses(sequence.world_from_camera, sequence.source)
        return TriangulatedTruth(sequence)


@dataclass(frozen=True, slots=True, eq=False)
class TriangulatedTruth:
    """Triangulated truth of one sequence.

    Parameters
    ----------
    sequence
        The sequence.
    """

    kind: ClassVar[str] = TRIANGULATED
    key_frame: ClassVar[None] = None

    sequence: Sequence

    def start(self) -> "TriangulatedSession":
        """Start a session for one tracker setup."""
        return TriangulatedSession(self.sequence)


class TriangulatedSession:
    """The tracks of one tracker setup; points are fitted when all observations are known."""

    __slots__ = ("_observed", "_sequence")

    def __init__(self, sequence: Sequence) -> None:
        self._sequence = sequence
        self._observed: list[tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64], NDArray[np.bool_]]] = []

    def observe(self, index: int, tracks: NDArray[np.uint32], uv: NDArray[np.float64], born: NDArray[np.bool_]) -> None:
        """Keep the observations of a frame: see `tracknoise.truth.truth.TruthSession.observe`."""
        self._observed.append((np.full(len(tracks), index, np.intp), tracks.astype(np.intp), uv, born))

    def resolve(self) -> TruePositions:
        """Fit the points, and project them: see `tracknoise.truth.truth.TruthSession.resolve`."""
        none = (np.empty(0, np.intp), np.empty(0, np.intp), np.empty((0, 2)), np.empty(0, np.bool_))
        frame, track, uv, born = (np.concatenate(parts) for parts in zip(none, *self._observed, strict=True))
        return _Observations(self._sequence, frame, track, uv, np.flatnonzero(born)).positions()


class _Observations:
    """All observations of a session; `births` are the rows in which tracks begin, in the order of their numbers."""

    def __init__(
        self,
        sequence: Sequence,
        frame: NDArray[np.intp],
        track: NDArray[np.intp],
        uv: NDArray[np.float64],
        births: NDArray[np.intp],
    ) -> None:
        self._frame, self._track, self._uv = frame, track, uv
        self._birth, self._n_tracks = births[track], len(births)
        self._sequence, rows = sequence, RowPoses(sequence)
        self._poses, self._rolling = rows.at(frame, uv), rows.rows
        self._cameras = ObservedCameras.of(sequence, frame)
        self._bearings = self._cameras.bearings(uv)
        posed = np.asarray(rows.known[frame])
        self._posed = np.asarray(posed & posed[self._birth])

    def positions(self) -> TruePositions:
        """True positions where a point was found, and the distances from epipolar lines."""
        count = len(self._frame)
        uv, leverage = np.full((count, 2), np.nan), np.full((count, 2, 2), np.nan)
        depth_m = np.full(self._n_tracks, np.nan)
        status = np.where(self._posed, TruthStatus.no_depth, TruthStatus.no_pose).astype(np.int8)
        rows = self._long_tracks()
        if len(rows):
            fitted = triangulate(self._views(rows))
            tracks = np.unique(self._track[rows])
            uv[rows], leverage[rows] = self._in_own_rows(rows, tracks, fitted), fitted.leverage
            depth_m[tracks] = fitted.points[:, 2]
            inside = self._cameras.chosen(rows).contain(uv[rows])
            seen = np.where(inside, TruthStatus.valid, TruthStatus.out_of_image)
            status[rows] = np.where(np.isnan(uv[rows, 0]), status[rows], seen)
        return TruePositions(uv, status, depth_m, leverage=leverage, epipolar=self._epipolar())

    def _usable(self) -> NDArray[np.bool_]:
        """Observations that have a pose and a ray, as have the first ones of their tracks."""
        has_ray = np.asarray(~np.isnan(self._bearings).any(axis=1))
        return np.asarray(self._posed & has_ray & has_ray[self._birth])

    def _long_tracks(self) -> NDArray[np.intp]:
        """Rows of tracks with enough observations, in the order of tracks, then frames."""
        usable = np.flatnonzero(self._usable())
        number = np.bincount(self._track[usable], minlength=self._n_tracks)
        long = usable[number[self._track[usable]] >= LEAST_OBSERVATIONS]
        return long[np.argsort(self._track[long], kind="stable")]

    def _views(self, rows: NDArray[np.intp]) -> TrackViews:
        _, start, place = np.unique(self._track[rows], return_index=True, return_inverse=True)
        cameras = self._cameras.chosen(rows)
        return TrackViews(
            self._uv[rows], self._bearings[rows], self._from_first(rows), start, place.reshape(-1), cameras.project
        )

    def _in_own_rows(
        self, rows: NDArray[np.intp], tracks: NDArray[np.intp], fitted: Triangulation
    ) -> NDArray[np.float64]:
        """Positions of the points, (n, 2): with a rolling shutter, at the time of their own rows, not the observed."""
        if self._rolling is None:
            return fitted.uv
        first = self._birth[rows]
        points_world = transform(self._poses[first], fitted.points[np.searchsorted(tracks, self._track[rows])])
        uv = np.full((len(rows), 2), np.nan)
        for index in np.unique(self._frame[rows]).tolist():
            here = self._frame[rows] == index
            uv[here], _ = project_by_rows(self._rolling, camera_at(self._sequence, index), index, points_world[here])
        return uv

    def _from_first(self, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        """(n, 4, 4) float64: pose of the first camera of the track in that of each observation."""
        return np.asarray(invert(self._poses[rows]) @ self._poses[self._birth[rows]])

    def _epipolar(self) -> NDArray[np.float64]:
        """(n, 2) float64: distances from epipolar lines and their variances; NaN in the first frame of a track."""
        distances = np.full((len(self._frame), 2), np.nan)
        rows = np.flatnonzero(self._usable() & (self._birth != np.arange(len(self._frame))))
        first = self._birth[rows]
        here, there = self._cameras.chosen(rows), self._cameras.chosen(first)
        distances[rows] = epipolar_distances(
            self._uv[rows], self._uv[first], here.bearings, there.bearings, self._from_first(rows)
        )
        return distances
