"""Poses that were spoilt come back by reference tracks; what cannot be determined is refused with its reason."""

from dataclasses import replace

import numpy as np
import pytest
from tests.measurement.planes import CAMERA, FRAMES, depths_of, images_of, moving, recorded, walked

from tracknoise import Sequence, open_sequence
from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.measurement.reference_tracks import KINDS
from tracknoise.measurement.refined_poses import RefinedPoses, refined
from tracknoise.truth.accuracies import DEFAULT_RULE, AccuracyRule

POSES = moving()
IMAGES, DEPTHS = images_of(POSES), depths_of(POSES)
EXACT = TruthAccuracy(rotation_white_deg=0.0, translation_white_m=0.0)


@pytest.fixture(scope="module")
def spoilt():
    sequence = recorded(walked(POSES), IMAGES, DEPTHS)
    return sequence, *refined(sequence, "birth", DEFAULT_RULE, FRAMES)


def true_shift_px(poses: np.ndarray, first: int = 1) -> float:
    """RMS of the displacement of true positions by poses that are not exact, over pixels and frames from `first` on."""
    u, v = np.meshgrid(np.linspace(10, 190, 7), np.linspace(10, 140, 6))
    uv = np.stack([u.ravel(), v.ravel()], axis=1)
    squares = []
    for frame in range(first, FRAMES):
        points = CAMERA.unproject(uv, DEPTHS[0].depth_m[np.rint(uv[:, 1]).astype(int), np.rint(uv[:, 0]).astype(int)])
        seen = []
        for one in (poses, POSES):
            moved = np.linalg.inv(one[frame]) @ one[0]
            seen.append(CAMERA.project(points @ moved[:3, :3].T + moved[:3, 3]))
        squares.append(np.nanmean(np.sum((seen[0] - seen[1]) ** 2, axis=1)))
    return float(np.sqrt(np.mean(squares)))


def test_spoilt_poses_come_back(spoilt):
    sequence, found, fit = spoilt
    assert fit.leads
    assert isinstance(found, RefinedPoses)
    stated_px, left_px = true_shift_px(sequence.world_from_camera), true_shift_px(found.poses)
    assert stated_px > 1.0
    assert left_px < 0.1 * stated_px


def test_what_is_told_of_the_poses_is_what_is_true_of_them(spoilt):
    sequence, _, fit = spoilt
    assert fit.age == FRAMES - 1
    assert fit.stated_px == pytest.approx(true_shift_px(sequence.world_from_camera, fit.age), rel=0.4)
    assert fit.left_px < 0.2
    assert fit.references > 200


def test_halves_and_each_kind_alone_have_poses_of_their_own(spoilt):
    sequence, found, _ = spoilt
    assert set(found.by_kind) == set(KINDS)
    for poses in (*found.pose_halves, *found.by_kind.values()):
        assert 0.0 < true_shift_px(poses) < 0.3 * true_shift_px(sequence.world_from_camera)


def test_exact_poses_that_state_nothing_stay():
    sequence = recorded(POSES, IMAGES, DEPTHS)
    found, fit = refined(sequence, "birth", DEFAULT_RULE, FRAMES)
    assert found is sequence
    assert fit.stated_px < 0.15
    assert "less than reference tracks can resolve" in fit.reason


@pytest.mark.parametrize("seed", [0, 2])
def test_exact_poses_of_few_frames_stay(seed):
    """By chance, refined poses differ from them by 1.5 to 1.65 times what is said to be left of their errors."""
    made = open_sequence("simulated", motions=("arvr",), frames=6, width=320, height=240, supersampling=1, seed=seed)
    images, maps = zip(*((made.image(index), made.depth(index)) for index in range(6)), strict=True)
    depths = [np.where(one.valid, one.depth_m, 0.0) for one in maps]
    sequence = Sequence.from_arrays(images, made.world_from_camera, made.camera, depths)
    assert refined(sequence, "birth", DEFAULT_RULE, 6)[0] is sequence


def test_poses_that_are_stated_to_be_exact_stay():
    sequence = recorded(walked(POSES), IMAGES, DEPTHS)
    found, fit = refined(sequence, "birth", AccuracyRule(EXACT), FRAMES)
    assert found is sequence
    assert not fit.leads
    assert "exact" in fit.reason


def test_a_camera_that_only_turns_is_refused_without_depth_and_not_with_it():
    poses = moving(moves=False)
    images = images_of(poses)
    stated = walked(poses, metres=1e-4)
    without = refined(recorded(stated, images, None), "birth", DEFAULT_RULE, FRAMES)[1]
    assert not without.leads
    assert "need a parallax" in without.reason
    assert refined(recorded(stated, images, depths_of(poses)), "birth", DEFAULT_RULE, FRAMES)[1].leads


def test_images_without_texture_are_refused():
    blank = [np.full_like(IMAGES[0], 90) for _ in IMAGES]
    sequence = recorded(walked(POSES), blank, DEPTHS)
    found, fit = refined(sequence, "birth", DEFAULT_RULE, FRAMES)
    assert found is sequence
    assert "fewer than" in fit.reason


def test_depth_maps_that_are_mostly_noise_are_refused():
    rng = np.random.default_rng(0)
    noisy = [
        replace(one, depth_m=one.depth_m * np.exp(0.05 * rng.standard_normal(one.depth_m.shape))) for one in DEPTHS
    ]
    sequence = recorded(walked(POSES), IMAGES, noisy)
    found, fit = refined(sequence, "birth", DEFAULT_RULE, FRAMES)
    assert found is sequence
    assert "noise makes depths of neighbours differ" in fit.reason


def test_images_that_show_another_motion_are_refused():
    rng = np.random.default_rng(0)
    noise = [rng.integers(60, 200, one.shape).astype(np.uint8) for one in IMAGES]
    assert not refined(recorded(walked(POSES), noise, DEPTHS), "birth", DEFAULT_RULE, FRAMES)[1].leads


def test_frames_without_a_pose_stay_without():
    stated = walked(POSES)
    stated[[0, 3]] = np.nan
    found, fit = refined(recorded(stated, IMAGES, DEPTHS), "birth", DEFAULT_RULE, FRAMES)
    assert fit.leads
    assert np.isnan(found.world_from_camera[[0, 3]]).all()
    assert np.isfinite(np.delete(found.world_from_camera, [0, 3], axis=0)).all()


def test_repeated_frames_do_not_move_the_camera():
    twice = np.arange(FRAMES) // 2
    stated = walked(POSES[twice])
    found, fit = refined(
        recorded(stated, [IMAGES[one] for one in twice], [DEPTHS[one] for one in twice]), "birth", DEFAULT_RULE, FRAMES
    )
    assert fit.leads
    between = np.linalg.inv(found.world_from_camera[0::2]) @ found.world_from_camera[1::2]
    assert np.abs(between[:, :3, 3]).max() < 1e-3


def test_other_kinds_of_truth_keep_their_poses():
    sequence = recorded(walked(POSES), IMAGES, DEPTHS)
    found, fit = refined(sequence, "scan", DEFAULT_RULE, FRAMES)
    assert found is sequence
    assert "scan" in fit.reason


@pytest.mark.parametrize("width", [85, 110])
def test_exact_poses_stay_where_half_of_the_image_moves_by_itself(width):
    """Without depth, refined poses may be those of a camera before the part that moves."""
    other = POSES.copy()
    other[:, :3, 3] += np.arange(FRAMES)[:, None] * [0.05, 0.0, 0.0]
    halves = zip(IMAGES, images_of(other), strict=True)
    images = [np.hstack([still[:, :width], moved[:, width:]]) for still, moved in halves]
    found, fit = refined(recorded(POSES, images, None), "birth", DEFAULT_RULE, FRAMES)
    assert not fit.leads, fit
    assert found.world_from_camera is POSES
