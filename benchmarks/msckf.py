"""A multi-state constraint Kalman filter: inertial readings, poses of the last frames, tracks used once.

The state is the newest pose, velocity and biases, and a copy of the pose at each of the last frames. A track is used
when it ends, or when it has been seen in as many frames as there are copies; its next observations are then another
track. Its point is triangulated with the copies, its residuals are whitened by the assumed noise, the point is
projected out, and what remains updates the filter. A track is used only if it passes a chi-square gate, over its whole
innovation: with the errors of the predicted poses. At most `MOST_TRACKS` are used at a frame, the longest first.

A pose errs by (a, b): the true one is (R exp(a), c + b), as in `tracknoise.geometry.projection`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.spatial.transform import Rotation

from benchmarks.noise.arms import PlantedNoise
from benchmarks.planted_windows import noisy
from tracknoise.estimators.linear_window import PointTracks, of_full_rank, simulated_tracks
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.projection import cross_matrices
from tracknoise.inference.track_noise import TrackNoise
from tracknoise.simulation.inertial import (
    GRAVITY,
    GRAVITY_M_S2,
    RATE_HZ,
    InertialNoise,
    SmoothPath,
    inertial_readings,
)

CLONES = 11
"""Most frames of a track, and most poses that the filter keeps."""
LEAST_FRAMES = 3
"""A track of fewer is not used."""
MOST_TRACKS = 40
"""Most tracks that are used at a frame."""
FRAME_RATE_HZ = 20.0
_PER_FRAME = round(RATE_HZ / FRAME_RATE_HZ)
Assumed = float | TrackNoise
"""The noise that a filter assumes: a standard deviation of all observations, px, or components of whole tracks."""


@dataclass(frozen=True, slots=True, eq=False)
class EndedTracks:
    """Tracks of at most `CLONES` consecutive frames.

    Parameters
    ----------
    first
        (tracks,) integers: first frames.
    length
        (tracks,) integers: how many observations there are.
    uv
        (tracks, CLONES, 2) float64: observed positions, px; 0 after the last.
    used_at
        (tracks,) integers: the frame at which the filter may use them.
    """

    first: NDArray[np.int64]
    length: NDArray[np.int64]
    uv: NDArray[np.float64]
    used_at: NDArray[np.int64]

    def chosen(self, places: NDArray[np.intp] | NDArray[np.bool_]) -> "EndedTracks":
        """Some of them."""
        return EndedTracks(self.first[places], self.length[places], self.uv[places], self.used_at[places])


@dataclass(frozen=True, slots=True, eq=False)
class InertialProblem:
    """A sequence with tracks and inertial readings.

    Parameters
    ----------
    camera
        The camera; without distortion.
    world_from_camera
        (frames, 4, 4) float64: the true poses, 20 per second.
    tracks
        What the filter may use.
    gyro, accelerometer
        (frames - 1, readings, 3) float64: means between two readings, rad/s and m/s^2, along the camera's own axes.
    velocity
        (3,) float64: the true velocity at the first frame, m/s.
    gravity
        (3,) float64: in the world, m/s^2.
    noise
        Of the readings.
    """

    camera: Camera
    world_from_camera: NDArray[np.float64]
    tracks: EndedTracks
    gyro: NDArray[np.float64]
    accelerometer: NDArray[np.float64]
    velocity: NDArray[np.float64]
    gravity: NDArray[np.float64]
    noise: InertialNoise


def with_readings(
    camera: Camera,
    world_from_camera: NDArray[np.float64],
    tracks: EndedTracks,
    *,
    gravity: NDArray[np.float64] = GRAVITY,
    seed: int = 0,
) -> InertialProblem:
    """Tracks, with simulated readings of a sensor on their camera, whose poses are (frames, 4, 4)."""
    noise, count = InertialNoise(), len(world_from_camera)
    path = SmoothPath(np.arange(count) / FRAME_RATE_HZ, world_from_camera)
    read_s = np.arange((count - 1) * _PER_FRAME + 1) / RATE_HZ
    read = inertial_readings(path, read_s, np.random.default_rng((seed, 3)), noise=noise, gravity=gravity)
    gyro, accelerometer = (
        ((values[:-1] + values[1:]) / 2.0).reshape(count - 1, _PER_FRAME, 3)
        for values in (read.gyro, read.accelerometer)
    )
    velocity = path.velocities(read_s[:1])[0]
    return InertialProblem(camera, world_from_camera, tracks, gyro, accelerometer, velocity, gravity, noise)


_DOWN = np.array([0.0, GRAVITY_M_S2, 0.0])
"""Gravity of the planted sequences, in whose world y points down."""
_SPEED_M_S, _SWAY_M, _TURN_RAD, _SWAY_HZ = 1.2, 0.08, 0.06, 0.7


def planted_problem(planted: PlantedNoise, *, n_frames: int = 40, per_frame: int = 8, seed: int = 0) -> InertialProblem:
    """Tracks with planted noise, of a camera that moves sideways, sways and turns."""
    phase = np.random.default_rng((seed, 5)).uniform(0.0, 2.0 * np.pi, 6)
    angle = 2.0 * np.pi * _SWAY_HZ / FRAME_RATE_HZ * np.arange(n_frames)[:, None] + phase
    poses = np.tile(np.eye(4), (n_frames, 1, 1))
    poses[:, :3, 3] = _SWAY_M * np.sin(angle[:, :3])
    poses[:, 0, 3] += _SPEED_M_S / FRAME_RATE_HZ * np.arange(n_frames)
    poses[:, :3, :3] = Rotation.from_rotvec(_TURN_RAD * np.sin(angle[:, 3:])).as_matrix()
    vision = noisy("planted", poses, _planted_tracks(poses, per_frame, seed), planted, seed=seed)
    lengths = [group.frames.shape[1] for group in vision.groups]
    padded = [
        np.pad(group.uv, ((0, 0), (0, CLONES - n), (0, 0))) for group, n in zip(vision.groups, lengths, strict=True)
    ]
    first = np.concatenate([group.frames[:, 0] for group in vision.groups])
    length = np.repeat(lengths, [len(part) for part in padded])
    tracks = EndedTracks(first, length, np.concatenate(padded), first + length - 1)
    return with_readings(vision.camera, poses, tracks, gravity=_DOWN, seed=seed)


def _planted_tracks(poses: NDArray[np.float64], per_frame: int, seed: int) -> list[PointTracks]:
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
_START = np.repeat((1e-3, 1e-3, 2e-3, 1e-4, 1e-3), 3)
"""Standard deviations of the first state: rad, m, m/s, rad/s, m/s^2."""
_REFINEMENTS = 2
_NEAREST_M, _FARTHEST_M, _WORST_CONDITION = 0.1, 60.0, 1e4
"""Points are used at these depths in the first frame of their track, and if its rays determine them so well."""


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
    passed : float
        Share of those that passed the gate.
    innovations : float
        Mean of the normalised innovations squared of all tracks over their degrees of freedom.
    predicted : float
        Mean share of the claimed variance of innovations that errors of the predicted poses have.
    """

    poses: NDArray[np.float64]
    nees: NDArray[np.float64]
    triangulated: float
    passed: float
    innovations: float
    predicted: float


def run_filter(problem: InertialProblem, assumed: Assumed, *, gate: float = 1.0, seed: int = 0) -> Filtered:
    """Filter a sequence. `gate`: factor on the chi-square gate at .95."""
    work = _Filter(problem, assumed, gate=gate, seed=seed)
    work.clone()
    poses, nees = [work.pose()], []
    for frame in range(1, len(problem.world_from_camera)):
        work.propagate(problem.gyro[frame - 1], problem.accelerometer[frame - 1])
        work.clone()
        work.update(_used_at(problem.tracks, frame))
        poses.append(work.pose())
        nees.append(work.nees(problem.world_from_camera[frame]))
    shares = (work.found, work.accepted, work.ratios, work.predicted)
    return Filtered(np.stack(poses), np.array(nees), *(float(np.concatenate(one).mean()) for one in shares))


def _used_at(tracks: EndedTracks, frame: int) -> EndedTracks:
    """Tracks that are used at a frame: at most `MOST_TRACKS`, the longest first."""
    own = np.flatnonzero(tracks.used_at == frame)
    return tracks.chosen(own[np.argsort(-tracks.length[own], kind="stable")[:MOST_TRACKS]])


class _Filter:
    """The state of the filter, and what it did with tracks."""

    def __init__(self, problem: InertialProblem, assumed: Assumed, *, gate: float, seed: int) -> None:
        error = _START * np.random.default_rng((seed, 4)).standard_normal(_INERTIAL)
        first = problem.world_from_camera[0]
        self._problem, self._assumed, self._gate = problem, assumed, gate
        self._rotation = first[:3, :3] @ _turns(error[:3])
        self._position, self._velocity = first[:3, 3] + error[3:6], problem.velocity + error[6:9]
        self._gyro_bias, self._accelerometer_bias = error[9:12], error[12:15]
        self._clones = np.zeros((0, 4, 4))
        self._oldest = 0
        self._covariance = np.diag(_START**2)
        self.found: list[NDArray[np.bool_]] = []
        self.accepted: list[NDArray[np.bool_]] = []
        self.ratios: list[NDArray[np.float64]] = []
        self.predicted: list[NDArray[np.float64]] = []

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
        covariance = self._covariance
        self._covariance = np.block([[covariance, covariance[:, :6]], [covariance[:6], covariance[:6, :6]]])
        self._clones = np.concatenate([self._clones, self.pose()[None]])
        if len(self._clones) > CLONES:
            self._clones, self._oldest = self._clones[1:], self._oldest + 1
            kept = np.r_[:_INERTIAL, _INERTIAL + 6 : len(self._covariance)]
            self._covariance = self._covariance[np.ix_(kept, kept)]

    def update(self, tracks: EndedTracks) -> None:
        """Use tracks that pass the gate."""
        residual, by_clones = self._constraints(tracks)
        if not len(residual):
            return
        reduced = np.linalg.qr(np.column_stack([by_clones, residual]), mode="r")
        by_clones, residual = reduced[:, :-1], reduced[:, -1]
        crossed = self._covariance[:, _INERTIAL:] @ by_clones.T
        spread = by_clones @ crossed[_INERTIAL:] + np.eye(len(residual))
        gain = np.asarray(np.linalg.solve(spread, crossed.T).T, dtype=np.float64)
        kept = np.eye(len(self._covariance))
        kept[:, _INERTIAL:] -= gain @ by_clones
        covariance = kept @ self._covariance @ kept.T + gain @ gain.T
        self._covariance = (covariance + covariance.T) / 2.0  # or rounding errors grow
        self._correct(gain @ residual)

    def _constraints(self, tracks: EndedTracks) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Whitened residuals and derivatives by the copies, of tracks without their points that pass the gate.

        After the last observation of a track, both are 0.
        """
        poses = self._clones[self._places(tracks)]
        points, known = triangulated(self._problem.camera, poses, tracks)
        self.found.append(known)
        tracks, poses, points = tracks.chosen(known), poses[known], points[known]
        count = len(points)
        residual, by_pose, by_point = _linearised(self._problem.camera, poses, points, tracks)
        spread = np.zeros((count, CLONES, 2, len(self._clones), 6))
        spread[np.arange(count)[:, None], np.arange(CLONES), :, self._places(tracks)] = by_pose
        by_clones = spread.reshape(count, 2 * CLONES, 6 * len(self._clones))
        residual, by_clones, by_point = self._whitened(tracks, poses, points, (residual, by_clones, by_point))
        span = np.swapaxes(np.linalg.qr(by_point, mode="complete")[0][:, :, 3:], 1, 2)
        rows, residual = span @ by_clones, (span @ residual[:, :, None])[:, :, 0]
        freedom = 2 * tracks.length - 3
        covariance = rows @ self._covariance[_INERTIAL:, _INERTIAL:] @ np.swapaxes(rows, 1, 2) + np.eye(rows.shape[1])
        squared = np.einsum("ti,ti->t", residual, np.linalg.solve(covariance, residual[:, :, None])[:, :, 0])
        passes = squared <= self._gate * stats.chi2.ppf(0.95, freedom)
        self.accepted.append(passes)
        self.ratios.append(squared / freedom)
        of_poses = np.trace(covariance, axis1=1, axis2=2) - rows.shape[1]
        self.predicted.append(of_poses / (of_poses + freedom))
        return residual[passes].ravel(), rows[passes].reshape(-1, by_clones.shape[2])

    def _places(self, tracks: EndedTracks) -> NDArray[np.int64]:
        """(tracks, CLONES): which copies see them; the newest one after the last observation."""
        return np.minimum(tracks.first[:, None] - self._oldest + np.arange(CLONES), len(self._clones) - 1)

    def _whitened(
        self,
        tracks: EndedTracks,
        poses: NDArray[np.float64],
        points: NDArray[np.float64],
        values: Sequence[NDArray[np.float64]],
    ) -> list[NDArray[np.float64]]:
        """Values (tracks, 2 CLONES, ...), times the inverse root of the assumed covariance."""
        if not isinstance(self._assumed, TrackNoise):
            return [one / self._assumed for one in values]
        depth = _seen(poses, points)[:, :, 2]
        covariance = of_full_rank(self._assumed.covariance(depth[:, :1] / depth))
        there = np.repeat(_there(tracks), 2, axis=1)
        covariance = np.where(there[:, :, None] & there[:, None, :], covariance, np.eye(2 * CLONES))
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        return [np.einsum("tij,tj...->ti...", whiten, one) for one in values]

    def _correct(self, move: NDArray[np.float64]) -> None:
        self._rotation = self._rotation @ _turns(move[:3])
        self._position, self._velocity = self._position + move[3:6], self._velocity + move[6:9]
        self._gyro_bias = self._gyro_bias + move[9:12]
        self._accelerometer_bias = self._accelerometer_bias + move[12:15]
        own = move[_INERTIAL:].reshape(-1, 6)
        self._clones = self._clones.copy()
        self._clones[:, :3, :3] @= _turns(own[:, :3])
        self._clones[:, :3, 3] += own[:, 3:]


def _turns(rotvecs: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(Rotation.from_rotvec(rotvecs).as_matrix())


def _steps(
    turns: NDArray[np.float64], halfway: NDArray[np.float64], forces: NDArray[np.float64], interval_s: float
) -> NDArray[np.float64]:
    """(n, 15, 15): what errors of the inertial state become from each reading to the next."""
    tilted = -halfway @ cross_matrices(forces)
    steps = np.tile(np.eye(_INERTIAL), (len(turns), 1, 1))
    steps[:, :3, :3], steps[:, :3, 9:12] = np.swapaxes(turns, 1, 2), -interval_s * np.eye(3)
    steps[:, 6:9, :3], steps[:, 6:9, 12:15] = interval_s * tilted, -interval_s * halfway
    steps[:, 3:6, 6:9], steps[:, 3:6, :3] = interval_s * np.eye(3), interval_s**2 / 2.0 * tilted
    steps[:, 3:6, 12:15] = -(interval_s**2) / 2.0 * halfway
    return steps


def _there(tracks: EndedTracks) -> NDArray[np.bool_]:
    """(tracks, CLONES): whether there is an observation."""
    return np.asarray(np.arange(CLONES) < tracks.length[:, None])


def _seen(poses: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(tracks, n, 3): points (tracks, 3) in the cameras (tracks, n, 4, 4) that see them."""
    return np.asarray(np.einsum("tnji,tnj->tni", poses[:, :, :3, :3], points[:, None] - poses[:, :, :3, 3]))


def _linearised(
    camera: Camera, poses: NDArray[np.float64], points: NDArray[np.float64], tracks: EndedTracks
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Residuals (tracks, 2 n), derivatives by poses (tracks, n, 2, 6) and by the point (tracks, 2 n, 3)."""
    count, length = poses.shape[:2]
    weight = _there(tracks)[:, :, None, None].astype(np.float64)
    seen = _seen(poses, points)
    uv, projected = _imaged(camera, seen)
    projected *= weight
    by_point = projected @ np.swapaxes(poses[:, :, :3, :3], 2, 3)
    turned = projected @ cross_matrices(seen.reshape(-1, 3)).reshape(count, length, 3, 3)
    by_pose = np.concatenate([turned, -by_point], axis=3)
    residual = weight[:, :, 0] * (tracks.uv - uv)
    return residual.reshape(count, 2 * length), by_pose, by_point.reshape(count, 2 * length, 3)


def _imaged(camera: Camera, seen: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Images (tracks, n, 2) of points in the frame of the camera (tracks, n, 3), and derivatives (tracks, n, 2, 3)."""
    focal, centre = np.array([camera.fx, camera.fy]), (camera.cx, camera.cy)
    slope = seen[:, :, :2] / seen[:, :, 2:]
    derivative = np.zeros((*seen.shape[:2], 2, 3))
    derivative[:, :, (0, 1), (0, 1)] = focal / seen[:, :, 2:]
    derivative[:, :, :, 2] = -focal * slope / seen[:, :, 2:]
    return focal * slope + centre, derivative


def triangulated(
    camera: Camera, poses: NDArray[np.float64], tracks: EndedTracks
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Points (tracks, 3) nearest to the rays of tracks, refined in the image, and which of them are usable (tracks,).

    Shapes: poses (tracks, CLONES, 4, 4). Refined are position and inverse depth in the first frame.
    """
    there = _there(tracks)
    count, length = there.shape
    rays = camera.unproject(tracks.uv.reshape(-1, 2), np.ones(count * length)).reshape(count, length, 3)
    rays = np.einsum("tnij,tnj->tni", poses[:, :, :3, :3], rays / np.linalg.norm(rays, axis=2, keepdims=True))
    across = there[:, :, None, None] * (np.eye(3) - rays[:, :, :, None] * rays[:, :, None, :])
    system, centres = across.sum(axis=1), poses[:, :, :3, 3]
    usable = np.linalg.cond(system) < _WORST_CONDITION
    system[~usable] = np.eye(3)
    points = np.linalg.solve(system, np.einsum("tnij,tnj->ti", across, centres)[:, :, None])[:, :, 0]
    first, centre = poses[:, 0, :3, :3], poses[:, 0, :3, 3]
    for _ in range(_REFINEMENTS):
        usable &= _within(_seen(poses, points))
        points[~usable] = (centre + first[:, :, 2])[~usable]
        local = np.einsum("tji,tj->ti", first, points - centre)
        depth = local[:, 2:]
        by_inverse = np.concatenate([first[:, :, :2], -(first @ local[:, :, None])], axis=2) * depth[:, :, None]
        residual, _, by_point = _linearised(camera, poses, points, tracks)
        derivative = by_point @ by_inverse
        derivative[~usable], residual[~usable] = np.eye(2 * length, 3), 0.0
        transposed = np.swapaxes(derivative, 1, 2)
        step = np.linalg.solve(transposed @ derivative, transposed @ residual[:, :, None])[:, :, 0]
        moved = np.column_stack([local[:, :2], np.ones(count)]) / depth + step
        usable &= moved[:, 2] > 1.0 / _FARTHEST_M
        inverse = np.where(usable, moved[:, 2], 1.0)[:, None]
        points = centre + np.einsum("tij,tj->ti", first, np.column_stack([moved[:, :2], np.ones(count)]) / inverse)
    return points, np.asarray(usable & _within(_seen(poses, points)))


def _within(seen: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether points (tracks, n, 3) are before all cameras, and at a usable depth in the first."""
    ahead = (seen[:, :, 2] > _NEAREST_M).all(axis=1)
    return np.asarray(ahead & (seen[:, 0, 2] < _FARTHEST_M))
