"""Depths of features are joined from maps of other frames, without those of another surface."""

import numpy as np
import pytest
from tests.measurement.planes import CAMERA, HEIGHT, WIDTH, depths_of, images_of, moving, recorded

from tracknoise.geometry.depth import DepthMap
from tracknoise.truth.joined_depths import JoinedDepths
from tracknoise.truth.visibility import SequenceGeometry

POSES = moving()
UV = np.random.default_rng(1).uniform([50, 45], [150, 105], (40, 2))


def joined(depths, own=None):
    geometry = SequenceGeometry(recorded(POSES, images_of(POSES[:1]) * len(POSES), depths))
    exact = -(POSES[3, 2, 3] - 3.0) / (CAMERA.bearings(UV) @ POSES[3, 2, :3])
    return JoinedDepths(geometry).of(3, UV, exact if own is None else own * exact) / exact


def test_exact_maps_keep_exact_depths():
    assert joined(depths_of(POSES)) == pytest.approx(1.0, abs=1e-4)


def test_an_error_of_one_map_is_outvoted():
    assert joined(depths_of(POSES), own=1.02) == pytest.approx(1.0, abs=1e-3)


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
