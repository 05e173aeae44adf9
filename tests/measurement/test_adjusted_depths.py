"""Errors of stated depths that reference tracks tell: laws are corrected, noise of single maps is lowered."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from tests.measurement.planes import FRAMES, PLANE_M, depths_of, images_of, moving, recorded, walked
from tests.truth.test_pose_adjustment import Made, made, spoilt

from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.geometry.depth import DepthMap
from tracknoise.measurement.adjusted_depths import depth_corrections
from tracknoise.measurement.refined_poses import refined, refined_by
from tracknoise.truth.accuracies import DEFAULT_RULE
from tracknoise.truth.birth import BirthDepths
from tracknoise.truth.visibility import SequenceGeometry

NOTHING = TruthAccuracy()


def stating(one: Made, depth_m: np.ndarray, poses: np.ndarray | None = None):
    """Refined poses of exact tracks of two kinds that state these depths."""
    tracks = replace(one.tracks, depth_m=depth_m, kind=np.arange(len(depth_m)) % 2)
    stated = one.stated(spoilt(one.poses) if poses is None else poses)
    return refined_by(stated, tracks, NOTHING, len(one.poses))


@pytest.mark.parametrize(
    "law", [lambda z: 1.0 / (1.0 / z + 0.03), lambda z: 1.0 / (1.0 / z - 0.02), lambda z: z - 0.3, lambda z: z + 0.2]
)
def test_corrected_depths_are_right_but_for_the_scale_of_poses_that_are_wrong_too(law):
    one = made(0.03)
    exact_m = one.tracks.depth_m
    fit = stating(one, law(exact_m))[1]
    assert fit.leads
    (name,) = fit.corrections
    assert f"{fit.corrections[name]:.3g} " in fit.of_depths
    ratios = depth_corrections(fit.corrections).depths_m(law(exact_m)) / exact_m, law(exact_m) / exact_m
    corrected, stated = (np.std(ratio / np.median(ratio)) for ratio in ratios)
    assert corrected < 0.4 * stated


def test_wrong_poses_alone_change_no_depths():
    one = made(0.03)
    fit = stating(one, one.tracks.depth_m)[1]
    assert fit.leads
    assert not fit.corrections
    assert fit.of_depths == ""


def test_a_scale_of_depths_is_that_of_the_poses():
    one = made(0.03)
    fit = stating(one, 1.2 * one.tracks.depth_m, one.poses)[1]
    assert fit.leads
    assert not fit.corrections


POSES = moving()
IMAGES = images_of(POSES)


def noisy(size: float) -> list[DepthMap]:
    """Depth maps with relative noise over a few pixels, another one in each frame."""
    rng = np.random.default_rng(2)
    found = []
    for one in depths_of(POSES):
        noise = gaussian_filter(rng.standard_normal(one.depth_m.shape), 3.0)
        found.append(replace(one, depth_m=one.depth_m * (1.0 + size * noise / noise.std())))
    return found


def test_noisy_maps_are_joined_and_exact_ones_are_not():
    stated = walked(POSES)
    found, fit = refined(recorded(stated, IMAGES, noisy(0.02)), "birth", DEFAULT_RULE, FRAMES)
    assert fit.joins_depths
    assert "joined" in fit.of_depths
    uv = np.random.default_rng(0).uniform([40, 40], [160, 110], (200, 2))
    joined, single = (BirthDepths(SequenceGeometry(one)).of(3, uv)[0] for one in (found, found.sequence))
    exact = BirthDepths(SequenceGeometry(recorded(POSES, IMAGES, depths_of(POSES)))).of(3, uv)[0]
    errors = [np.median(np.abs(one / exact - 1.0)) for one in (joined, single)]
    assert errors[0] < 0.6 * errors[1]
    assert exact.mean() == pytest.approx(PLANE_M, rel=0.2)
    assert not refined(recorded(stated, IMAGES, depths_of(POSES)), "birth", DEFAULT_RULE, FRAMES)[1].joins_depths
