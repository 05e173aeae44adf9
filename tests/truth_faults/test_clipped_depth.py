"""Depths that were clipped stand for everything farther away: `check` says so."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from tests.truth_faults.planted import Planted

from tracknoise.sequences.arrays import Sequence
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.truth_faults.check_recording import check_sequence
from tracknoise.truth_faults.check_report import Severity
from tracknoise.truth_faults.depth_checks import clipped_depth
from tracknoise.truth_faults.image_evidence import Evidence


def clipped(sequence, share):
    """Depths above a quantile of those of the first frame become this quantile."""
    first = sequence.depth(0)
    largest = float(np.quantile(first.depth_m[first.valid], 1 - share))
    return Planted(sequence, depths=lambda depth_m, _: np.minimum(depth_m, largest)), largest


@pytest.fixture(params=["tartanair", "simulated"])
def recording(request, sample):
    if request.param == "tartanair":
        return open_sequence("tartanair", sample("tartanair_v2"))
    return open_sequence("simulated", motions=("sideways",), frames=12, width=320, height=240, supersampling=1)


def test_clipped_depths_are_a_caveat(recording):
    sequence, largest = clipped(recording, 0.4)
    item = clipped_depth(Evidence.measured(sequence))
    assert item.severity is Severity.caveat
    assert item.values["largest_m"] == pytest.approx(largest)
    assert item.values["share"] > 0.1
    assert "were probably clipped" in item.text


def test_nothing_is_said_about_depths_that_are_right(recording):
    assert clipped_depth(Evidence.measured(recording)) is None


@pytest.fixture
def wall():
    """A camera of focal length 200 px moves sideways before a wall at 4 m, by 3 px of image motion a frame."""
    texture = cv2.GaussianBlur(np.random.default_rng(3).uniform(0, 255, (120, 240)).astype(np.float32), (0, 0), 1.5)
    wide = cv2.normalize(texture, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    images = [wide[:, 3 * frame : 3 * frame + 160] for frame in range(20)]
    poses = np.tile(np.eye(4), (20, 1, 1))
    poses[:, 0, 3] = 3 * 4.0 / 200 * np.arange(20)
    K = np.array([[200.0, 0, 79.5], [0, 200.0, 59.5], [0, 0, 1]])
    return Sequence.from_arrays(images, poses, K, [np.full((120, 160), 4.0)] * 20)


def test_a_wall_at_the_largest_depth_is_not_clipped(wall):
    assert clipped_depth(Evidence.measured(wall)) is None


def test_nothing_is_said_without_depth(wall):
    assert clipped_depth(Evidence.measured(replace(wall, depths=None))) is None


def test_a_mistake_that_explains_all_depths_comes_first(wall):
    """The wall is at 4 m, and all depths are 2 m: so it would be with intrinsics of images of another size."""
    items = check_sequence(Planted(wall, depths=lambda depth_m, _: np.minimum(depth_m, 2.0))).items
    assert "clipped depth" not in {item.topic for item in items}
