"""Depths whose noise exceeds a step between surfaces: `check` says that features have no truth, and why."""

import cv2
import numpy as np
import pytest

from tracknoise.sequences.arrays import Sequence
from tracknoise.tables.enumerations import Trust
from tracknoise.truth_faults.check_recording import check_sequence
from tracknoise.truth_faults.check_report import Severity

SHAPE = (120, 160)


def recording(noise):
    """A camera moves sideways before a wall at 4 m, whose depths have a relative noise; without depths for None."""
    random = np.random.default_rng(3)
    texture = cv2.GaussianBlur(random.uniform(0, 255, (120, 240)).astype(np.float32), (0, 0), 1.5)
    wide = cv2.normalize(texture, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    images = [wide[:, 3 * frame : 3 * frame + 160] for frame in range(20)]
    poses = np.tile(np.eye(4), (20, 1, 1))
    poses[:, 0, 3] = 3 * 4.0 / 200 * np.arange(20)
    K = np.array([[200.0, 0, 79.5], [0, 200.0, 59.5], [0, 0, 1]])
    depths = None if noise is None else [4.0 * (1.0 + noise * random.normal(size=SHAPE)) for _ in images]
    return Sequence.from_arrays(images, poses, K, depths)


@pytest.fixture(scope="module")
def noisy():
    return check_sequence(recording(0.04))


def test_noise_that_looks_like_edges_is_a_caveat(noisy) -> None:
    item = next(item for item in noisy.items if item.topic == "depth")
    assert item.severity is Severity.caveat
    assert item.values["edges"] > 0.9
    assert "features there count as beside a depth edge, and have no true position" in item.text
    assert noisy.truth.step.startswith("Smooth the depth maps, or use others")


def test_small_noise_is_none() -> None:
    item = next(item for item in check_sequence(recording(0.002)).items if item.topic == "depth")
    assert item.severity is Severity.ok
    assert "edges" not in item.values


def test_points_are_called_fitted_only_where_there_is_no_depth(noisy) -> None:
    assert noisy.truth.verdict is Trust.unknown
    assert "fitted" not in noisy.truth.text
    assert "stereo depth maps" not in noisy.truth.step
    without = check_sequence(recording(None))
    assert "The recording has no depth maps, and a check computes no depths." in without.truth.text
