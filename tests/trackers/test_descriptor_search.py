"""Features searched by their descriptors in a second image, which shows the first farther to the left."""

import cv2
import numpy as np
import pytest
from tests.trackers.conftest import SIZE, textured

from tracknoise.exceptions import DataError, TracknoiseError
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.stereo_pair import StereoPair
from tracknoise.trackers.correspondence import Descriptor, describe, describe_at
from tracknoise.trackers.descriptor_search import DescriptorSearch
from tracknoise.trackers.detection import Detection, Detector
from tracknoise.trackers.second_view import PatchSettings, SecondView
from tracknoise.trackers.tracker import Frame
from tracknoise.trackers.tracker_registry import make_tracker

CAMERA = Camera(*SIZE, 300.0, 300.0, (SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2)
PLACE = np.eye(4)
PLACE[0, 3] = 0.1
PAIR = StereoPair(CAMERA, CAMERA, PLACE)
DISPARITY = 7.4
DEPTH_M = 30.0 / DISPARITY
FIRST = textured(*SIZE)
NEAR = 50**0.5
ORB = Detection(detector=Detector.orb)


def shown(left: float = DISPARITY, down: float = 0.0) -> tuple[Frame, Frame]:
    moved = cv2.warpAffine(FIRST, np.array([[1.0, 0.0, -left], [0.0, 1.0, down]]), SIZE, flags=cv2.INTER_CUBIC)
    noise = np.random.default_rng(1).normal(0.0, 2.0, moved.shape)
    return Frame(0, FIRST), Frame(0, np.clip(np.rint(moved + noise), 0, 255).astype(np.uint8))


def features(detection: Detection, descriptor: Descriptor) -> np.ndarray:
    """Positions that show in both images."""
    uv = describe(Frame(0, FIRST), detection, descriptor).uv[:400]
    return uv[uv[:, 0] > 60]


def searched(settings: DescriptorSearch, images: tuple[Frame, Frame]) -> tuple[np.ndarray, np.ndarray]:
    """Movements (n, 2) of features that are found, and which are."""
    uv = features(settings.detection, settings.descriptor)
    moved = settings.of(PAIR).found(images, uv) - uv
    there = np.isfinite(moved).all(axis=1)
    return moved[there], there


@pytest.mark.parametrize(
    ("detection", "descriptor"),
    [(Detection(), Descriptor.orb), (Detection(), Descriptor.sift), (ORB, Descriptor.orb)],
)
def test_refined_positions_lie_on_the_row_at_the_disparity_of_the_point(detection, descriptor):
    moved, there = searched(DescriptorSearch(detection=detection, descriptor=descriptor), shown())
    assert there.mean() > 0.4
    assert np.abs(moved[:, 1]).max() < 1e-9
    assert np.median(np.abs(moved[:, 0] + DISPARITY)) < 0.15


def test_without_refinement_positions_are_those_of_keypoints():
    images = shown()
    settings = DescriptorSearch(refined_px=0, max_distance=NEAR)
    moved, there = searched(settings, images)
    ends = features(settings.detection, settings.descriptor)[there] + moved
    known = {tuple(uv) for uv in describe(images[1], settings.detection, settings.descriptor).uv.tolist()}
    assert len(ends) > 100
    assert {tuple(uv) for uv in ends.tolist()} <= known
    assert 0.39 < np.median(np.abs(moved[:, 0] + DISPARITY)) < 0.61


@pytest.mark.parametrize("refined_px", [0, 5])
@pytest.mark.parametrize(
    ("nearest_m", "farthest_m", "finds"),
    [(0.9 * DEPTH_M, 1.2 * DEPTH_M, True), (1.2 * DEPTH_M, 100.0, False), (0.5, 0.8 * DEPTH_M, False)],
)
def test_points_of_other_depths_are_not_found(nearest_m, farthest_m, finds, refined_px):
    settings = DescriptorSearch(nearest_m=nearest_m, farthest_m=farthest_m, max_distance=NEAR, refined_px=refined_px)
    moved, there = searched(settings, shown())
    assert (there.mean() > 0.4) if finds else (there.mean() < 0.1)
    assert ((-moved[:, 0] >= 30.0 / farthest_m) & (-moved[:, 0] <= 30.0 / nearest_m)).all()


def test_rows_are_as_wide_as_pixels_of_the_level_of_the_keypoint():
    images, uv = shown(8.0, 4.0), features(ORB, Descriptor.orb)
    keypoints, which = describe_at(images[0], uv, ORB, Descriptor.orb)
    level = keypoints.level[which]
    settings = DescriptorSearch(detection=ORB, rows_px=2.0, refined_px=0, max_distance=NEAR)
    found = np.isfinite(settings.of(PAIR).found(images, uv)[:, 0])
    assert found[level <= 1].mean() < 0.1
    assert found[level >= 5].mean() > 0.3


def test_levels_of_features_and_keypoints_differ_by_one_at_most():
    settings, images = DescriptorSearch(detection=ORB, refined_px=0), shown(9.3)
    uv = features(ORB, Descriptor.orb)
    found = settings.of(PAIR).found(images, uv)
    there = np.isfinite(found).all(axis=1)
    both = zip(images, (uv[there], found[there]), strict=True)
    of_first, of_second = (
        points.level[which] for points, which in (describe_at(image, at, ORB, Descriptor.orb) for image, at in both)
    )
    assert (of_first != of_second).sum() > 5
    assert np.abs(of_first - of_second).max() == 1


def test_matches_that_look_less_alike_than_others_are_dropped():
    images = shown()
    covered = images[1].image.copy()
    covered[160:] = np.clip(covered[160:] + np.random.default_rng(2).normal(0.0, 25.0, covered[160:].shape), 0, 255)
    images = images[0], Frame(0, covered)
    (_, all_found), (_, alike) = (searched(DescriptorSearch(difference_ratio=ratio), images) for ratio in (None, 1.5))
    below = features(Detection(), Descriptor.orb)[:, 1] > 165.0
    assert not (alike & ~all_found).any()
    assert (all_found & below).sum() > 20
    assert (alike & below).sum() < 0.5 * (all_found & below).sum()
    assert (alike & ~below).sum() > 0.8 * (all_found & ~below).sum()


def test_only_descriptors_that_are_near_enough_match():
    few, many = (searched(DescriptorSearch(max_distance=most), shown())[1] for most in (4.0, 9.0))
    assert 0 < few.sum() < 0.8 * many.sum()


def test_a_position_is_described_as_a_keypoint_there_is():
    frame = Frame(0, FIRST)
    keypoints = describe(frame, Detection(), Descriptor.orb)
    found, which = describe_at(frame, keypoints.uv[::-1], Detection(), Descriptor.orb)
    assert (found.descriptors[which] == keypoints.descriptors[::-1]).all()
    _, which = describe_at(frame, np.array([[2.0, 2.0], [150.25, 100.5]]), Detection(), Descriptor.orb)
    assert (which >= 0).tolist() == [False, True]
    own = describe(frame, ORB, Descriptor.orb)
    _, which = describe_at(frame, np.concatenate([own.uv[:5], own.uv[:5] + 0.3]), ORB, Descriptor.orb)
    assert (which >= 0).tolist() == [True] * 5 + [False] * 5


def test_cameras_one_ahead_of_the_other_have_no_rows():
    ahead = np.eye(4)
    ahead[2, 3] = 0.2
    with pytest.raises(DataError, match="beside"):
        DescriptorSearch().of(StereoPair(CAMERA, CAMERA, ahead))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"descriptors": {"descriptor": "network"}}, "descriptors.descriptor is 'network', expected one that has"),
        ({"descriptors": {"nearest_m": 5.0, "farthest_m": 4.0}}, "descriptors.farthest_m is 4.0, expected a number"),
        ({"descriptors": {"refined_px": 11}}, "refined_px is 11, expected a number from 0 to 10"),
        ({"descriptors": {"rows_px": 0.0}}, "rows_px is 0.0, expected a number above 0"),
        ({"search": "descriptors"}, "search: .*'descriptor'"),
        ({"method": "patch", "window_px": 101}, "window_px is 101, expected a number from 3 to 99"),
        ({"patch": {"warp": "homography"}}, "patch.warp: .*'affine'"),
    ],
)
def test_bad_settings_are_refused_in_one_line(options, said):
    with pytest.raises(TracknoiseError, match=said) as caught:
        make_tracker("second-view", options)
    assert "\n" not in str(caught.value)


def test_settings_can_be_told_apart():
    one, other = SecondView(method="patch"), SecondView(method="patch", patch=PatchSettings(warp="shift"))
    assert one != other
    assert hash(one) != hash(other)
