"""The filter is consistent where its noise is right, and says so where it is not."""

import numpy as np
import polars as pl
import pytest
from benchmarks.filter_tracks import CLONES, Pieces, Unused, whole_tracks
from benchmarks.inertial_problem import planted_problem
from benchmarks.msckf import Assumed, Filtered, GateRule, run_filter
from benchmarks.noise.arms import PlantedNoise
from benchmarks.track_points import triangulated

from tracknoise.estimators.linear_window import CAMERA, Motion, trajectory
from tracknoise.inference.track_noise import TrackNoise

WHITE = PlantedNoise(noise=TrackNoise.isotropic(first=0.3, white=0.3))
WALK = PlantedNoise(noise=TrackNoise.isotropic(walk=0.1))
_RUNS, _FRAMES = 4, 25


def _filtered(planted: PlantedNoise, assumed: Assumed, lifetime: int = CLONES, *, runs: int = _RUNS) -> list[Filtered]:
    return [
        run_filter(
            planted_problem(planted, n_frames=_FRAMES, per_frame=5, lifetime=lifetime, seed=seed), assumed, seed=seed
        )
        for seed in range(runs)
    ]


def _nees(found: list[Filtered]) -> float:
    return float(np.mean([one.nees for one in found]))


def _mean(found: list[Filtered], gated: str, name: str) -> float:
    return float(np.mean([getattr(getattr(one, gated), name) for one in found]))


def test_right_noise_is_consistent_and_passes_the_gate() -> None:
    found = _filtered(WHITE, Assumed(tracks=0.3))
    assert 0.5 < _nees(found) < 1.6
    assert _mean(found, "tracks", "passed") == pytest.approx(0.95, abs=0.03)
    assert _mean(found, "tracks", "ratio") == pytest.approx(1.0, abs=0.1)
    problem = planted_problem(WHITE, n_frames=_FRAMES, per_frame=5, seed=0)
    apart = found[0].poses[:, :3, 3] - problem.world_from_camera[:, :3, 3]
    assert np.linalg.norm(apart, axis=1).max() < 0.03


def test_right_noise_is_consistent_with_features_in_the_state() -> None:
    found = _filtered(WHITE, Assumed(tracks=0.3, features=0.3, most_features=50), lifetime=_FRAMES)
    assert 0.5 < _nees(found) < 1.6
    for gated in ("tracks", "coming", "features"):
        assert _mean(found, gated, "passed") == pytest.approx(0.95, abs=0.05)
        assert _mean(found, gated, "ratio") == pytest.approx(1.0, abs=0.1)


def test_features_assumed_too_exact_are_rejected_and_leave_the_state() -> None:
    found = _filtered(WHITE, Assumed(tracks=0.3, features=0.05, most_features=50), lifetime=_FRAMES)
    assert _mean(found, "coming", "passed") < 0.2


def test_a_gate_allows_for_a_stated_or_a_claimed_share_of_predicted_poses() -> None:
    claimed = np.array([0.0, 0.5, 1.0])
    np.testing.assert_allclose(GateRule(0.2, 1.0 / 3.0, 0.9).factors(claimed), 0.9 * (1 / 3 + 2 / 3 * 0.2))
    np.testing.assert_allclose(GateRule(0.2, None, 0.9).factors(claimed), [0.18, 0.54, 0.9])


def test_a_quarter_of_the_variance_is_overconfident() -> None:
    wide = GateRule(1e6)
    right, small = (_nees(_filtered(WHITE, Assumed(tracks=sigma, gate=wide))) for sigma in (0.3, 0.15))
    assert small > 1.25 * right
    assert _mean(_filtered(WHITE, Assumed(tracks=0.15)), "tracks", "passed") < 0.2


def test_under_a_walk_the_sigma_of_innovations_is_overconfident_and_whole_tracks_are_not() -> None:
    scalar, whole = (_filtered(WALK, Assumed(tracks=noise), runs=8) for noise in (0.121, WALK.noise))
    assert _mean(scalar, "tracks", "ratio") == pytest.approx(1.0, abs=0.15)
    assert _nees(scalar) > 1.5 * _nees(whole)
    assert 0.5 < _nees(whole) < 1.6


def test_points_are_found_from_poses_and_observations_alone() -> None:
    poses, points = trajectory(Motion.SIDEWAYS, CLONES), np.array([[0.5, -0.2, 4.0], [0.2, 0.3, 500.0]])
    seen = points[:, None] - poses[:, :3, 3]
    uv = CAMERA.project(seen)
    uv[0, 7:] = 0.0  # of a track that ended
    tracks = Pieces(np.zeros(2, np.int64), np.array([7, CLONES]), uv, np.ones(2, np.bool_))
    found, usable = triangulated(CAMERA, np.tile(poses, (2, 1, 1, 1)), tracks)
    np.testing.assert_array_equal(usable, [True, False])  # the second is too far away
    np.testing.assert_allclose(found[0], points[0], atol=1e-6)


def _used(table: pl.DataFrame) -> list[tuple[int, int, int]]:
    """First frames and lengths of pieces, and when they are used."""
    unused, found = Unused(whole_tracks(table.with_columns(good=True))), []
    for frame in range(int(table["frame"].max()) + 2):  # type: ignore[arg-type]
        pieces = unused.taken(np.concatenate([unused.lost(frame), unused.full(frame)]), frame)
        found += zip(pieces.first.tolist(), pieces.length.tolist(), [frame] * len(pieces.first), strict=True)
    return sorted(found)


def test_tracks_are_cut_where_a_frame_is_missing_and_after_as_many_frames_as_the_filter_keeps() -> None:
    frames = [*range(20), *range(5, 9), *range(11, 14)]
    table = pl.DataFrame(
        {"track": [9] * 20 + [0] * 7, "frame": frames, "u_px": [float(frame) for frame in frames], "v_px": 1.0}
    )
    assert _used(table) == [(0, 11, 10), (5, 4, 9), (11, 3, 14), (11, 9, 20)]
    tracks = whole_tracks(table.with_columns(good=pl.col("u_px") < 13))
    np.testing.assert_array_equal(tracks.length, [4, 3, 20])
    pieces = tracks.pieces(np.array([0, 1]), np.array([5, 11]), np.array([8, 13]))
    np.testing.assert_array_equal(pieces.uv[0, :5], [[5, 1], [6, 1], [7, 1], [8, 1], [0, 0]])
    np.testing.assert_array_equal(pieces.good, [True, False])


def test_the_first_piece_of_a_track_is_shorter_by_its_number_and_used_at_its_last_frame() -> None:
    table = pl.DataFrame({"track": [4] * 20, "frame": range(20), "u_px": 0.0, "v_px": 1.0})
    assert _used(table) == [(0, 7, 6), (7, 11, 17)]


def test_a_track_in_the_state_is_not_used_and_what_follows_is() -> None:
    table = pl.DataFrame({"track": [0] * 30, "frame": range(30), "u_px": 0.0, "v_px": 1.0, "good": True})
    unused, track = Unused(whole_tracks(table)), np.array([0])
    unused.put(track, 10, in_state=True)
    assert not len(unused.full(10))
    unused.put(track, 15, in_state=False)
    assert [frame for frame in range(30) if len(unused.full(frame))] == [26]
    assert unused.whole(track).all()
