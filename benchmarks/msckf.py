"""A multi-state constraint Kalman filter: inertial readings, poses of the last frames, tracks used once, features.

The state is the newest pose, velocity and biases, a copy of the pose at each of the last frames, and features. What it
does with tracks is that of OpenVINS:

- A piece of a track is used when the track ends, or when it has been seen in as many frames as there are copies; its
  next observations are then another piece. Its point is triangulated with the copies, its residuals are whitened by the
  assumed noise, the point is projected out, and what remains updates the filter. At most `MOST_TRACKS` are used at a
  frame, the longest first.
- A track that was seen in all copies becomes a feature of the state instead, while there is room: three directions of
  its residuals tell the point, the others update the filter.
- A feature is updated by each observation, with a sigma of its own. It leaves when its track ends, or when its
  observations failed the gate twice.

Each has to pass a chi-square gate over its whole innovation: with the errors of the predicted poses. A feature is
position and inverse depth in the frame of its first observation, as estimated when it came: that frame is a number
from then on, no part of the state.

Derivatives of a feature's observations are taken at its first estimate, and that of the pose. Else the filter believes
to observe its heading: with features that live 12 s the NEES was 1.4 where the noise is right, in place of 1.1. Tracks
that are used once are linearised at the present estimates. With first ones, as in OpenVINS, the NEES was 5 in place of
.9 where the camera moves little.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, solve_triangular
from scipy.spatial.transform import Rotation
from scipy.special import chdtri

from benchmarks.filter_tracks import CLONES, Pieces, Unused
from benchmarks.inertial_problem import InertialProblem
from benchmarks.track_points import (
    derivatives,
    from_inverse,
    residuals,
    seen_from,
    to_inverse,
    triangulated,
    within,
)
from tracknoise.estimators.linear_window import of_full_rank
from tracknoise.geometry.projection import cross_matrices
from tracknoise.inference.track_noise import TrackNoise
from tracknoise.simulation.inertial import RATE_HZ

Array = NDArray[np.float64]

MOST_TRACKS = 40
"""Most tracks that are used at a frame."""
MOST_FEATURES = 50
"""Most features in the state of OpenVINS, by default."""
_MOST_FAILURES = 1
_INERTIAL = 15
"""Errors of rotation, position, velocity, and biases of gyroscope and accelerometer."""
_START = np.repeat((1e-3, 1e-3, 2e-3, 1e-4, 1e-3), 3)
"""Standard deviations of the first state: rad, m, m/s, rad/s, m/s^2."""


@dataclass(frozen=True, slots=True)
class GateRule:
    """Factor on a chi-square gate at .95: (p + (1 - p) measured) scale.

    Parameters
    ----------
    measured
        What good ones need at true poses.
    predicted
        Share p of the claimed variance of innovations that errors of the predicted state have; None for what the filter
        claims of each.
    scale
        A quantile over that at .95.
    """

    measured: float = 1.0
    predicted: float | None = 0.0
    scale: float = 1.0

    @property
    def factor(self) -> float:
        """Without predicted errors."""
        return self.measured * self.scale

    def factors(self, predicted: Array) -> Array:
        """(n,), by what the filter claims of each."""
        share = predicted if self.predicted is None else np.full_like(predicted, self.predicted)
        return (share + (1.0 - share) * self.measured) * self.scale


PLAIN = GateRule()
"""The gate at .95 itself."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Assumed:
    """What a filter assumes.

    Parameters
    ----------
    tracks
        Noise of tracks: a standard deviation of all observations, px, or components of whole tracks.
    gate
        Of tracks.
    features, features_gate
        The same of features in the state; a standard deviation, px.
    most_features
        How many there may be.
    """

    tracks: float | TrackNoise
    gate: GateRule = PLAIN
    features: float = 1.0
    features_gate: GateRule = PLAIN
    most_features: int = 0


@dataclass(frozen=True, slots=True)
class Innovations:
    """What a filter saw of what it gated.

    Parameters
    ----------
    passed, good
        Share that passed the gate, of all and of those whose errors are small.
    ratio
        Mean of the normalised innovations squared, of all, over their degrees of freedom.
    predicted
        Mean share of their claimed variance that errors of the predicted state have.
    """

    passed: float
    good: float
    ratio: float
    predicted: float


@dataclass(frozen=True, slots=True, eq=False)
class Filtered:
    """The answer of the filter.

    Attributes
    ----------
    poses : (frames, 4, 4) float64
        Each as it was estimated when its frame was the newest.
    nees : (frames - 1,) float64
        Normalised error squared of the newest pose over 6, from the second frame on.
    triangulated : float
        Share of tracks whose point was found.
    tracks, coming, features : Innovations
        Of tracks that are used once, of those that become features, and of later observations of these.
    """

    poses: Array
    nees: Array
    triangulated: float
    tracks: Innovations
    coming: Innovations
    features: Innovations


def run_filter(problem: InertialProblem, assumed: Assumed, *, seed: int = 0) -> Filtered:
    """Filter a sequence. `seed`: of the errors of the first state."""
    work = _Filter(problem, assumed, seed=seed)
    work.clone()
    poses, nees = [work.pose()], []
    for frame in range(1, len(problem.world_from_camera)):
        work.propagate(problem.gyro[frame - 1], problem.accelerometer[frame - 1])
        work.clone()
        work.use_tracks(frame)
        poses.append(work.pose())
        nees.append(work.nees(problem.world_from_camera[frame]))
    found = float(np.concatenate(work.found).mean())
    gates = (one.means() for one in (work.tracks, work.coming, work.features))
    return Filtered(np.stack(poses), np.array(nees), found, *gates)


class _Gate:
    """A chi-square gate, and all that it saw."""

    def __init__(self, rule: GateRule) -> None:
        self._rule = rule
        self._seen: list[Array] = []

    def passes(
        self,
        residual: Array,
        rows: Array,
        covariance: Array,
        *,
        freedom: NDArray[np.int64],
        counted: NDArray[np.int64] | None = None,
        good: NDArray[np.bool_],
    ) -> NDArray[np.bool_]:
        """(n,): which whitened residuals (n, m) pass, with derivatives (n, m, p) by errors of this covariance.

        `counted`: degrees of freedom that the gate is for, if they are others.
        """
        claimed = rows @ covariance @ np.swapaxes(rows, 1, 2) + np.eye(rows.shape[1])
        squared = np.einsum("ti,ti->t", residual, np.linalg.solve(claimed, residual[:, :, None])[:, :, 0])
        of_state = np.trace(claimed, axis1=1, axis2=2) - rows.shape[1]
        predicted = of_state / (of_state + freedom)
        limits = self._rule.factors(predicted) * chdtri(freedom if counted is None else counted, 0.05)
        passes = np.asarray(squared <= limits)
        self._seen.append(np.column_stack([passes, np.where(good, passes, np.nan), squared / freedom, predicted]))
        return passes

    def means(self) -> Innovations:
        seen = np.concatenate([np.full((1, 4), np.nan), *self._seen])
        known = np.isfinite(seen)
        sums = np.where(known, seen, 0.0).sum(axis=0)
        return Innovations(*np.divide(sums, known.sum(axis=0), out=np.full(4, np.nan), where=known.any(axis=0)))


@dataclass(frozen=True, slots=True, eq=False)
class _Features:
    """Features in the state.

    Parameters
    ----------
    tracks, failures
        (n,) integers: which they are, and how often they failed the gate.
    frames
        (n, 4, 4) float64: what they are relative to.
    values, first
        (n, 3) float64: position and inverse depth, and their first estimates.
    """

    tracks: NDArray[np.int64]
    failures: NDArray[np.int64]
    frames: Array
    values: Array
    first: Array

    @classmethod
    def none(cls) -> "_Features":
        count = np.zeros(0, np.int64)
        return cls(count, count, np.zeros((0, 4, 4)), np.zeros((0, 3)), np.zeros((0, 3)))

    def chosen(self, kept: NDArray[np.bool_]) -> "_Features":
        return _Features(*(getattr(self, field.name)[kept] for field in fields(self)))

    def joined(self, other: "_Features") -> "_Features":
        pairs = ((getattr(one, field.name) for one in (self, other)) for field in fields(self))
        return _Features(*(np.concatenate(list(pair)) for pair in pairs))


class _Filter:
    """The state of the filter, and what it did with tracks."""

    def __init__(self, problem: InertialProblem, assumed: Assumed, *, seed: int) -> None:
        error = _START * np.random.default_rng((seed, 4)).standard_normal(_INERTIAL)
        first = problem.world_from_camera[0]
        self._problem, self._assumed, self._unused = problem, assumed, Unused(problem.tracks)
        self._rotation = first[:3, :3] @ _turns(error[:3])
        self._position, self._velocity = first[:3, 3] + error[3:6], problem.velocity + error[6:9]
        self._gyro_bias, self._accelerometer_bias = error[9:12], error[12:15]
        self._clones, self._first_pose = np.zeros((0, 4, 4)), self.pose()
        self._oldest = 0
        self._known = _Features.none()
        self._covariance = np.diag(_START**2)
        self.found: list[NDArray[np.bool_]] = []
        self.tracks, self.coming = _Gate(assumed.gate), _Gate(assumed.features_gate)
        self.features = _Gate(assumed.features_gate)

    def pose(self) -> Array:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = self._rotation, self._position
        return pose

    def nees(self, true: Array) -> float:
        turned = Rotation.from_matrix(self._rotation.T @ true[:3, :3]).as_rotvec()
        error = np.concatenate([turned, true[:3, 3] - self._position])
        return float(error @ np.linalg.solve(self._covariance[:6, :6], error) / 6.0)

    def propagate(self, gyro: Array, accelerometer: Array) -> None:
        """Readings (n, 3) between two frames."""
        interval_s, noise = 1.0 / RATE_HZ, self._problem.noise
        rates, forces = gyro - self._gyro_bias, accelerometer - self._accelerometer_bias
        turns, halves = _turns(rates * interval_s), _turns(rates * interval_s / 2.0)
        halfway = np.empty_like(turns)
        for place, turn in enumerate(turns):
            halfway[place] = self._rotation @ halves[place]
            self._rotation = self._rotation @ turn
        for acceleration in np.einsum("nij,nj->ni", halfway, forces) + self._problem.gravity:
            self._position = self._position + self._velocity * interval_s + acceleration * interval_s**2 / 2.0
            self._velocity = self._velocity + acceleration * interval_s
        densities = (noise.gyro, 0.0, noise.accelerometer, noise.gyro_walk, noise.accelerometer_walk)
        added = np.diag(np.repeat(np.square(densities), 3)) * interval_s
        moved, gained = np.eye(_INERTIAL), np.zeros((_INERTIAL, _INERTIAL))
        for step in _steps(turns, halfway, forces, interval_s):
            moved, gained = step @ moved, step @ gained @ step.T + added
        own, rest, covariance = slice(0, _INERTIAL), slice(_INERTIAL, None), self._covariance
        inertial = moved @ covariance[own, own] @ moved.T + gained
        covariance[own, own] = (inertial + inertial.T) / 2.0
        covariance[own, rest] = moved @ covariance[own, rest]
        covariance[rest, own] = covariance[own, rest].T

    def clone(self) -> None:
        """Keep a copy of the newest pose, and drop the oldest one if there are too many."""
        dropped, end = int(len(self._clones) == CLONES), self._end
        kept = np.r_[:_INERTIAL, _INERTIAL + 6 * dropped : end, :6, end : len(self._covariance)]
        self._covariance = self._covariance[np.ix_(kept, kept)]
        self._first_pose = self.pose()
        self._clones = np.concatenate([self._clones[dropped:], self._first_pose[None]])
        self._oldest += dropped

    @property
    def _end(self) -> int:
        """Where the errors of copies end and those of features begin."""
        return _INERTIAL + 6 * len(self._clones)

    @property
    def _of_clones(self) -> Array:
        """Covariance of the errors of copies."""
        return self._covariance[_INERTIAL : self._end, _INERTIAL : self._end]

    def use_tracks(self, frame: int) -> None:
        """Update with what is ready at a frame: tracks, features, then those that become features."""
        known = self._known
        newest = _each(self.pose(), len(known.tracks))
        ahead = within(seen_from(newest, from_inverse(known.frames, known.values)))
        self._keep((self._problem.tracks.last[known.tracks] >= frame) & ahead & (known.values[:, 2] > 0.0), frame)
        full = self._unused.full(frame)
        room = self._assumed.most_features - len(self._known.tracks)
        coming = full[self._unused.whole(full)][:room]
        self._use_once(np.concatenate([self._unused.lost(frame), np.setdiff1d(full, coming)]), frame)
        self._observe(frame)
        self._admit(coming, frame)

    def _use_once(self, tracks: NDArray[np.int64], frame: int) -> None:
        pieces = self._unused.taken(tracks, frame)
        pieces, poses, points, _ = self._with_points(
            pieces.chosen(np.argsort(-pieces.length, kind="stable")[:MOST_TRACKS])
        )
        values = self._whitened(pieces, poses, points, self._linearised(pieces, poses, points))
        _, told = _told_apart(*values)
        passes = self.tracks.passes(*told, self._of_clones, freedom=2 * pieces.length - 3, good=pieces.good)
        self._update(*(one[passes] for one in told))

    def _observe(self, frame: int) -> None:
        """Update with the newest observations of features, without those whose observations failed too often."""
        known, end = self._known, self._end
        camera, tracks, count = self._problem.camera, self._problem.tracks, len(known.tracks)
        seen, there = tracks.rows(known.tracks, np.full(count, frame)), np.ones((count, 1), dtype=np.bool_)
        points, first = (from_inverse(known.frames, values) for values in (known.values, known.first))
        residual = residuals(camera, _each(self.pose(), count), points, tracks.uv[seen][:, None], there)
        by_pose, by_point = derivatives(camera, _each(self._first_pose, count), first, there)
        rows = np.zeros((count, 2, len(self._covariance) - _INERTIAL))
        rows[:, :, end - _INERTIAL - 6 : end - _INERTIAL] = by_pose[:, 0]
        own = end - _INERTIAL + 3 * np.arange(count)[:, None] + np.arange(3)
        rows[np.arange(count)[:, None], :, own] = np.swapaxes(by_point @ to_inverse(known.frames, first)[1], 1, 2)
        residual, rows = residual / self._assumed.features, rows / self._assumed.features
        covariance = self._covariance[_INERTIAL:, _INERTIAL:]
        passes = self.features.passes(residual, rows, covariance, freedom=np.full(count, 2), good=tracks.good[seen])
        self._update(residual[passes], rows[passes])
        self._known = replace(self._known, failures=known.failures + ~passes)
        self._keep(self._known.failures <= _MOST_FAILURES, frame)

    def _admit(self, tracks: NDArray[np.int64], frame: int) -> None:
        """Tracks become features, if they pass the gate."""
        pieces, poses, points, usable = self._with_points(self._unused.taken(tracks, frame))
        first, by_values = to_inverse(poses[:, 0], points)
        residual, by_clones, by_point = self._linearised(pieces, poses, points)
        scaled = (one / self._assumed.features for one in (residual, by_clones, by_point @ by_values))
        of_points, others = _told_apart(*scaled)
        passes = self.coming.passes(
            *others,
            self._of_clones,
            freedom=2 * pieces.length - 3,
            counted=2 * pieces.length,  # OpenVINS counts those of the point, too
            good=pieces.good,
        )
        tracks, first = tracks[usable][passes], first[passes]
        residual, by_clones, root = (one[passes] for one in of_points)
        values = first + np.linalg.solve(root, residual[:, :, None])[:, :, 0]
        by_clones = -np.linalg.solve(root, by_clones).reshape(-1, by_clones.shape[2])
        crossed, inverse = by_clones @ self._covariance[_INERTIAL : self._end], np.linalg.inv(root)
        own = by_clones @ self._of_clones @ by_clones.T + block_diag(*inverse @ np.swapaxes(inverse, 1, 2))
        self._covariance = np.block([[self._covariance, crossed.T], [crossed, own]])
        self._known = self._known.joined(_Features(tracks, np.zeros_like(tracks), poses[passes, 0], values, first))
        self._unused.put(tracks, frame, in_state=True)
        self._update(*(one[passes] for one in others))

    def _keep(self, kept: NDArray[np.bool_], frame: int) -> None:
        """Keep some features. What tracks of others show after this frame may be used again."""
        self._unused.put(self._known.tracks[~kept], frame, in_state=False)
        self._known = self._known.chosen(kept)
        places = np.r_[: self._end, self._end + np.flatnonzero(np.repeat(kept, 3))]
        self._covariance = self._covariance[np.ix_(places, places)]

    def _with_points(self, pieces: Pieces) -> tuple[Pieces, Array, Array, NDArray[np.bool_]]:
        """Pieces with a point, their poses (n, CLONES, 4, 4) and points (n, 3), and which of all have one."""
        poses = self._clones[self._places(pieces)]
        points, usable = triangulated(self._problem.camera, poses, pieces)
        self.found.append(usable)
        return pieces.chosen(usable), poses[usable], points[usable], usable

    def _places(self, pieces: Pieces) -> NDArray[np.int64]:
        """(n, CLONES): which copies see them; the newest one after the last observation."""
        return np.minimum(pieces.first[:, None] - self._oldest + np.arange(CLONES), len(self._clones) - 1)

    def _linearised(self, pieces: Pieces, poses: Array, points: Array) -> tuple[Array, Array, Array]:
        """Residuals (n, m), and their derivatives by copies (n, m, p) and by points (n, m, 3)."""
        camera, places, count = self._problem.camera, self._places(pieces), len(points)
        residual = residuals(camera, poses, points, pieces.uv, pieces.there)
        by_pose, by_point = derivatives(camera, poses, points, pieces.there)
        spread = np.zeros((count, CLONES, 2, len(self._clones), 6))
        spread[np.arange(count)[:, None], np.arange(CLONES), :, places] = by_pose
        return residual, spread.reshape(count, 2 * CLONES, 6 * len(self._clones)), by_point

    def _whitened(self, pieces: Pieces, poses: Array, points: Array, values: Sequence[Array]) -> list[Array]:
        """Values (n, 2 CLONES, ...), times the inverse root of the assumed covariance."""
        if not isinstance(self._assumed.tracks, TrackNoise):
            return [one / self._assumed.tracks for one in values]
        depth = seen_from(poses, points)[:, :, 2]
        covariance = of_full_rank(self._assumed.tracks.covariance(depth[:, :1] / depth))
        there = np.repeat(pieces.there, 2, axis=1)
        covariance = np.where(there[:, :, None] & there[:, None, :], covariance, np.eye(2 * CLONES))
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        return [np.einsum("tij,tj...->ti...", whiten, one) for one in values]

    def _update(self, residual: Array, rows: Array) -> None:
        """Use whitened residuals (n, m) with derivatives (n, m, p) by what follows the inertial state."""
        residual, rows = residual.ravel(), rows.reshape(-1, rows.shape[2])
        if not len(residual):
            return
        if len(rows) > rows.shape[1]:
            reduced = np.linalg.qr(np.column_stack([rows, residual]), mode="r")
            rows, residual = reduced[:, :-1], reduced[:, -1]
        own = slice(_INERTIAL, _INERTIAL + rows.shape[1])
        crossed = rows @ self._covariance[own]
        root = np.linalg.cholesky(crossed[:, own] @ rows.T + np.eye(len(residual)))
        told = solve_triangular(root, np.column_stack([crossed, residual]), lower=True)
        gain, residual = told[:, :-1].T, told[:, -1]
        self._covariance = self._covariance - gain @ gain.T
        self._correct(gain @ residual)

    def _correct(self, move: Array) -> None:
        self._rotation = self._rotation @ _turns(move[:3])
        self._position, self._velocity = self._position + move[3:6], self._velocity + move[6:9]
        self._gyro_bias = self._gyro_bias + move[9:12]
        self._accelerometer_bias = self._accelerometer_bias + move[12:15]
        own = move[_INERTIAL : self._end].reshape(-1, 6)
        self._clones = self._clones.copy()
        self._clones[:, :3, :3] @= _turns(own[:, :3])
        self._clones[:, :3, 3] += own[:, 3:]
        self._known = replace(self._known, values=self._known.values + move[self._end :].reshape(-1, 3))


def _each(pose: Array, count: int) -> Array:
    """(count, 1, 4, 4): a pose that sees each of so many points."""
    return np.tile(pose, (count, 1, 1, 1))


def _told_apart(
    residual: Array, by_clones: Array, by_point: Array
) -> tuple[tuple[Array, Array, Array], tuple[Array, Array]]:
    """Residuals and derivatives in the three directions that tell points (n, 3, ...), and in the others (n, m, ...)."""
    turned, root = np.linalg.qr(by_point, mode="complete")
    turned = np.swapaxes(turned, 1, 2)
    residual, by_clones = (turned @ residual[:, :, None])[:, :, 0], turned @ by_clones
    return (residual[:, :3], by_clones[:, :3], root[:, :3]), (residual[:, 3:], by_clones[:, 3:])


def _turns(rotvecs: Array) -> Array:
    return np.asarray(Rotation.from_rotvec(rotvecs).as_matrix())


def _steps(turns: Array, halfway: Array, forces: Array, interval_s: float) -> Array:
    """(n, 15, 15): what errors of the inertial state become from each reading to the next."""
    tilted = -halfway @ cross_matrices(forces)
    steps = np.tile(np.eye(_INERTIAL), (len(turns), 1, 1))
    steps[:, :3, :3], steps[:, :3, 9:12] = np.swapaxes(turns, 1, 2), -interval_s * np.eye(3)
    steps[:, 6:9, :3], steps[:, 6:9, 12:15] = interval_s * tilted, -interval_s * halfway
    steps[:, 3:6, 6:9], steps[:, 3:6, :3] = interval_s * np.eye(3), interval_s**2 / 2.0 * tilted
    steps[:, 3:6, 12:15] = -(interval_s**2) / 2.0 * halfway
    return steps
