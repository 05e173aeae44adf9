"""Readings of the inertial sensor agree with the poses, and their noise is as stated."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.simulation.inertial import (
    GRAVITY,
    RATE_HZ,
    InertialNoise,
    SmoothPath,
    inertial_readings,
)
from tracknoise.simulation.motion import MOTIONS

_FRAMES, _FRAME_RATE_HZ = 201, 20.0
NO_NOISE = InertialNoise(gyro=0.0, accelerometer=0.0, gyro_walk=0.0, accelerometer_walk=0.0)


def path_of(motion: str) -> tuple[np.ndarray, np.ndarray, SmoothPath]:
    """Times and poses of the frames of 10 s, and the path through them."""
    times_s = np.arange(_FRAMES) / _FRAME_RATE_HZ
    poses = MOTIONS[motion](_FRAMES, np.random.default_rng(3))
    return times_s, poses, SmoothPath(times_s, poses)


def integrated(path: SmoothPath, rotation: Rotation, position: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """The last pose, from the first one and the readings of an ideal sensor alone, by the trapezoidal rule."""
    ideal = inertial_readings(path, times_s, np.random.default_rng(0), noise=NO_NOISE)
    velocity, interval_s = path.velocities(times_s[:1])[0], 1.0 / RATE_HZ
    rates = (ideal.gyro[:-1] + ideal.gyro[1:]) / 2.0
    for rate, before, after in zip(rates, ideal.accelerometer[:-1], ideal.accelerometer[1:], strict=True):
        turned = rotation * Rotation.from_rotvec(rate * interval_s)
        start, end = rotation.apply(before) + GRAVITY, turned.apply(after) + GRAVITY
        position = position + velocity * interval_s + (2.0 * start + end) * interval_s**2 / 6.0
        velocity = velocity + (start + end) * interval_s / 2.0
        rotation = turned
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.as_matrix(), position
    return pose


@pytest.mark.parametrize("motion", MOTIONS)
def test_integrated_readings_end_at_the_true_pose_after_10_s(motion: str) -> None:
    times_s, poses, path = path_of(motion)
    read_s = np.arange(round(times_s[-1] * RATE_HZ) + 1) / RATE_HZ
    assert read_s[-1] == times_s[-1] == 10.0
    last = integrated(path, Rotation.from_matrix(poses[0, :3, :3]), poses[0, :3, 3], read_s)
    assert np.linalg.norm(last[:3, 3] - poses[-1, :3, 3]) < 1e-3
    apart = Rotation.from_matrix(last[:3, :3].T @ poses[-1, :3, :3])
    assert np.rad2deg(apart.magnitude()) < 0.01


@pytest.mark.parametrize("motion", MOTIONS)
def test_paths_hold_the_poses_of_frames_and_have_no_jump(motion: str) -> None:
    times_s, poses, path = path_of(motion)
    np.testing.assert_allclose(path.poses(times_s), poses, atol=1e-12)
    inside, short = times_s[1:-1], 1e-7
    for values in (path.rates, path.velocities, lambda at_s: path.forces(at_s, GRAVITY)):
        before, after = values(inside - short), values(inside + short)
        np.testing.assert_allclose(before, after, atol=1e-3)


def test_a_camera_at_rest_reads_gravity_upwards() -> None:
    pose = np.eye(4)
    pose[:3, :3] = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]  # looks north: y down, z forward
    path = SmoothPath(np.arange(3.0), np.tile(pose, (3, 1, 1)))
    still = inertial_readings(path, np.arange(5) / 10.0, np.random.default_rng(0), noise=NO_NOISE)
    np.testing.assert_allclose(still.gyro, 0.0, atol=1e-12)
    np.testing.assert_allclose(still.accelerometer, np.tile([0.0, -9.81, 0.0], (5, 1)), atol=1e-12)


def test_noise_and_walks_have_the_stated_densities() -> None:
    noise = InertialNoise(gyro=0.1, accelerometer=0.2, gyro_walk=0.3, accelerometer_walk=0.4)
    path, times_s = SmoothPath(np.array([0.0, 1.0]), np.tile(np.eye(4), (2, 1, 1))), np.arange(20_001) / RATE_HZ
    read = inertial_readings(path, times_s, np.random.default_rng(1), noise=noise)
    for values, bias, ideal, white, walk in (
        (read.gyro, read.gyro_bias, np.zeros(3), 0.1, 0.3),
        (read.accelerometer, read.accelerometer_bias, -GRAVITY, 0.2, 0.4),
    ):
        assert not bias[0].any()
        assert np.std(values - bias - ideal) == pytest.approx(white * np.sqrt(RATE_HZ), rel=0.02)
        assert np.std(np.diff(bias, axis=0)) == pytest.approx(walk / np.sqrt(RATE_HZ), rel=0.02)
        assert np.abs(np.corrcoef(np.diff(bias, axis=0).T) - np.eye(3)).max() < 0.05


def test_one_frame_has_no_motion() -> None:
    with pytest.raises(ValueError, match="found 1 frame, expected at least 2"):
        SmoothPath(np.zeros(1), np.eye(4)[None])
