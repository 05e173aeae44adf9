"""Random errors of depths are measured by maps of other frames, without a tracker."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from tests.truth_faults.planted import Planted

from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.truth_faults.depth_repeats import depth_repeats, repeatability
from tracknoise.truth_faults.image_evidence import Evidence


@pytest.fixture(scope="module")
def recording():
    return open_sequence("simulated", motions=("sideways",), frames=12, width=320, height=240, supersampling=1)


def noisy(sequence, per_m):
    """Independent noise in each map, of a standard deviation of `per_m` times the squared depth."""
    rng = np.random.default_rng(4)

    def depths(depth_m, _):
        noise = gaussian_filter(rng.standard_normal(depth_m.shape), 2.0)
        return depth_m + per_m * depth_m**2 * noise / noise.std()

    return Planted(sequence, depths=depths)


def births(sequence, frames=(0, 3, 6)):
    """Points on a grid in some frames, with the depths of their maps: frame, position, depth."""
    v, u = (axis.ravel() for axis in np.mgrid[10:230:11, 10:310:11])
    maps = [sequence.depth(frame) for frame in frames]
    depth = np.concatenate([one.depth_m[v, u] for one in maps]).astype(float)
    return np.repeat(frames, len(u)), np.tile(np.stack([u, v], axis=1).astype(float), (len(frames), 1)), depth


@pytest.mark.parametrize("per_m", [0.001, 0.004])
def test_planted_noise_comes_back_at_each_depth(recording, per_m):
    sequence = noisy(recording, per_m)
    found = depth_repeats(sequence, *births(sequence))
    assert len(found.depth_m) == 4
    assert found.relative / found.depth_m == pytest.approx(per_m, rel=0.5)
    assert np.median(found.relative / found.depth_m) == pytest.approx(per_m, rel=0.2)
    assert found.at(found.depth_m) == pytest.approx(found.relative)


def test_an_error_of_a_pose_along_the_axis_is_no_noise_of_depths(recording):
    def nearer(poses):
        moved = poses.copy()
        moved[5::2, :3, 3] += 0.01 * moved[5::2, :3, 2]
        return moved

    sequence = Planted(recording, poses=nearer)
    found = depth_repeats(sequence, *births(sequence))
    assert found.relative.max() < 2e-3


def test_exact_depths_have_no_noise(recording):
    assert depth_repeats(recording, *births(recording)).relative.max() < 1e-4


def test_too_few_points_say_nothing(recording):
    frame, uv, depth = (values[:10] for values in births(recording))
    found = depth_repeats(recording, frame, uv, depth)
    assert not len(found.depth_m)
    assert np.isnan(found.at(np.array([1.0, 2.0]))).all()


def test_a_check_says_how_well_depths_repeat(recording):
    item = repeatability(Evidence.measured(noisy(recording, 0.002)))
    assert item.values["near_relative"] == pytest.approx(0.002 * item.values["near_m"], rel=0.5)
    assert "show a standard deviation of single depths of" in item.text
