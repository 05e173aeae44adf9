from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert, transform
from tracknoise.simulation.motion import (
    MOTIONS,
    Motion,
    arvr,
    fixating,
    forward,
    linear,
    linear_straight,
    looking,
    sideways,
    sideways_left,
)

FRAMES = 150


def poses(motion: Motion, frames: int = FRAMES, seed: int = 0) -> np.ndarray:
    return motion(frames, np.random.default_rng(seed))


def rotation_deg(path: np.ndarray) -> np.ndarray:
    """Angle between each pose and the next."""
    relative = np.swapaxes(path[:-1, :3, :3], 1, 2) @ path[1:, :3, :3]
    return np.rad2deg(np.arccos(np.clip((np.trace(relative, axis1=1, axis2=2) - 1) / 2, -1, 1)))


@pytest.mark.parametrize("name", MOTIONS)
def test_paths_are_rigid_and_as_long_as_asked_for(name: str) -> None:
    for frames in (1, 2, 71, 300):
        path = poses(MOTIONS[name], frames)
        assert path.shape == (frames, 4, 4)
        rotation = path[:, :3, :3]
        np.testing.assert_allclose(
            rotation @ np.swapaxes(rotation, 1, 2), np.broadcast_to(np.eye(3), rotation.shape), atol=1e-12
        )
        np.testing.assert_allclose(np.linalg.det(rotation), 1.0)
        np.testing.assert_array_equal(path[:, 3], np.broadcast_to([0.0, 0.0, 0.0, 1.0], (frames, 4)))


@pytest.mark.parametrize("name", MOTIONS)
def test_a_longer_path_begins_like_a_shorter_one(name: str) -> None:
    np.testing.assert_allclose(poses(MOTIONS[name], 200)[:60], poses(MOTIONS[name], 60), atol=1e-12)


@pytest.mark.parametrize("name", MOTIONS)
def test_the_generator_decides(name: str) -> None:
    np.testing.assert_array_equal(poses(MOTIONS[name], seed=1), poses(MOTIONS[name], seed=1))
    assert np.abs(poses(MOTIONS[name], seed=1) - poses(MOTIONS[name], seed=2)).max() > 0.01


@pytest.mark.parametrize("name", MOTIONS)
def test_the_image_moves_by_a_few_pixels_a_frame(name: str) -> None:
    """At 640x480 and 60 degrees, points 4 to 16 m ahead; none moves by 12 px or more."""
    camera = Camera(640, 480, 554.0, 554.0, 319.5, 239.5)
    uv = np.stack(np.meshgrid(np.arange(0.0, 640.0, 40.0), np.arange(0.0, 480.0, 40.0)), axis=-1).reshape(-1, 2)
    ahead = camera.unproject(uv, np.linspace(4.0, 16.0, len(uv)))
    path = poses(MOTIONS[name])
    moved = [camera.project(transform(invert(b) @ a, ahead)) - uv for a, b in pairwise(path)]
    speed = np.linalg.norm(moved, axis=-1)
    assert 0.5 < np.median(speed) < 5.0
    assert speed.max() < 12.0


def test_looking_keeps_the_image_upright() -> None:
    pose = looking(np.zeros((1, 3)), np.array([[1.0, 0.0, -0.2]]))[0]  # east, and down a little
    right, down, ahead = pose[:3, :3].T
    np.testing.assert_allclose(right, [0.0, -1.0, 0.0], atol=1e-15)  # south is to the right of one who looks east
    assert down[2] < -0.9
    np.testing.assert_allclose(ahead, np.array([1.0, 0.0, -0.2]) / np.hypot(1.0, 0.2))


def test_sideways_is_pure_translation_along_the_image() -> None:
    path = poses(sideways)
    steps = np.einsum("nji,nj->ni", path[:-1, :3, :3], np.diff(path[:, :3, 3], axis=0))
    np.testing.assert_array_equal(path[:, :3, :3], np.broadcast_to(path[0, :3, :3], (FRAMES, 3, 3)))
    assert np.ptp(steps[:, 0]) < 1e-12
    assert steps[0, 0] > 0.02
    np.testing.assert_allclose(steps[:, 1:], 0.0, atol=1e-12)


def test_sideways_left_goes_the_other_way() -> None:
    right, left = poses(sideways), poses(sideways_left)
    np.testing.assert_allclose(np.diff(left[:, 0, 3]), -np.diff(right[:, 0, 3]), atol=1e-12)
    np.testing.assert_array_equal(left[:, :3, :3], right[:, :3, :3])


def test_linear_flies_right_at_constant_speed_for_more_than_300_frames_and_then_back() -> None:
    for seed in range(5):
        x = poses(linear, 1000, seed)[:, 0, 3]
        assert np.all(np.diff(x[:500]) > 0.03)
        assert np.ptp(np.diff(x[:500])) < 1e-12
        assert np.abs(x).max() <= 12.0
        assert np.diff(x).min() < -0.03


def test_linear_sways_a_little_and_slowly() -> None:
    path = poses(linear, 400)
    north = looking(np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]))[0, :3, :3]
    sway_deg = np.rad2deg(Rotation.from_matrix(path[:, :3, :3] @ north.T).as_rotvec())
    reach_deg, reach_m = np.ptp(sway_deg, axis=0), np.ptp(path[:, 1:3, 3], axis=0)
    assert np.all((reach_deg > 0.5) & (reach_deg < 1.6))
    assert np.all((reach_m > 0.02) & (reach_m < 0.1))
    assert rotation_deg(path).max() < 0.1


def test_fixating_keeps_its_target_in_the_middle_at_a_constant_distance() -> None:
    path = poses(fixating)
    target = transform(invert(path), np.broadcast_to([0.0, 0.0, 1.0], (FRAMES, 3)))
    np.testing.assert_allclose(target[:, :2], 0.0, atol=1e-12)
    assert np.ptp(target[:, 2]) < 1e-12
    assert np.ptp(rotation_deg(path)) < 1e-4


def test_forward_goes_where_it_looks() -> None:
    path = poses(forward)
    steps = np.diff(path[:, :3, 3], axis=0)
    np.testing.assert_allclose(steps, np.linalg.norm(steps, axis=1)[:, None] * path[:-1, :3, 2], atol=1e-12)
    assert np.all(np.linalg.norm(steps, axis=1) > 0.05)


def test_paths_that_end_turn_back_instead() -> None:
    path = poses(sideways, 2000)
    assert np.abs(path[:, 0, 3]).max() <= 3.5
    assert (np.diff(np.sign(np.diff(path[:, 0, 3]))) != 0).sum() >= 6


def test_arvr_turns_much_moves_little_and_rests_at_waypoints() -> None:
    path = poses(arvr, 211)
    assert np.linalg.norm(np.ptp(path[:, :3, 3], axis=0)) < 2.0
    turn, step = rotation_deg(path), np.linalg.norm(np.diff(path[:, :3, 3], axis=0), axis=1)
    for waypoint in (70, 140):
        assert turn[waypoint] < 0.1 * turn.max()
        assert step[waypoint] < 0.1 * step.max()
    assert turn.sum() > 30.0


def test_arvr_eases_by_the_haversine_and_turns_about_one_axis() -> None:
    path = poses(arvr, 71)
    start, end = path[0, :3, 3], path[70, :3, 3]
    way = np.sin(np.pi * np.arange(71) / 140) ** 2
    np.testing.assert_allclose(path[:, :3, 3], start + way[:, None] * (end - start), atol=1e-12)
    relative = path[0, :3, :3].T @ path[1:, :3, :3]
    axes = np.stack(
        [
            relative[:, 2, 1] - relative[:, 1, 2],
            relative[:, 0, 2] - relative[:, 2, 0],
            relative[:, 1, 0] - relative[:, 0, 1],
        ],
        axis=-1,
    )
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    np.testing.assert_allclose(axes, np.broadcast_to(axes[-1], axes.shape), atol=1e-6)


def test_linear_straight_is_the_same_flight_without_rotation() -> None:
    straight, swaying = poses(linear_straight, 400), poses(linear, 400)
    np.testing.assert_array_equal(straight[:, 0, 3], swaying[:, 0, 3])
    assert rotation_deg(straight).max() < 1e-6
    assert np.ptp(straight[:, 1:3, 3], axis=0).max() == 0.0
