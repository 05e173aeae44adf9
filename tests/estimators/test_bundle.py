"""The bundle adjustment finds exact poses, and its covariance is that of linear algebra."""

import numpy as np
import pytest
from benchmarks.noise.arms import PlantedNoise, perturbed
from benchmarks.noise.bundle import Adjusted, Assumption, StudentLoss, adjust, cost
from benchmarks.noise.windows import Problem, between
from benchmarks.planted_windows import simulated_problem
from scipy import integrate, stats

from tracknoise.estimators.linear_window import (
    CAMERA,
    Motion,
    PointTracks,
    linear_tracks,
    outcome,
    scalar_variances,
    true_covariances,
)
from tracknoise.estimators.losses import Loss, LossKind
from tracknoise.inference.track_noise import TrackNoise

WHITE = PlantedNoise(noise=TrackNoise.isotropic(first=0.3, white=0.3))


def _scalar(problem: Problem, sigma: float) -> list[np.ndarray]:
    shapes = [group.uv.shape for group in problem.groups]
    return [np.tile(sigma**2 * np.eye(2 * n), (count, 1, 1)) for count, n, _ in shapes]


def _adjusted(problem: Problem, assumption: Assumption) -> Adjusted:
    return adjust(problem, perturbed(problem), assumption)


@pytest.mark.parametrize("motion", Motion)
@pytest.mark.parametrize("kind", LossKind)
def test_exact_tracks_give_exact_poses(motion: Motion, kind: LossKind) -> None:
    problem = simulated_problem(motion, PlantedNoise(), n_tracks=40, n_frames=6)
    found = _adjusted(problem, Assumption(_scalar(problem, 1.0), Loss(kind, 1.345)))
    assert np.allclose(found.poses, problem.world_from_camera, atol=1e-9)
    assert all(
        np.allclose(own, group.points, atol=1e-6) for own, group in zip(found.points, problem.groups, strict=True)
    )
    assert found.converged


@pytest.mark.parametrize("motion", Motion)
def test_claimed_covariance_at_the_truth_is_that_of_the_linear_benchmark(motion: Motion) -> None:
    problem = simulated_problem(motion, PlantedNoise())
    window = [
        linear_tracks(CAMERA, problem.world_from_camera, PointTracks(group.frames, group.points))
        for group in problem.groups
    ]
    noise = TrackNoise.isotropic(first=0.2, white=0.1, walk=0.08)
    covariances = true_covariances(window, noise)
    stated = outcome(window, covariances, covariances)
    found = _adjusted(problem, Assumption(covariances))
    assert np.allclose(np.diag(found.claimed), np.diag(stated.claimed), rtol=1e-6)


def test_four_times_the_covariance_leaves_poses_unchanged_and_quarters_the_errors() -> None:
    problem = simulated_problem(Motion.SIDEWAYS, WHITE, seed=3)
    one, two = (_adjusted(problem, Assumption(_scalar(problem, sigma))) for sigma in (0.3, 0.6))
    assert np.allclose(one.poses, two.poses, atol=1e-9)
    assert np.allclose(4.0 * one.claimed, two.claimed, rtol=1e-6)
    assert one.innovations == pytest.approx(4.0 * two.innovations)


def test_errors_have_the_covariance_that_linear_algebra_states() -> None:
    n_windows, errors = 60, []
    for seed in range(n_windows):
        problem = simulated_problem(Motion.SIDEWAYS, WHITE, n_frames=6, n_tracks=40, seed=seed)
        found = _adjusted(problem, Assumption(_scalar(problem, 0.3)))
        error = between(problem.gauge, found.poses, problem.world_from_camera)
        errors.append(error @ np.linalg.solve(found.claimed, error) / len(error))
    spread = np.sqrt(2.0 / (len(error) * n_windows))
    assert np.mean(errors) == pytest.approx(1.0, abs=4.0 * spread)


def test_a_gross_outlier_moves_a_robust_estimate_less() -> None:
    problem = simulated_problem(Motion.SIDEWAYS, WHITE, seed=1)
    spoilt = tuple(group.uv.copy() for group in problem.groups)
    spoilt[-1][0, -1] += 40.0
    wrong = problem.with_uv(spoilt)
    moved = [
        np.linalg.norm(
            _adjusted(wrong, Assumption(_scalar(problem, 0.3), loss)).poses
            - _adjusted(problem, Assumption(_scalar(problem, 0.3), loss)).poses
        )
        for loss in (Loss(), Loss(LossKind.HUBER, 1.345), Loss(LossKind.CAUCHY, 2.385))
    ]
    assert moved[1] < 0.2 * moved[0]
    assert moved[2] < 0.05 * moved[0]


def test_scalar_variances_of_the_benchmark_are_those_of_a_window() -> None:
    problem = simulated_problem(Motion.SIDEWAYS, PlantedNoise(), n_tracks=10)
    window = [
        linear_tracks(CAMERA, problem.world_from_camera, PointTracks(group.frames, group.points))
        for group in problem.groups
    ]
    for own, other in zip(_scalar(problem, 0.4), scalar_variances(window, 0.4), strict=True):
        assert np.array_equal(own, other[:, :, None] * np.eye(other.shape[1]))


@pytest.mark.parametrize("square", [0.5, 4.0, 40.0])
def test_the_cost_of_a_track_is_that_of_its_scale_and_point_integrated_out(square: float) -> None:
    nu, size = 3.0, 8
    loss = StudentLoss(nu)

    def integral(square: float) -> float:
        def density(g: float) -> float:
            return stats.gamma(nu / 2.0, scale=2.0 / nu).pdf(g) * g ** ((size - 3) / 2.0) * np.exp(-g * square / 2.0)

        return integrate.quad(density, 0.0, np.inf)[0]

    whitened = np.zeros((1, size))
    whitened[0, 0] = np.sqrt(square)
    assert cost(loss, whitened) == pytest.approx(-2.0 * np.log(integral(square) / integral(0.0)), rel=1e-6)
    step = 1e-4
    costs = [cost(loss, whitened * np.sqrt(1.0 + sign * step / square)) for sign in (1.0, -1.0)]
    assert loss.weights(whitened)[0, 0] == pytest.approx((costs[0] - costs[1]) / (2.0 * step), rel=1e-5)
