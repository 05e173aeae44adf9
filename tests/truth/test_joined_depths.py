"""Depths of features are joined from maps of other frames, without those of another surface."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from tests.measurement.planes import CAMERA, HEIGHT, WIDTH, depths_of, images_of, moving, recorded

from tracknoise.geometry.depth import DepthMap, sample
from tracknoise.truth.joined_depths import JoinedDepths
from tracknoise.truth.visibility import SequenceGeometry

POSES = moving()
UV = np.random.default_rng(1).uniform([50, 45], [150, 105], (40, 2))


def joined(depths, own=None):
    geometry = SequenceGeometry(recorded(POSES, images_of(POSES[:1]) * len(POSES), depths))
    exact = -(POSES[3, 2, 3] - 3.0) / (CAMERA.bearings(UV) @ POSES[3, 2, :3])
    return JoinedDepths(geometry).of(3, UV, exact if own is None else own * exact)[0] / exact


def test_exact_maps_keep_exact_depths():
    assert joined(depths_of(POSES)) == pytest.approx(1.0, abs=1e-4)


def test_an_error_of_one_map_is_outvoted():
    assert joined(depths_of(POSES), own=1.02) == pytest.approx(1.0, abs=1e-3)


def test_errors_are_those_of_noise_that_is_planted():
    rng = np.random.default_rng(3)
    depths = [
        DepthMap(
            one.depth_m * (1.0 + 0.01 * gaussian_filter(rng.standard_normal((HEIGHT, WIDTH)), 3.0) * 10.6), one.valid
        )
        for one in depths_of(POSES)
    ]
    geometry = SequenceGeometry(recorded(POSES, images_of(POSES[:1]) * len(POSES), depths))
    found_m, sigma_m = JoinedDepths(geometry).of(3, UV, sample(depths[3], UV, CAMERA).depth_m)
    exact_m = (3.0 - POSES[3, 2, 3]) / (CAMERA.bearings(UV) @ POSES[3, 2, :3])
    assert np.sqrt(np.mean((found_m - exact_m) ** 2)) == pytest.approx(np.sqrt(np.mean(sigma_m**2)), rel=0.4)


def test_maps_that_see_something_nearer_do_not_count():
    depths = depths_of(POSES)
    hidden = [
        DepthMap(np.full((HEIGHT, WIDTH), 1.0), one.valid) if index in (1, 2, 5) else one
        for index, one in enumerate(depths)
    ]
    assert joined(hidden) == pytest.approx(1.0, abs=1e-3)


def test_frames_without_other_maps_keep_their_own():
    nothing = [
        DepthMap(one.depth_m, one.valid if index == 3 else np.zeros_like(one.valid))
        for index, one in enumerate(depths_of(POSES))
    ]
    assert np.array_equal(joined(nothing, own=1.02), np.full(len(UV), 1.02))
