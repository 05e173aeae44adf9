"""Depth from simulated stereo pairs, against the exact depth."""

import pickle
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError
from tracknoise.geometry.pose import invert
from tracknoise.sequences.sequence import SecondCamera, Sequence, TruthKind, second_of
from tracknoise.sequences.simulated import Simulated, SimulatedSequence
from tracknoise.sequences.stereo import DISPARITY_SIGMA_PX, StereoDepth, with_stereo_depth
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.truth_registry import make_truth

RADTAN = {"lens": "radtan", "distortion": (-0.28, 0.07, 0.0002, 0.00002), "hfov_deg": 80.0}
EQUIDISTANT = {"lens": "equidistant", "distortion": (-0.02, 0.01, -0.01, 0.001), "hfov_deg": 110.0}
PAIRS = {
    "pinhole": {"motions": ("sideways",), "baseline_m": 0.3},
    "pinhole near": {"motions": ("arvr",), "baseline_m": 0.1},
    "radtan": {"motions": ("sideways",), "baseline_m": 0.3, **RADTAN},
    "equidistant near": {"motions": ("arvr",), "baseline_m": 0.1, "width": 480, "height": 360, **EQUIDISTANT},
}
FRAMES = 6
BESIDE = [((-0.3, 0.01, 0.0), (0.02, -0.03, 0.01)), ((0.0, 0.3, 0.01), (0.0, 0.01, 0.0))]
"""Other places of a second camera, on the left and below: position and rotation vector in the first."""


def beside(which: int) -> np.ndarray:
    shift_m, rotvec = BESIDE[which]
    first_from_second = np.eye(4)
    first_from_second[:3, :3], first_from_second[:3, 3] = Rotation.from_rotvec(rotvec).as_matrix(), shift_m
    return first_from_second


@cache
def simulated(pair: str) -> SimulatedSequence:
    """Frames of the first camera; behind them, those that cameras at the places `BESIDE` would see at the same times.

    Tests share it: rays of all pixels through a lens with distortion take seconds.
    """
    reader = Simulated(**({"frames": FRAMES, "width": 400, "height": 300} | PAIRS[pair]))
    sequence = reader.open(reader.sequences()[0])
    poses = sequence.world_from_camera
    others = [poses @ beside(which) for which in range(len(BESIDE))]
    return replace(sequence, world_from_camera=np.concatenate([poses, *others]))


def errors(made: StereoDepth, exact: SimulatedSequence) -> tuple[np.ndarray, np.ndarray, float]:
    """Relative errors of depth, errors in standard deviations as stated, and the share of pixels with depth."""
    found, true = made.depth(1), exact.depth(1)
    both = found.valid & true.valid
    off = found.depth_m[both] - true.depth_m[both]
    return off / true.depth_m[both], off / made.depth_accuracy.sigma_m(found.depth_m[both]), both.mean()


@pytest.mark.parametrize("pair", PAIRS)
def test_depth_is_right_within_its_stated_uncertainty(pair):
    sequence = simulated(pair)
    relative, in_sigmas, share = errors(with_stereo_depth(sequence), sequence)
    assert share > 0.4
    assert np.median(np.abs(relative)) < 0.025
    assert 0.6 < np.mean(np.abs(in_sigmas) < 1.0) < 0.9
    assert np.mean(np.abs(in_sigmas) < 2.0) > 0.9
    assert abs(np.median(in_sigmas)) < 0.4


@pytest.mark.parametrize("which", range(len(BESIDE)))
def test_the_second_camera_may_be_anywhere_beside_the_first(which):
    """A pair that is not rectified, with the second camera on the left or below: its images are those of a sequence."""
    sequence, first_frame = simulated("radtan"), FRAMES * (1 + which)
    second = SecondCamera(sequence.camera, beside(which), lambda index: sequence.image(first_frame + index))
    pair = Paired(sequence, second)
    relative, in_sigmas, share = errors(with_stereo_depth(pair), sequence)
    assert share > 0.35
    assert np.median(np.abs(relative)) < 0.025
    assert np.mean(np.abs(in_sigmas) < 2.0) > 0.9


class Paired:
    """A sequence with a second camera of our choice."""

    def __init__(self, sequence: Sequence, second: SecondCamera | None) -> None:
        self._sequence, self.second = sequence, second

    def __len__(self) -> int:
        return len(self._sequence)

    def __getattr__(self, name: str) -> object:
        return getattr(self._sequence, name)


def test_images_of_trackers_stay_and_truth_is_from_this_depth():
    sequence = simulated("pinhole")
    made = with_stereo_depth(sequence)
    assert second_of(sequence) is not None
    assert isinstance(made, Sequence)
    assert made.truths == (TruthKind.birth, TruthKind.raycast)
    np.testing.assert_array_equal(made.image(2), sequence.image(2))
    assert (made.camera, made.id, made.source) == (sequence.camera, sequence.id, sequence.source)
    assert made.notes[-1] == (
        "depth is from semi-global matching with a second camera 0.3 m away; "
        f"a disparity is taken to have a standard deviation of {DISPARITY_SIGMA_PX:g} px"
    )
    copy = pickle.loads(pickle.dumps(made))
    np.testing.assert_array_equal(copy.depth(1).depth_m, made.depth(1).depth_m)


def test_truth_from_stereo_is_off_by_the_disparitys_error_at_most():
    """The camera has moved by less than the baseline after 5 frames: errors of disparity shrink in the image."""
    sequence = simulated("pinhole")
    corners = cv2.goodFeaturesToTrack(sequence.image(0), 500, 0.01, 6)[:, 0].astype(float)
    truth, exact = make_truth(with_stereo_depth(sequence), "birth"), make_truth(sequence, "raycast")
    points, status = truth.anchor(0, corners)
    truly, _ = exact.anchor(0, corners)
    at, seen = truth.locate(5, points)
    expected, visible = exact.locate(5, truly)
    anchored = status == TruthStatus.valid
    both = anchored & (seen == TruthStatus.valid) & (visible == TruthStatus.valid)
    assert both.sum() > 150
    moved = np.linalg.norm((invert(sequence.world_from_camera[0]) @ sequence.world_from_camera[5])[:3, 3])
    assert np.median(np.linalg.norm(at - expected, axis=1)[both]) < DISPARITY_SIGMA_PX * moved / 0.3
    hidden = anchored & (seen == TruthStatus.occluded)
    assert hidden.sum() <= 0.01 * anchored.sum()


def test_what_has_no_second_camera_is_refused():
    with pytest.raises(DataError, match=r'no second camera, expected one, as truth\.depth = "stereo" is set'):
        with_stereo_depth(Paired(simulated("pinhole"), None))


def test_a_second_camera_ahead_of_the_first_is_refused():
    sequence = simulated("pinhole")
    ahead = np.eye(4)
    ahead[2, 3] = 0.5
    with pytest.raises(DataError, match=r"no stereo pair \(.*expected two cameras side by side"):
        with_stereo_depth(Paired(sequence, SecondCamera(sequence.camera, ahead, sequence.image)))


def test_images_of_another_size_are_refused():
    sequence = simulated("pinhole")
    second = SecondCamera(sequence.camera, beside(0), lambda index: np.zeros((10, 10), np.uint8))
    with pytest.raises(DataError, match=r"second camera of shape \(10, 10\), expected shape \(300, 400\)"):
        with_stereo_depth(Paired(sequence, second)).depth(0)
