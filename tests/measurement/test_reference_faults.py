"""What both halves of the reference tracks have in common is in what is said to be left of the errors of poses."""

import numpy as np
import pytest
from tests.measurement.made_tracks import Found, made, path, spoilt, wall, with_focal, with_k1

from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.truth.accuracies import AccuracyRule, known_accuracy
from tracknoise.truth.pose_adjustment import PoseAdjustment
from tracknoise.truth.uncertainty import TrueErrors, TruthDerivatives

FRAMES = 24
POSES = path(FRAMES)
STATED = spoilt(POSES)
ONLY_STATED = AccuracyRule(shipped=False)


def floor_px(found: Found) -> float:
    """What the floor of true positions is at the age of the fit, px."""
    tracks, sequence = found.tracks, found.sequence
    rows = np.flatnonzero(tracks.frame - tracks.birth[tracks.track] == found.fit.age)
    points = PoseAdjustment(sequence, tracks).anchored_points(sequence.world_from_camera, tracks.depth_m, rows)
    known = TrueErrors(TruthDerivatives(sequence), known_accuracy(sequence, "birth", ONLY_STATED).figures, step=1)
    spread = np.concatenate([sum(part.covariance.values()) for _, part in known.of(points)])
    return float(np.sqrt(np.nanmean(np.trace(spread, axis1=1, axis2=2))))


def test_without_a_fault_nothing_much_is_added():
    found = made(POSES, per_kind=120).refined(STATED)
    assert found.fit.leads
    assert 0.7 * found.really_px() < found.fit.left_px < 2.0 * found.really_px()
    assert floor_px(found) < 2.0 * found.really_px()


@pytest.mark.parametrize("accuracy", [TruthAccuracy(), TruthAccuracy(readout_ms=0.0)])
def test_a_readout_time_that_is_not_stated_or_said_to_be_none_is_in_the_floor(accuracy):
    found = made(POSES, per_kind=120, readout_s=0.012).refined(STATED, accuracy=accuracy)
    assert found.fit.leads
    assert found.really_px() > 0.4
    assert found.fit.left_px > 0.7 * found.really_px()
    assert floor_px(found) > 0.7 * found.really_px()


def test_few_features_have_a_floor_as_large_as_their_error():
    for seed in range(4):
        found = made(POSES, per_kind=24, seed=seed).refined(STATED)
        assert found.fit.left_px > 0.95 * found.really_px()


@pytest.mark.parametrize("moves", [1.0, 0.0])
def test_a_wrong_focal_length_on_one_plane_is_bounded(moves):
    poses = path(FRAMES, moves=moves)
    found = with_focal(made(poses, wall, per_kind=120), 1.05).refined(spoilt(poses))
    assert found.fit.leads
    assert found.really_px() > 0.08
    assert found.fit.left_px > 0.6 * found.really_px()
    assert floor_px(found) > 0.6 * found.really_px()


@pytest.mark.parametrize(
    ("changed", "by"),
    [(with_focal, 0.9), (with_focal, 0.99), (with_focal, 1.004), (with_focal, 1.1), (with_k1, -0.1), (with_k1, 0.1)],
)
def test_exact_poses_lead_where_the_camera_is_wrong(changed, by):
    found = changed(made(POSES, per_kind=120), by).refined(POSES)
    assert not found.fit.leads
    assert "error of the camera" in found.fit.reason


@pytest.mark.parametrize("drift_m", [0.02, 0.005, 0.002, 0.0005])
def test_a_third_of_the_image_that_moves_on_its_own_is_bounded_or_refused(drift_m):
    found = made(POSES, per_kind=120, moving=0.33, drift_m=drift_m).refined(STATED)
    assert not found.fit.leads or min(found.fit.left_px, floor_px(found)) > 0.5 * found.really_px()


@pytest.mark.parametrize("moving", [0.4, 0.5])
def test_more_of_it_is_bounded_or_refused(moving):
    found = made(POSES, per_kind=120, moving=moving, drift_m=0.002).refined(STATED)
    assert not found.fit.leads or min(found.fit.left_px, floor_px(found)) > 0.5 * found.really_px()


def test_a_camera_that_only_turns_and_frames_that_repeat_are_bounded():
    turns, twice = path(FRAMES, moves=0.0), POSES[np.arange(FRAMES) // 2]
    for poses in (turns, twice):
        found = made(poses, per_kind=120).refined(spoilt(poses))
        assert found.fit.leads
        assert 0.7 * found.really_px() < found.fit.left_px < 4.0 * found.really_px()
