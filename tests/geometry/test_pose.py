import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import polar

from tracknoise.geometry.pose import first_visits, from_quaternion, invert, nearest_rigid, transform


def random_poses(count: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return from_quaternion(rng.normal(size=(count, 3)), rng.normal(size=(count, 4)))


def test_a_quarter_turn_about_z_by_hand():
    """The scalar is last: (0, 0, sin 45, cos 45) turns x into y."""
    half = np.sqrt(0.5)
    pose = from_quaternion(np.array([[1.0, 2.0, 3.0]]), np.array([[0.0, 0.0, half, half]]))[0]
    np.testing.assert_allclose(transform(pose, np.array([[1.0, 0.0, 0.0]])), [[1.0, 3.0, 3.0]], atol=1e-15)


def test_quaternions_are_normalised():
    xyzw = np.array([[0.1, -0.2, 0.3, 0.9]])
    zero = np.zeros((1, 3))
    np.testing.assert_allclose(from_quaternion(zero, xyzw), from_quaternion(zero, 7 * xyzw), atol=1e-15)


def test_a_quaternion_of_norm_zero_is_refused():
    with pytest.raises(ValueError, match="zero norm"):
        from_quaternion(np.zeros((1, 3)), np.zeros((1, 4)))


def test_invert_is_the_inverse_matrix():
    poses = random_poses(20)
    np.testing.assert_allclose(invert(poses), np.linalg.inv(poses), atol=1e-12)
    np.testing.assert_allclose(invert(poses[3]) @ poses[3], np.eye(4), atol=1e-14)


def test_transform_by_one_pose_or_one_each():
    poses, points = random_poses(5), np.random.default_rng(1).normal(size=(5, 3))
    homogeneous = np.concatenate([points, np.ones((5, 1))], axis=1)
    np.testing.assert_allclose(transform(poses[2], points), (homogeneous @ poses[2].T)[:, :3], atol=1e-14)
    each = np.stack([(pose @ point)[:3] for pose, point in zip(poses, homogeneous, strict=True)])
    np.testing.assert_allclose(transform(poses, points), each, atol=1e-14)


@given(st.integers(0, 2**32 - 1))
def test_going_there_and_back_changes_nothing(seed):
    pose = random_poses(1, seed)[0]
    points = np.random.default_rng(seed).normal(scale=10.0, size=(7, 3))
    np.testing.assert_allclose(transform(invert(pose), transform(pose, points)), points, atol=1e-12)


def test_nearest_rigid_is_the_orthogonal_factor_of_the_polar_decomposition():
    poses = random_poses(10)
    bent = poses.copy()
    bent[:, :3, :3] += np.random.default_rng(2).normal(scale=0.01, size=(10, 3, 3))
    rigid, correction = nearest_rigid(bent)
    for index in range(10):
        np.testing.assert_allclose(rigid[index, :3, :3], polar(bent[index, :3, :3])[0], atol=1e-12)
    np.testing.assert_allclose(correction, np.abs(rigid - bent).max(axis=(1, 2)), atol=1e-15)
    np.testing.assert_array_equal(rigid[:, :3, 3], poses[:, :3, 3])


def test_nearest_rigid_leaves_exact_poses_and_never_reflects():
    poses = random_poses(10)
    rigid, correction = nearest_rigid(poses)
    np.testing.assert_allclose(rigid, poses, atol=1e-14)
    assert correction.max() < 1e-14
    mirrored = poses @ np.diag([1.0, 1.0, -1.0, 1.0])
    assert np.linalg.det(nearest_rigid(mirrored)[0][:, :3, :3]).min() > 0.99


def test_no_poses():
    none = np.empty((0, 4, 4))
    assert from_quaternion(np.empty((0, 3)), np.empty((0, 4))).shape == (0, 4, 4)
    assert nearest_rigid(none)[0].shape == (0, 4, 4)
    assert nearest_rigid(none)[1].shape == (0,)
    assert transform(np.eye(4), np.empty((0, 3))).shape == (0, 3)
    assert transform(none, np.empty((0, 3))).shape == (0, 3)


def test_a_recording_that_repeats_itself_visits_poses_again() -> None:
    """A camera that stands still visits nothing again, nor does one whose pose is unknown."""
    at = np.array([0, 0, 1, 2, 1, 0, 0, 3, np.nan, np.nan])
    poses = np.tile(np.eye(4), (len(at), 1, 1))
    poses[:, 0, 3] = at
    poses[5, 1, 3] = -0.0
    assert first_visits(poses).tolist() == [0, 1, 2, 3, 2, 0, 0, 7, 8, 9]
    assert first_visits(np.tile(np.eye(4), (3, 1, 1))).tolist() == [0, 1, 2]
    assert first_visits(np.empty((0, 4, 4))).tolist() == []
