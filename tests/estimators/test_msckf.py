"""The filter is consistent where its noise is right, and says so where it is not."""

import numpy as np
import polars as pl
import pytest
from benchmarks.filter_trial import ended_tracks
from benchmarks.msckf import CLONES, Assumed, EndedTracks, Filtered, planted_problem, run_filter, triangulated
from benchmarks.noise.arms import PlantedNoise

from tracknoise.estimators.linear_window import CAMERA, Motion, trajectory
from tracknoise.inference.track_noise import TrackNoise

WHITE = PlantedNoise(noise=TrackNoise.isotropic(first=0.3, white=0.3))
WALK = PlantedNoise(noise=TrackNoise.isotropic(walk=0.1))
_RUNS, _FRAMES = 4, 25


def _filtered(planted: PlantedNoise, assumed: Assumed, **gate: float) -> list[Filtered]:
    return [
        run_filter(planted_problem(planted, n_frames=_FRAMES, per_frame=5, seed=seed), assumed, seed=seed, **gate)
        for seed in range(_RUNS)
    ]


def _mean(found: list[Filtered], name: str) -> float:
    return float(np.mean([getattr(one, name) for one in found]))


def test_right_noise_is_consistent_and_passes_the_gate() -> None:
    found = _filtered(WHITE, 0.3)
    assert 0.5 < _mean(found, "nees") < 1.6
    assert _mean(found, "passed") == pytest.approx(0.95, abs=0.03)
    assert _mean(found, "innovations") == pytest.approx(1.0, abs=0.1)
    problem = planted_problem(WHITE, n_frames=_FRAMES, per_frame=5, seed=0)
    apart = found[0].poses[:, :3, 3] - problem.world_from_camera[:, :3, 3]
    assert np.linalg.norm(apart, axis=1).max() < 0.03


def test_a_quarter_of_the_variance_is_overconfident() -> None:
    wide = {"gate": 1e6}
    assert _mean(_filtered(WHITE, 0.15, **wide), "nees") > 1.25 * _mean(_filtered(WHITE, 0.3, **wide), "nees")
    assert _mean(_filtered(WHITE, 0.15), "passed") < 0.2


def test_under_a_walk_the_sigma_of_innovations_is_overconfident_and_whole_tracks_are_not() -> None:
    scalar, whole = _filtered(WALK, 0.121), _filtered(WALK, WALK.noise)
    assert _mean(scalar, "innovations") == pytest.approx(1.0, abs=0.15)
    assert _mean(scalar, "nees") > 1.5 * _mean(whole, "nees")
    assert 0.5 < _mean(whole, "nees") < 1.6


def test_points_are_found_from_poses_and_observations_alone() -> None:
    poses, points = trajectory(Motion.SIDEWAYS, CLONES), np.array([[0.5, -0.2, 4.0], [0.2, 0.3, 500.0]])
    seen = points[:, None] - poses[:, :3, 3]
    uv = CAMERA.project(seen)
    uv[0, 7:] = 0.0  # of a track that ended
    tracks = EndedTracks(np.zeros(2, np.int64), np.array([7, CLONES]), uv, np.full(2, CLONES))
    found, usable = triangulated(CAMERA, np.tile(poses, (2, 1, 1, 1)), tracks)
    np.testing.assert_array_equal(usable, [True, False])  # the second is too far away
    np.testing.assert_allclose(found[0], points[0], atol=1e-6)


def test_tracks_are_cut_where_a_frame_is_missing_and_after_as_many_frames_as_the_filter_keeps() -> None:
    frames = [*range(20), *range(5, 9), *range(11, 14)]
    table = pl.DataFrame(
        {"track": [9] * 20 + [0] * 7, "frame": frames, "u_px": [float(frame) for frame in frames], "v_px": 1.0}
    )
    found = ended_tracks(table)
    rows = zip(found.first.tolist(), found.length.tolist(), found.used_at.tolist(), strict=True)
    assert sorted(rows) == [(0, 11, 10), (5, 4, 9), (11, 3, 14), (11, 9, 20)]
    np.testing.assert_array_equal(found.uv[found.length == 4][0, :5], [[5, 1], [6, 1], [7, 1], [8, 1], [0, 0]])


def test_the_first_part_of_a_track_is_shorter_by_its_number_and_used_at_its_last_frame() -> None:
    table = pl.DataFrame({"track": [4] * 20, "frame": range(20), "u_px": 0.0, "v_px": 1.0})
    found = ended_tracks(table)
    rows = zip(found.first.tolist(), found.length.tolist(), found.used_at.tolist(), strict=True)
    assert sorted(rows) == [(0, 7, 6), (7, 11, 17)]
