"""A multi-state constraint Kalman filter, and longer sequences with an inertial sensor for it.

- Longer simulated sequences with an inertial sensor, whose readings are made from the true motion.

A multi-state constraint Kalman filter: inertial readings, poses of the last frames, tracks used once.

The state is the newest pose, velocity and biases, and a copy of the pose at each of the last frames. When a track ends,
its point is triangulated with the copies, its residuals are whitened by the assumed covariance, the point is projected
out, and what remains updates the filter. A track is used only if it passes a chi-square gate.

A pose errs by (a, b): the true one is (R exp(a), c + b), as in `tracknoise.geometry.projection`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.spatial.transform import Rotation

from benchmarks.planted_windows import noisy
from tracknoise.estimators.linear_window import PointTracks, simulated_tracks
from tracknoise.estimators.proof_windows import Problem, images
from tracknoise.estimators.trial import PlantedNoise
from tracknoise.geometry.projection import cross_matrices, image_derivatives

GRAVITY = np.array([0.0, 9.81, 0.0])
"""In the world, whose y axis points down, m/s^2."""
CLONES = 11
"""Most frames of a track, and most poses that the filter keeps."""
_PER_FRAME = 10
"""Readings between two frames."""
_RATE_HZ = 20.0
_SPEED_M_S, _SWAY_M, _TURN_RAD, _SWAY_HZ = 1.2, 0.08, 0.06, 0.7


@dataclass(frozen=True, slots=True, kw_only=True)
class InertialNoise:
    """Densities of the noise of an inertial sensor; its biases are 0 at first and walk.

    Parameters
    ----------
    gyro, accelerometer
        White noise: rad/s and m/s^2 per sqrt(Hz).
    gyro_walk, accelerometer_walk
        Walk of the biases: rad/s^2 and m/s^3 per sqrt(Hz).
    """

    gyro: float = 2e-4
    accelerometer: float = 2e-3
    gyro_walk: float = 2e-5
    accelerometer_walk: float = 3e-4


@dataclass(frozen=True, slots=True, eq=False)
class InertialProblem:
    """A sequence with tracks and readings.

    Parameters
    ----------
    vision
        Frames, tracks and truth.
    gyro, accelerometer
        (frames - 1, readings, 3) float64: rad/s and m/s^2, in the frame of the camera.
    interval_s
        Time between two readings.
    velocity
        (3,) float64: the true velocity at the first frame, m/s.
    noise
        Of the readings.
    """

    vision: Problem
    gyro: NDArray[np.float64]
    accelerometer: NDArray[np.float64]
    interval_s: float
    velocity: NDArray[np.float64]
    noise: InertialNoise


def inertial_problem(
    planted: PlantedNoise,
    *,
    scene: str = "simulated",
    n_frames: int = 40,
    per_frame: int = 8,
    noise: InertialNoise | None = None,
    seed: int = 0,
) -> InertialProblem:
    """A camera that moves sideways, sways and turns, at 20 frames and 200 readings per second."""
    random = np.random.default_rng((seed, 3))
    phase = random.uniform(0.0, 2.0 * np.pi, 6)
    interval_s = 1.0 / (_RATE_HZ * _PER_FRAME)
    time_s = np.asarray(np.arange((n_frames - 1) * _PER_FRAME + 1) * interval_s, dtype=np.float64)
    poses = _poses(time_s, phase)
    sensor = noise or InertialNoise()
    gyro, accelerometer = _readings(random, time_s, phase, sensor, interval_s)
    frames = poses[::_PER_FRAME]
    vision = noisy(scene, frames, _tracks(frames, per_frame, seed), planted, seed=seed)
    shape = (n_frames - 1, _PER_FRAME, 3)
    velocity = _derivatives(time_s[:1], phase)[0][0]
    return InertialProblem(vision, gyro.reshape(shape), accelerometer.reshape(shape), interval_s, velocity, sensor)


def _angle(time_s: NDArray[np.float64], phase: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3): phases of the sway along x, y, z."""
    return np.asarray(2.0 * np.pi * _SWAY_HZ * time_s[:, None] + phase[:3])


def _poses(time_s: NDArray[np.float64], phase: NDArray[np.float64]) -> NDArray[np.float64]:
    poses = np.tile(np.eye(4), (len(time_s), 1, 1))
    poses[:, :3, 3] = _SWAY_M * np.sin(_angle(time_s, phase))
    poses[:, 0, 3] += _SPEED_M_S * time_s
    turn = _TURN_RAD * np.sin(2.0 * np.pi * _SWAY_HZ * time_s[:, None] + phase[3:])
    poses[:, :3, :3] = Rotation.from_rotvec(turn).as_matrix()
    return poses


def _derivatives(
    time_s: NDArray[np.float64], phase: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Velocities and accelerations, (n, 3)."""
    angle, rate = _angle(time_s, phase), 2.0 * np.pi * _SWAY_HZ
    velocity = _SWAY_M * rate * np.cos(angle)
    velocity[:, 0] += _SPEED_M_S
    return velocity, -_SWAY_M * rate**2 * np.sin(angle)


def _readings(
    random: np.random.Generator,
    time_s: NDArray[np.float64],
    phase: NDArray[np.float64],
    noise: InertialNoise,
    interval_s: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean rates between readings, and accelerations in the middle, (n, 3), with noise and biases."""
    rotation = Rotation.from_matrix(_poses(time_s, phase)[:, :3, :3])
    rate = (rotation[:-1].inv() * rotation[1:]).as_rotvec() / interval_s
    middle = time_s[:-1] + interval_s / 2.0
    halfway = Rotation.from_matrix(_poses(middle, phase)[:, :3, :3])
    acceleration = halfway.inv().apply(_derivatives(middle, phase)[1] - GRAVITY)
    found = []
    for values, white, walk in (
        (rate, noise.gyro, noise.gyro_walk),
        (acceleration, noise.accelerometer, noise.accelerometer_walk),
    ):
        bias = np.cumsum(walk * np.sqrt(interval_s) * random.standard_normal(values.shape), axis=0)
        found.append(values + bias + white / np.sqrt(interval_s) * random.standard_normal(values.shape))
    return found[0], found[1]


def _tracks(poses: NDArray[np.float64], per_frame: int, seed: int) -> list[PointTracks]:
    """Tracks that begin in each frame and end when they leave the image, or after `CLONES` frames."""
    by_length: dict[int, list[PointTracks]] = {}
    for start in range(len(poses) - 2):
        drawn = simulated_tracks(poses[start : start + CLONES], n_tracks=per_frame, seed=len(poses) * seed + start)
        for group in drawn:
            moved = PointTracks(group.frames + start, group.points)
            by_length.setdefault(group.frames.shape[1], []).append(moved)
    return [
        PointTracks(np.concatenate([part.frames for part in parts]), np.concatenate([part.points for part in parts]))
        for _, parts in sorted(by_length.items())
    ]


_INERTIAL = 15
"""Errors of rotation, position, velocity, and biases of gyroscope and accelerometer."""
_TRIANGULATIONS = 5
_START = np.repeat((1e-3, 1e-3, 1e-2, 1e-4, 1e-3), 3)
"""Standard deviations of the first state: rad, m, m/s, rad/s, m/s^2."""


@dataclass(frozen=True, slots=True, eq=False)
class Filtered:
    """The answer of the filter.

    Attributes
    ----------
    poses : (frames, 4, 4) float64
        Each as it was estimated when its frame was the newest.
    nees : (frames - 1,) float64
        Normalised error squared of the newest pose over 6, from the second frame on.
    passed : float
        Share of tracks that passed the gate.
    innovations : float
        Mean of the normalised innovations squared of all tracks over their degrees of freedom.
    """

    poses: NDArray[np.float64]
    nees: NDArray[np.float64]
    passed: float
    innovations: float


@dataclass(frozen=True, slots=True, eq=False)
class _Track:
    frames: NDArray[np.int64]
    uv: NDArray[np.float64]
    point: NDArray[np.float64]
    whiten: NDArray[np.float64]


def run_filter(
    problem: InertialProblem,
    covariances: Sequence[NDArray[np.float64]],
    *,
    gate: float = 1.0,
    level: float = 0.95,
    seed: int = 0,
) -> Filtered:
    """Filter a sequence. Shapes: covariances (tracks, 2 n, 2 n)."""
    work = _Filter(problem, gate=gate, level=level, seed=seed)
    ending = _by_last_frame(problem, covariances)
    work.clone(0)
    poses, nees = [work.pose()], []
    for frame in range(1, len(problem.vision.world_from_camera)):
        work.propagate(problem.gyro[frame - 1], problem.accelerometer[frame - 1])
        work.clone(frame)
        work.update(ending.get(frame, []))
        poses.append(work.pose())
        nees.append(work.nees(problem.vision.world_from_camera[frame]))
    ratios = np.array(work.ratios)
    return Filtered(np.stack(poses), np.array(nees), float(np.mean(work.accepted)), float(ratios.mean()))


def _by_last_frame(problem: InertialProblem, covariances: Sequence[NDArray[np.float64]]) -> dict[int, list[_Track]]:
    found: dict[int, list[_Track]] = {}
    for group, own in zip(problem.vision.groups, covariances, strict=True):
        whiten = np.linalg.inv(np.linalg.cholesky(own))
        for place, frames in enumerate(group.frames):
            track = _Track(frames, group.uv[place], group.points[place], whiten[place])
            found.setdefault(int(frames[-1]), []).append(track)
    return found


class _Filter:
    """The state of the filter, and what it did with tracks."""

    def __init__(self, problem: InertialProblem, *, gate: float, level: float, seed: int) -> None:
        error = _START * np.random.default_rng((seed, 4)).standard_normal(_INERTIAL)
        first = problem.vision.world_from_camera[0]
        self._problem, self._gate, self._level = problem, gate, level
        self._rotation = first[:3, :3] @ Rotation.from_rotvec(error[:3]).as_matrix()
        self._position, self._velocity = first[:3, 3] + error[3:6], problem.velocity + error[6:9]
        self._gyro_bias, self._accelerometer_bias = error[9:12], error[12:15]
        self._clones: dict[int, NDArray[np.float64]] = {}
        self._covariance = np.diag(_START**2)
        self.accepted: list[bool] = []
        self.ratios: list[float] = []

    def pose(self) -> NDArray[np.float64]:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = self._rotation, self._position
        return pose

    def nees(self, true: NDArray[np.float64]) -> float:
        turned = Rotation.from_matrix(self._rotation.T @ true[:3, :3]).as_rotvec()
        error = np.concatenate([turned, true[:3, 3] - self._position])
        return float(error @ np.linalg.solve(self._covariance[:6, :6], error) / 6.0)

    def propagate(self, gyro: NDArray[np.float64], accelerometer: NDArray[np.float64]) -> None:
        """Readings (n, 3) between two frames."""
        interval_s = self._problem.interval_s
        for rate, force in zip(gyro - self._gyro_bias, accelerometer - self._accelerometer_bias, strict=True):
            turn = Rotation.from_rotvec(rate * interval_s).as_matrix()
            halfway = self._rotation @ Rotation.from_rotvec(rate * interval_s / 2.0).as_matrix()
            self._propagate_covariance(turn, halfway, force, interval_s)
            acceleration = halfway @ force + GRAVITY
            self._position = self._position + self._velocity * interval_s + acceleration * interval_s**2 / 2.0
            self._velocity = self._velocity + acceleration * interval_s
            self._rotation = self._rotation @ turn

    def _propagate_covariance(
        self, turn: NDArray[np.float64], halfway: NDArray[np.float64], force: NDArray[np.float64], interval_s: float
    ) -> None:
        tilted = -halfway @ cross_matrices(force[None])[0]
        step = np.eye(_INERTIAL)
        step[:3, :3], step[:3, 9:12] = turn.T, -interval_s * np.eye(3)
        step[6:9, :3], step[6:9, 12:15] = interval_s * tilted, -interval_s * halfway
        step[3:6, 6:9], step[3:6, :3] = interval_s * np.eye(3), interval_s**2 / 2.0 * tilted
        step[3:6, 12:15] = -(interval_s**2) / 2.0 * halfway
        noise = self._problem.noise
        densities = (noise.gyro, 0.0, noise.accelerometer, noise.gyro_walk, noise.accelerometer_walk)
        own, rest = slice(0, _INERTIAL), slice(_INERTIAL, None)
        covariance = self._covariance
        covariance[own, own] = step @ covariance[own, own] @ step.T
        covariance[own, own] += np.diag(np.repeat(np.square(densities), 3)) * interval_s
        covariance[own, rest] = step @ covariance[own, rest]
        covariance[rest, own] = covariance[own, rest].T

    def clone(self, frame: int) -> None:
        """Keep a copy of the newest pose, and drop the oldest one if there are too many."""
        self._covariance = np.block(
            [
                [self._covariance, self._covariance[:, :6]],
                [self._covariance[:6], self._covariance[:6, :6]],
            ]
        )
        self._clones[frame] = self.pose()
        if len(self._clones) > CLONES:
            del self._clones[min(self._clones)]
            kept = np.r_[:_INERTIAL, _INERTIAL + 6 : len(self._covariance)]
            self._covariance = self._covariance[np.ix_(kept, kept)]

    def update(self, tracks: Sequence[_Track]) -> None:
        """Use tracks that end in the newest frame."""
        parts = [part for track in tracks if (part := self._constraint(track)) is not None]
        if not parts:
            return
        residual = np.concatenate([part[0] for part in parts])
        by_state = np.concatenate([part[1] for part in parts])
        crossed = self._covariance @ by_state.T
        gain = np.asarray(np.linalg.solve(by_state @ crossed + np.eye(len(residual)), crossed.T).T, dtype=np.float64)
        kept = np.eye(len(self._covariance)) - gain @ by_state
        self._covariance = kept @ self._covariance @ kept.T + gain @ gain.T
        self._correct(gain @ residual)

    def _constraint(self, track: _Track) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Whitened residuals and derivatives of a track without its point; None if it fails the gate."""
        residual, by_pose, by_point = self._linearised(track, self._triangulated(track))
        span = np.linalg.qr(track.whiten @ by_point, mode="complete")[0][:, 3:]
        left = np.asarray(span.T @ track.whiten, dtype=np.float64)
        reduced, by_state = left @ residual, left @ self._spread(track, by_pose)
        spread = by_state @ self._covariance @ by_state.T + np.eye(len(reduced))
        squared = float(reduced @ np.linalg.solve(spread, reduced))
        passes = squared <= self._gate * float(stats.chi2.ppf(self._level, len(reduced)))
        self.accepted.append(passes)
        self.ratios.append(squared / len(reduced))
        return (reduced, by_state) if passes else None

    def _linearised(
        self, track: _Track, point: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Residuals (2 n,), derivatives by poses (n, 2, 6) and by the point (2 n, 3)."""
        poses = np.stack([self._clones[int(frame)] for frame in track.frames])
        camera, count = self._problem.vision.camera, len(track.frames)
        by_pose, by_point = image_derivatives(camera, poses, np.tile(point, (count, 1)))
        predicted = images(camera, poses, PointTracks(np.arange(count)[None], point[None]))[0]
        return (track.uv - predicted).ravel(), by_pose, by_point.reshape(2 * count, 3)

    def _triangulated(self, track: _Track) -> NDArray[np.float64]:
        """The point of a track from the copies of poses, by Gauss-Newton steps from the true one."""
        point = track.point
        for _ in range(_TRIANGULATIONS):
            residual, _, by_point = self._linearised(track, point)
            step = np.linalg.lstsq(track.whiten @ by_point, track.whiten @ residual)[0]
            point = point + np.asarray(step, dtype=np.float64)
        return point

    def _spread(self, track: _Track, by_pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """(2 n, states): derivatives by the whole state."""
        count = len(track.frames)
        spread = np.zeros((count, 2, len(self._covariance)))
        order = {frame: place for place, frame in enumerate(sorted(self._clones))}
        for row, frame in enumerate(track.frames):
            first = _INERTIAL + 6 * order[int(frame)]
            spread[row, :, first : first + 6] = by_pose[row]
        return spread.reshape(2 * count, -1)

    def _correct(self, move: NDArray[np.float64]) -> None:
        self._rotation = self._rotation @ Rotation.from_rotvec(move[:3]).as_matrix()
        self._position, self._velocity = self._position + move[3:6], self._velocity + move[6:9]
        self._gyro_bias, self._accelerometer_bias = (
            self._gyro_bias + move[9:12],
            self._accelerometer_bias + move[12:15],
        )
        for place, frame in enumerate(sorted(self._clones)):
            own = move[_INERTIAL + 6 * place : _INERTIAL + 6 * place + 6]
            pose = self._clones[frame].copy()
            pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(own[:3]).as_matrix()
            pose[:3, 3] += own[3:]
            self._clones[frame] = pose
