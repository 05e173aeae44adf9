import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tracknoise.geometry.pose import nearest

TIMES = st.lists(st.integers(0, 400), max_size=25, unique=True).map(lambda ms: np.sort(ms) / 1000.0)


def test_the_nearest_within_the_gap_is_taken():
    depths = np.array([0.99, 1.03, 1.10])
    assert nearest(np.array([1.0, 1.033, 1.066, 1.1]), depths, max_gap_s=0.02).tolist() == [0, 1, -1, 2]


def test_one_depth_can_be_that_of_several_images():
    assert nearest(np.array([0.0, 0.01, 0.02]), np.array([0.011]), max_gap_s=0.01).tolist() == [-1, 0, 0]


def test_of_two_at_the_same_distance_the_earlier_is_taken():
    assert nearest(np.array([1.0]), np.array([0.5, 1.5]), max_gap_s=1.0).tolist() == [0]


def test_without_others_there_is_none():
    assert nearest(np.array([1.0, 2.0]), np.empty(0), max_gap_s=9.0).tolist() == [-1, -1]


@given(TIMES, TIMES, st.integers(0, 100))
def test_no_other_is_nearer_and_all_near_ones_are_found(times, others, gap_ms):
    gap_s = gap_ms / 1000.0 + 1e-9
    found = nearest(times, others, max_gap_s=gap_s)
    assert found.shape == times.shape
    for time, index in zip(times, found, strict=True):
        distances = np.abs(others - time)
        if index < 0:
            assert not np.any(distances <= gap_s)
        else:
            assert distances[index] == distances.min() <= gap_s
