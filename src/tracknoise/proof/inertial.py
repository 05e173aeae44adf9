"""Longer simulated sequences with an inertial sensor, whose readings are made from the true motion."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.noise_models.linear_window import PointTracks, simulated_tracks
from tracknoise.proof.problem import Problem
from tracknoise.proof.simulation import PlantedNoise, noisy

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
    """A camera that moves sideways, sways and turns, at 20 frames and 200 readings per second.

    Parameters
    ----------
    planted
        Noise of the tracks.
    scene
        Name of the scene.
    n_frames, per_frame
        Frames, and tracks that begin in each.
    noise
        Of the readings.
    seed
        Of points and noise.
    """
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
