"""A sequence with tracks and simulated inertial readings: with real tracks, or with planted noise."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.filter_tracks import CLONES, Tracks
from benchmarks.noise.arms import PlantedNoise
from benchmarks.planted_windows import noisy
from tracknoise.estimators.linear_window import PointTracks, simulated_tracks
from tracknoise.geometry.cameras import Camera
from tracknoise.simulation.inertial import (
    GRAVITY,
    GRAVITY_M_S2,
    RATE_HZ,
    InertialNoise,
    SmoothPath,
    inertial_readings,
)

FRAME_RATE_HZ = 20.0
_PER_FRAME = round(RATE_HZ / FRAME_RATE_HZ)


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
        As they were observed.
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
    tracks: Tracks
    gyro: NDArray[np.float64]
    accelerometer: NDArray[np.float64]
    velocity: NDArray[np.float64]
    gravity: NDArray[np.float64]
    noise: InertialNoise


def with_readings(
    camera: Camera,
    world_from_camera: NDArray[np.float64],
    tracks: Tracks,
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


def planted_problem(
    planted: PlantedNoise, *, n_frames: int = 40, per_frame: int = 8, lifetime: int = CLONES, seed: int = 0
) -> InertialProblem:
    """Tracks with planted noise, of at most so many frames, of a camera that moves sideways, sways and turns."""
    phase = np.random.default_rng((seed, 5)).uniform(0.0, 2.0 * np.pi, 6)
    angle = 2.0 * np.pi * _SWAY_HZ / FRAME_RATE_HZ * np.arange(n_frames)[:, None] + phase
    poses = np.tile(np.eye(4), (n_frames, 1, 1))
    poses[:, :3, 3] = _SWAY_M * np.sin(angle[:, :3])
    poses[:, 0, 3] += _SPEED_M_S / FRAME_RATE_HZ * np.arange(n_frames)
    poses[:, :3, :3] = Rotation.from_rotvec(_TURN_RAD * np.sin(angle[:, 3:])).as_matrix()
    vision = noisy("planted", poses, _planted_tracks(poses, per_frame, lifetime, seed), planted, seed=seed)
    first = np.concatenate([group.frames[:, 0] for group in vision.groups])
    length = np.concatenate([np.full(len(group.uv), group.uv.shape[1]) for group in vision.groups])
    uv = np.concatenate([group.uv.reshape(-1, 2) for group in vision.groups])
    tracks = Tracks(first, length, np.zeros_like(first), uv, np.ones(len(uv), dtype=np.bool_))
    return with_readings(vision.camera, poses, tracks, gravity=_DOWN, seed=seed)


def _planted_tracks(poses: NDArray[np.float64], per_frame: int, lifetime: int, seed: int) -> list[PointTracks]:
    """Tracks that begin in each frame and end when they leave the image, or at the end of their life."""
    by_length: dict[int, list[PointTracks]] = {}
    for start in range(len(poses) - 2):
        drawn = simulated_tracks(poses[start : start + lifetime], n_tracks=per_frame, seed=len(poses) * seed + start)
        for group in drawn:
            moved = PointTracks(group.frames + start, group.points)
            by_length.setdefault(group.frames.shape[1], []).append(moved)
    return [
        PointTracks(np.concatenate([part.frames for part in parts]), np.concatenate([part.points for part in parts]))
        for _, parts in sorted(by_length.items())
    ]
