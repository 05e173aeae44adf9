import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tracknoise.sequences.timed.association import nearest

TIMES = st.lists(st.integers(0, 400), max_size=25, unique=True).map(lambda ms: np.sort(ms) / 1000.0)


def test_the_nearest_within_the_gap_is_taken():
    depths = np.array([0.99, 1.03, 1.10])
    assert nearest(np.array([1.0, 1.033, 1.066, 1.1]), depths, max_gap_s=0.02).tolist() == [0, 1, -1, 2]


def test_no_other_is_used_twice():
    assert nearest(np.array([0.0, 0.01, 0.02]), np.array([0.011]), max_gap_s=0.02).tolist() == [-1, 0, -1]


def test_of_two_at_the_same_distance_the_earlier_is_taken():
    assert nearest(np.array([1.0]), np.array([0.5, 1.5]), max_gap_s=1.0).tolist() == [0]
    assert nearest(np.array([0.5, 1.5]), np.array([1.0]), max_gap_s=1.0).tolist() == [0, -1]


@given(TIMES, TIMES, st.integers(0, 100))
def test_pairs_are_mutually_nearest_and_close(times, others, gap_ms):
    found = nearest(times, others, max_gap_s=gap_ms / 1000.0 + 1e-9)
    assert found.shape == times.shape
    used = found[found >= 0]
    assert len(set(used.tolist())) == len(used)
    for time, index in zip(times, found, strict=True):
        if index >= 0:
            distance = abs(others[index] - time)
            assert distance <= gap_ms / 1000.0 + 1e-9
            assert distance <= np.abs(others - time).min() + 1e-12
            assert distance <= np.abs(times - others[index]).min() + 1e-12
