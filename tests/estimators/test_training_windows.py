"""Windows that a model is fitted with: their tracks determine all poses, however short tracks are."""

from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

from tracknoise.estimators import fit
from tracknoise.estimators.equivalents import LENGTHS
from tracknoise.estimators.fit import lengths_of_tracks
from tracknoise.estimators.linear_window import (
    CAMERA,
    Motion,
    determines_poses,
    linear_tracks,
    simulated_tracks,
    trajectory,
)
from tracknoise.estimators.training import windows


def drawn(n_tracks: int, lengths: np.ndarray | None = None):
    poses = trajectory(Motion.SIDEWAYS, 30)
    tracks = simulated_tracks(poses, n_tracks=n_tracks, lengths=lengths)
    return [linear_tracks(CAMERA, poses, one) for one in tracks]


def test_few_or_short_tracks_do_not_determine_poses():
    assert determines_poses(drawn(80))
    assert not determines_poses(drawn(2))
    assert not determines_poses(drawn(40, np.full(10, 3)))
    assert not determines_poses([])


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("lifetime", [2, 3, 4])
def test_windows_of_short_tracks_have_enough_of_them(length, lifetime):
    found = windows([], speed=1, length=length, lifetimes=np.full(20, lifetime)).each
    assert len(found) == len(Motion)
    assert all(determines_poses(window) for window in found)


def test_tracks_that_outlive_all_known_ends_are_as_long_as_the_window():
    ends = pl.DataFrame({"lifetime": [5, 20, 50], "n_ended": [30, 0, 0], "n_censored": [0, 40, 30]})
    for longest, expected in ((30, 50), (60, 60)):
        lengths, counts = np.unique(lengths_of_tracks(ends, longest=longest), return_counts=True)
        assert lengths.tolist() == [5, expected]
        assert counts.tolist() == [300, 700]


def test_tracks_alive_in_the_last_frame_are_not_at_risk_there():
    # 50 of the 150 that were looked for again end at 3: two thirds live on
    ends = pl.DataFrame({"lifetime": [3, 10], "n_ended": [50, 100], "n_censored": [50, 0]})
    lengths, counts = np.unique(lengths_of_tracks(ends, longest=30), return_counts=True)
    assert lengths.tolist() == [3, 10]
    assert counts.tolist() == [333, 667]


def test_windows_are_of_where_the_tracker_itself_found_features():
    """What else was measured does not change the sigma of a tracker."""
    every = pl.DataFrame(
        {
            "tracker": ["own"] * 60 + ["other"] * 60,
            "u_birth_px": [10.0] * 60 + [300.0] * 60,
            "v_birth_px": [20.0] * 120,
            "depth_m": [2.0] * 60 + [9.0] * 60,
        }
    )

    def read(tracker: str, rows: pl.DataFrame = every) -> SimpleNamespace:
        return SimpleNamespace(tracker=tracker, of_sequence=lambda name, key: rows)

    assert set(fit._sights(read("own"), "key")[:, 2]) == {2.0}
    assert set(fit._sights(read("other"), "key")[:, 2]) == {9.0}
    assert len(fit._sights(read("own", every[20:]), "key")) == 100  # of its own there are too few
