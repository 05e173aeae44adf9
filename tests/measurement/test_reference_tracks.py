"""Reference tracks follow the points of a scene, by two kinds of trackers, in every frame with a pose."""

import numpy as np
import pytest
from tests.measurement.planes import FRAMES, PLANE_M, depths_of, images_of, moving, recorded

from tracknoise.geometry.depth import DepthMap
from tracknoise.measurement.reference_tracks import KINDS, LONGEST, reference_tracks, with_depths
from tracknoise.truth.pose_adjustment import PoseAdjustment

POSES = moving()
IMAGES, DEPTHS = images_of(POSES), depths_of(POSES)


@pytest.fixture(scope="module")
def tracks():
    return reference_tracks(recorded(POSES, IMAGES, DEPTHS), FRAMES)


def test_both_kinds_follow_hundreds_of_points_near_their_true_positions(tracks):
    left = PoseAdjustment(recorded(POSES, IMAGES, DEPTHS), tracks).residuals(POSES, tracks.depth_m)
    kind = tracks.kind[tracks.track]
    for number, _ in enumerate(KINDS):
        per_frame = np.bincount(tracks.frame[kind == number], minlength=FRAMES)[1:]
        assert per_frame.min() > 60
        assert np.median(np.linalg.norm(left[kind == number], axis=1)) < 0.4


def test_observations_are_sorted_and_come_after_the_births(tracks):
    assert (np.diff(tracks.birth) >= 0).all()
    assert (np.diff(tracks.track) >= 0).all()
    age = tracks.frame - tracks.birth[tracks.track]
    assert age.min() >= 1
    assert age.max() <= LONGEST
    assert len(np.unique(tracks.track)) == len(tracks.birth)
    assert tracks.depth_m == pytest.approx(PLANE_M, rel=0.3)


def test_frames_without_a_pose_have_no_reference_tracks(tracks):
    poses = POSES.copy()
    poses[[0, 4]] = np.nan
    some = reference_tracks(recorded(poses, IMAGES, DEPTHS), FRAMES)
    assert not np.isin(some.frame, [0, 4]).any()
    assert not np.isin(some.birth, [0, 4]).any()
    assert len(some.birth) > 0


def test_tracks_that_began_before_the_first_pose_begin_with_it(tracks):
    """Ground truth often starts later than images."""
    poses = POSES.copy()
    poses[:2] = np.nan
    some = reference_tracks(recorded(poses, IMAGES, DEPTHS), FRAMES)
    of_all = np.bincount(tracks.frame, minlength=FRAMES)
    of_some = np.bincount(some.frame, minlength=FRAMES)
    assert (of_some[3:] > 0.9 * of_all[3:]).all()


def test_only_frames_that_are_measured_are_followed():
    some = reference_tracks(recorded(POSES, IMAGES, DEPTHS), 3)
    assert some.frame.max() == 2


def test_other_depths_can_be_read_without_following_again(tracks):
    farther = [DepthMap(2.0 * one.depth_m, one.valid) for one in DEPTHS]
    again = with_depths(recorded(POSES, IMAGES, farther), tracks)
    assert again.depth_m == pytest.approx(2.0 * tracks.depth_m)
    assert np.array_equal(again.uv, tracks.uv)


def test_tracks_without_depth_stay_without(tracks):
    valid = np.zeros_like(DEPTHS[0].valid)
    valid[:, 60:] = True
    some = with_depths(recorded(POSES, IMAGES, [DepthMap(one.depth_m, valid) for one in DEPTHS]), tracks)
    known = np.isfinite(some.depth_m)
    assert 0 < known.sum() < len(tracks.birth)
    assert some.birth_uv[known, 0].min() > 58
    none = with_depths(recorded(POSES, IMAGES, None), tracks)
    assert np.isnan(none.depth_m).all()


def test_an_image_without_texture_has_no_reference_tracks():
    blank = [np.full_like(IMAGES[0], 90) for _ in IMAGES]
    assert not len(reference_tracks(recorded(POSES, blank, DEPTHS), FRAMES).frame)
