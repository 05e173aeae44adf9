import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracknoise.trackers.description import describe
from tracknoise.trackers.detection import Detection
from tracknoise.trackers.matching import mutual_nearest


def by_opencv(query: np.ndarray, train: np.ndarray) -> list[tuple[int, int]]:
    matches = cv2.BFMatcher(cv2.NORM_L2, crossCheck=True).match(query, train)
    return sorted((match.queryIdx, match.trainIdx) for match in matches)


def ours(query: np.ndarray, train: np.ndarray) -> list[tuple[int, int]]:
    return list(zip(*(rows.tolist() for rows in mutual_nearest(query, train)), strict=True))


@given(st.integers(0, 2**32), st.integers(1, 60), st.integers(1, 60), st.integers(1, 4))
def test_matches_and_ties_are_those_of_bfmatcher(seed, n_query, n_train, levels):
    rng = np.random.default_rng(seed)
    query, train = (rng.integers(0, levels, (n, 8)).astype(np.float32) for n in (n_query, n_train))
    assert ours(query, train) == by_opencv(query, train)


def test_matches_of_sift_descriptors_are_those_of_bfmatcher(sideways):
    query, train = (describe(frame, Detection()).descriptors for frame in sideways[:2])
    matches = ours(query, train)
    assert len(matches) > 100
    assert matches == by_opencv(query, train)
    assert ours(np.repeat(query[:50], 2, axis=0), train) == by_opencv(np.repeat(query[:50], 2, axis=0), train)


def test_products_of_sift_descriptors_are_exact(sideways):
    descriptors = describe(sideways[0], Detection()).descriptors
    assert (descriptors**2).sum(axis=1).max() < 2**22
    exact = descriptors.astype(np.int64) @ descriptors.T.astype(np.int64)
    assert (descriptors @ descriptors.T == exact).all()


@pytest.mark.parametrize(("n_query", "n_train"), [(0, 5), (5, 0), (0, 0)])
def test_nothing_matches_nothing(n_query, n_train):
    rows = mutual_nearest(np.ones((n_query, 128), np.float32), np.ones((n_train, 128), np.float32))
    assert [len(row) for row in rows] == [0, 0]
