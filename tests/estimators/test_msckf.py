"""The filter is consistent where its noise is right, and says so where it is not."""

import numpy as np
import pytest
from benchmarks.msckf import Filtered, inertial_problem, run_filter

from tracknoise.estimators.track_noise import TrackNoise
from tracknoise.estimators.trial import PlantedNoise, one_sigma, whole_tracks

WHITE = PlantedNoise(noise=TrackNoise.isotropic(first=0.3, white=0.3))
WALK = PlantedNoise(noise=TrackNoise.isotropic(walk=0.1))
_RUNS, _FRAMES = 4, 25


def _filtered(planted: PlantedNoise, sigma: float | None, **gate: float) -> list[Filtered]:
    found = []
    for seed in range(_RUNS):
        problem = inertial_problem(planted, n_frames=_FRAMES, per_frame=5, seed=seed)
        vision = problem.vision
        covariances = whole_tracks(vision, planted.noise) if sigma is None else one_sigma(vision, sigma)
        found.append(run_filter(problem, covariances, seed=seed, **gate))
    return found


def _nees(found: list[Filtered]) -> float:
    return float(np.mean([one.nees for one in found]))


def _passed(found: list[Filtered]) -> float:
    return float(np.mean([one.passed for one in found]))


def test_right_noise_is_consistent_and_passes_the_gate() -> None:
    found = _filtered(WHITE, 0.3)
    assert 0.5 < _nees(found) < 1.6
    assert _passed(found) == pytest.approx(0.95, abs=0.03)
    assert np.mean([one.innovations for one in found]) == pytest.approx(1.0, abs=0.1)
    problem = inertial_problem(WHITE, n_frames=_FRAMES, per_frame=5, seed=0)
    apart = found[0].poses[:, :3, 3] - problem.vision.world_from_camera[:, :3, 3]
    assert np.linalg.norm(apart, axis=1).max() < 0.03


def test_a_quarter_of_the_variance_is_overconfident() -> None:
    wide = {"gate": 1e6}
    assert _nees(_filtered(WHITE, 0.15, **wide)) > 1.5 * _nees(_filtered(WHITE, 0.3, **wide))
    assert _passed(_filtered(WHITE, 0.15)) < 0.2


def test_under_a_walk_the_sigma_of_innovations_is_overconfident_and_whole_tracks_are_not() -> None:
    scalar, whole = _filtered(WALK, 0.121), _filtered(WALK, None)
    assert np.mean([one.innovations for one in scalar]) == pytest.approx(1.0, abs=0.15)
    assert _nees(scalar) > 1.5 * _nees(whole)
    assert 0.5 < _nees(whole) < 1.6
