"""Differences between trackers at the same corners, by hand."""

import numpy as np
import polars as pl
import pytest

from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.statistics.truth_errors import SAME_CORNER_PX, between_trackers


@pytest.fixture
def see(tracks, observations):
    """Prepares tracks: of each tracker, by number, the first frame and the positions (u, v) from there on."""

    def seen(*, slowest=None, speed=1, unknown=False, **by_tracker):
        rows = [
            (tracker, number, first + speed * step, speed * step, float(u), float(v))
            for tracker, each in by_tracker.items()
            for number, (first, places) in enumerate(each)
            for step, (u, v) in enumerate(places)
        ]
        tracker, track, frame, age, u, v = (list(column) for column in zip(*rows, strict=True))
        errors = {name: [None] * len(rows) for name in ("u_true_px", "v_true_px", "du_px", "dv_px")} if unknown else {}
        truth = "no_depth" if unknown else "valid"
        table = observations(
            tracker=tracker, track=track, frame=frame, age=age, u_px=u, v_px=v, speed=speed, truth=truth, **errors
        )
        begun = [
            (tracker, number, first) for tracker, each in by_tracker.items() for number, (first, _) in enumerate(each)
        ]
        names, numbers, firsts = (list(column) for column in zip(*begun, strict=True))
        return prepare_sequence(table, tracks(tracker=names, track=numbers, first_frame=firsts, speed=speed))

    return seen


def means(table):
    return table.select("tracker", "other", "age", "n", "mean_u", "mean_v").rows()


def test_the_difference_is_that_of_the_positions_and_needs_no_truth(see):
    a = [(3, [(10, 20), (11, 20), (13, 21)]), (3, [(50, 60), (50, 61)])]
    b = [(3, [(50, 60), (49, 60), (48, 60)]), (3, [(10, 20), (10.5, 20), (12, 20.5)])]
    for unknown in (False, True):
        found = between_trackers(see(a=a, b=b, unknown=unknown))
        totals = found.group_by("age", maintain_order=True).agg(
            pl.col("n").sum(), u=(pl.col("n") * pl.col("mean_u")).sum(), v=(pl.col("n") * pl.col("mean_v")).sum()
        )
        assert totals.rows() == [(1, 2, 1.5, 1.0), (2, 1, 1.0, 0.5)]
        assert found.select("tracker", "other").unique().rows() == [("a", "b")]


def test_moments_are_those_of_all_corners(see):
    rng = np.random.default_rng(0)
    corners = rng.uniform(0, 100, (40, 2))
    moves = rng.normal(size=(2, 40, 2))
    each = [[(0, [corner, corner + move]) for corner, move in zip(corners, of, strict=True)] for of in moves]
    found = between_trackers(see(a=each[0], b=each[1][::-1]))
    difference = moves[0] - moves[1]
    n = found["n"]
    assert (n * found["mean_u"]).sum() == pytest.approx(difference[:, 0].sum())
    about_zero = found["m_uv"] + n * found["mean_u"] * found["mean_v"]
    assert about_zero.sum() == pytest.approx((difference[:, 0] * difference[:, 1]).sum())
    assert found["block"].n_unique() == 16


def test_only_the_same_corner_of_the_same_frame_counts(see):
    near, far = 0.9 * SAME_CORNER_PX, 1.1 * SAME_CORNER_PX
    path = [(10, 20), (11, 20)]
    assert between_trackers(see(a=[(0, path)], b=[(1, path)])).is_empty()
    assert between_trackers(see(a=[(0, path)], b=[(0, [(10 + far, 20), (11, 20)])])).is_empty()
    close = between_trackers(see(a=[(0, path)], b=[(0, [(10 + near, 20), (11 + near, 20)])]))
    assert means(close)[0][:4] == ("a", "b", 1, 1)
    assert close["mean_u"][0] == pytest.approx(0.0)  # what they are apart at first is subtracted


def test_each_corner_is_paired_once_with_the_nearest(see):
    two = [(0, [(10, 20), (12, 20)]), (0, [(10.05, 20), (15.05, 20)])]
    found = between_trackers(see(a=[(0, [(10.01, 20), (11.01, 20)])], b=two))
    assert means(found) == [("a", "b", 1, 1, pytest.approx(-1.0), 0.0)]


def test_every_pair_of_trackers_is_compared_at_every_speed_or_the_slowest(see):
    path = [(0, [(10, 20), (11, 20)])]
    assert between_trackers(see(a=path, b=path, c=path)).select("tracker", "other").rows() == [
        ("a", "b"),
        ("a", "c"),
        ("b", "c"),
    ]
    assert between_trackers(see(a=path, b=path, speed=3))["age"].to_list() == [3]
    assert between_trackers(see(a=path)).is_empty()


def test_ages_that_the_table_does_not_have_are_left_out(see):
    path = [(0, [(10 + step, 20) for step in range(20)])]
    ages = between_trackers(see(a=path, b=path))["age"].to_list()
    assert ages == [1, 2, 3, 4, 5, 6, 8, 10, 12, 16]
