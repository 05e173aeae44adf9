"""GTSAM finds the same poses, covariances and consistency as the bundle adjustment here."""

import numpy as np
import pytest

pytest.importorskip("gtsam", reason="needs the extra tracknoise[proof]")

from benchmarks.gtsam_judge import newest_pose_by_gtsam
from benchmarks.noise.arms import PlantedNoise, one_sigma, perturbed, whole_tracks
from benchmarks.noise.bundle import Assumption, adjust
from benchmarks.noise.windows import between
from benchmarks.planted_windows import simulated_problem

from tracknoise.estimators.kernels import NEWEST, normalised
from tracknoise.estimators.linear_window import Motion
from tracknoise.inference.track_noise import TrackNoise

NOISE = TrackNoise.isotropic(first=0.2, white=0.1, walk=0.08)


@pytest.mark.parametrize("motion", Motion)
@pytest.mark.parametrize("arm", ["one sigma", "whole tracks"])
def test_gtsam_agrees(motion: Motion, arm: str) -> None:
    problem = simulated_problem(motion, PlantedNoise(noise=NOISE), n_frames=5, n_tracks=25, seed=2)
    covariances = one_sigma(problem, 0.3) if arm == "one sigma" else whole_tracks(problem, NOISE)
    start = perturbed(problem)
    own = adjust(problem, start, Assumption(covariances))
    pose, covariance, nees = newest_pose_by_gtsam(problem, start, Assumption(covariances))
    error = between(problem.gauge, own.poses, problem.world_from_camera)[-NEWEST:]
    assert np.allclose(own.poses[-1], pose, atol=1e-8)
    assert np.allclose(own.claimed[-NEWEST:, -NEWEST:], covariance, rtol=1e-6, atol=1e-12)
    assert normalised(error, own.claimed[-NEWEST:, -NEWEST:]) == pytest.approx(nees, rel=1e-6)
