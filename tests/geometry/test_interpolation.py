import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from tracknoise.geometry.pose import PosePath, interpolate_poses


def poses(count, seed=0):
    rng = np.random.default_rng(seed)
    made = np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
    made[:, :3, :3] = Rotation.from_rotvec(rng.normal(0.0, 0.8, (count, 3))).as_matrix()
    made[:, :3, 3] = rng.normal(0.0, 5.0, (count, 3))
    return made


def test_positions_are_linear_and_rotations_spherically_linear():
    times = np.array([0.0, 0.1, 0.25, 0.4])
    made = poses(4)
    at = np.random.default_rng(1).uniform(0.0, 0.4, 50)
    found = interpolate_poses(times, made, at, max_gap_s=1.0)
    rotations = Slerp(times, Rotation.from_matrix(made[:, :3, :3]))(at).as_matrix()
    np.testing.assert_allclose(found[:, :3, :3], rotations, atol=1e-14)
    for axis in range(3):
        np.testing.assert_allclose(found[:, axis, 3], np.interp(at, times, made[:, axis, 3]), atol=1e-14)
    np.testing.assert_array_equal(found[:, 3], np.broadcast_to((0.0, 0.0, 0.0, 1.0), (50, 4)))


def test_a_constant_turn_is_met_exactly_through_more_than_half_a_turn():
    times = np.linspace(0.0, 1.0, 11)

    def turn(at):
        return Rotation.from_rotvec(np.outer(at, [0.0, 7.0, 0.0])).as_matrix()

    made = np.broadcast_to(np.eye(4), (11, 4, 4)).copy()
    made[:, :3, :3] = turn(times)
    at = np.linspace(0.0, 1.0, 137)
    np.testing.assert_allclose(interpolate_poses(times, made, at, max_gap_s=0.2)[:, :3, :3], turn(at), atol=1e-13)


def test_times_of_poses_have_these_poses_whatever_the_gap():
    times = np.array([1.0, 2.0, 5.0])
    found = interpolate_poses(times, poses(3), times[[2, 0, 1]], max_gap_s=0.0)
    np.testing.assert_allclose(found, poses(3)[[2, 0, 1]], atol=1e-14)


def test_outside_and_in_long_gaps_there_is_no_pose():
    times = np.array([0.0, 0.1, 0.5, 0.6])
    at = np.array([-1e-9, 0.05, 0.2, 0.55, 0.6 + 1e-9])
    found = interpolate_poses(times, poses(4), at, max_gap_s=0.2)
    assert np.isnan(found).all(axis=(1, 2)).tolist() == [True, False, True, False, True]
    assert np.isfinite(found[[1, 3]]).all()


@pytest.mark.parametrize("missing", [[0], [2], [5], [0, 1, 3, 5], [0, 1, 2, 3, 4, 5]])
def test_missing_poses_are_left_out_as_if_they_were_not_given(missing):
    times, given = np.arange(6.0), poses(6)
    given[missing] = np.nan
    kept = np.setdiff1d(np.arange(6), missing)
    at = np.array([-0.5, 0.0, 0.5, 1.5, 2.0, 2.5, 3.0, 4.0, 4.5, 5.0, 5.5])
    found = interpolate_poses(times, given, at, max_gap_s=1.5)
    np.testing.assert_array_equal(found, interpolate_poses(times[kept], given[kept], at, max_gap_s=1.5))
    exact = np.isin(at, kept)
    np.testing.assert_allclose(found[exact], given[at[exact].astype(int)], atol=1e-14)


@pytest.mark.parametrize("count", [0, 1])
def test_without_two_poses_there_is_nothing_to_interpolate(count):
    found = interpolate_poses(np.zeros(count), poses(count), np.array([-0.1, 0.0, 0.1]), max_gap_s=1.0)
    assert np.isnan(found).all(axis=(1, 2)).tolist() == [True, count == 0, True]


@pytest.mark.parametrize("times", [[0.0, 0.0], [1.0, 0.0], [0.0, np.nan]])
def test_times_must_increase(times):
    with pytest.raises(ValueError, match="increase"):
        interpolate_poses(np.array(times), poses(2), np.zeros(1), max_gap_s=1.0)


def test_a_path_goes_on_beyond_its_ends_and_has_gaps_where_poses_are_missing():
    times = np.arange(4.0)
    made = np.broadcast_to(np.eye(4), (4, 4, 4)).copy()
    made[:, :3, :3] = Rotation.from_rotvec(np.outer(times, [0.0, 0.2, 0.0])).as_matrix()
    made[:, :3, 3] = np.outer(times, [1.0, -2.0, 0.5])
    path = PosePath(times, made)
    found = path.at(np.array([-0.5, 1.25, 3.0, 3.5]))
    np.testing.assert_allclose(found[:, :3, 3], np.outer([-0.5, 1.25, 3.0, 3.5], [1.0, -2.0, 0.5]), atol=1e-12)
    turned = Rotation.from_matrix(found[:, :3, :3]).as_rotvec()
    np.testing.assert_allclose(turned[:, 1], 0.2 * np.array([-0.5, 1.25, 3.0, 3.5]), atol=1e-12)
    gap = made.copy()
    gap[2] = np.nan
    known = np.isfinite(PosePath(times, gap).at(np.array([0.5, 1.0, 1.5, 2.5, 3.0]))).all(axis=(1, 2))
    assert known.tolist() == [True, True, False, False, True]


def test_no_times_have_no_poses():
    poses = np.broadcast_to(np.eye(4), (3, 4, 4))
    assert PosePath(np.arange(3.0), poses).at(np.empty(0)).shape == (0, 4, 4)
    assert np.isnan(interpolate_poses(np.arange(3.0), poses, np.array([-1.0, 9.0]), max_gap_s=2.0)).all()
