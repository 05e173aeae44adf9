import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracknoise.trackers.correspondence import describe
from tracknoise.trackers.detection import Detection
from tracknoise.trackers.matching import mutual_nearest


def by_opencv(query: np.ndarray, train: np.ndarray) -> list[tuple[int, int]]:
    matches = cv2.BFMatcher(cv2.NORM_L2, crossCheck=True).match(query, train)
    return sorted((match.queryIdx, match.trainIdx) for match in matches)


def ours(query: np.ndarray, train: np.ndarray) -> list[tuple[int, int]]:
    matches = mutual_nearest(query, train)
    return list(zip(matches.query_rows.tolist(), matches.train_rows.tolist(), strict=True))


@given(st.integers(0, 2**32), st.integers(1, 60), st.integers(1, 60), st.integers(1, 4))
def test_matches_and_ties_are_those_of_bfmatcher(seed, n_query, n_train, levels):
    rng = np.random.default_rng(seed)
    query, train = (rng.integers(0, levels, (n, 8)).astype(np.float32) for n in (n_query, n_train))
    assert ours(query, train) == by_opencv(query, train)


@given(st.integers(0, 2**32), st.integers(1, 200), st.integers(1, 40), st.floats(0.0, 1.0))
def test_pairs_that_are_not_allowed_are_as_if_they_were_infinitely_far(seed, n_query, n_train, share):
    rng = np.random.default_rng(seed)
    query, train = (rng.integers(0, 9, (n, 6)).astype(np.float32) for n in (n_query, n_train))
    allowed = rng.random((n_query, n_train)) < share
    distance = np.where(allowed, np.linalg.norm(query[:, None] - train, axis=2), np.inf)
    matches = mutual_nearest(query, train, allowed)
    mutual = (distance.argmin(axis=0)[distance.argmin(axis=1)] == np.arange(n_query)) & allowed.any(axis=1)
    assert matches.query_rows.tolist() == np.flatnonzero(mutual).tolist()
    assert matches.train_rows.tolist() == distance.argmin(axis=1)[mutual].tolist()


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
    matches = mutual_nearest(np.ones((n_query, 128), np.float32), np.ones((n_train, 128), np.float32))
    assert {len(rows) for rows in (matches.query_rows, matches.train_rows, *matches.quality.values())} == {0}


def test_distances_are_euclidean_and_ratios_are_relative_to_the_second_nearest():
    query = np.array([[3, 4], [100, 0]], np.float32)
    matches = mutual_nearest(query, np.array([[0, 0], [100, 0], [3, 14]], np.float32))
    assert matches.train_rows.tolist() == [0, 1]
    assert matches.quality["descriptor_distance"].tolist() == [5.0, 0.0]
    assert matches.quality["descriptor_ratio"].tolist() == [0.5, 0.0]
    alone = mutual_nearest(query[:1], query[:1])
    assert alone.quality["descriptor_distance"].tolist() == [0.0]
    assert np.isnan(alone.quality["descriptor_ratio"]).all()
    twins = mutual_nearest(query[:1], query[[0, 0]])
    assert twins.quality["descriptor_ratio"].tolist() == [1.0]


def test_distances_of_sift_descriptors_are_those_of_opencvs_two_nearest(sideways):
    query, train = (describe(frame, Detection()).descriptors for frame in sideways[:2])
    matches = mutual_nearest(query, train)
    nearest = cv2.BFMatcher(cv2.NORM_L2).knnMatch(query, train, k=2)
    first, second = (np.array([nearest[row][k].distance for row in matches.query_rows]) for k in (0, 1))
    np.testing.assert_allclose(matches.quality["descriptor_distance"], first, rtol=1e-5)
    np.testing.assert_allclose(matches.quality["descriptor_ratio"], first / second, rtol=1e-5)
