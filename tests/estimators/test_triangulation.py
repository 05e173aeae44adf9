"""The cheap proof: what triangulated distances say of the sigma of residuals, the consistent one, and whole tracks."""

from functools import cache

import polars as pl
import pytest
from benchmarks.noise.arms import PlantedNoise
from benchmarks.noise.proof import learn_sigmas, triangulate
from benchmarks.noise.windows import Problem
from benchmarks.planted_windows import simulated_problem

from tracknoise.estimators.linear_window import Motion
from tracknoise.inference.track_noise import TrackNoise

WHITE, WALK = TrackNoise.isotropic(first=0.3, white=0.3), TrackNoise.isotropic(walk=0.1)


@cache
def _windows(noise: TrackNoise, first: int) -> tuple[Problem, ...]:
    planted = PlantedNoise(noise=noise)
    return tuple(
        simulated_problem(Motion.SIDEWAYS, planted, seed=first + place, scene=f"scene {place}") for place in range(10)
    )


@cache
def _found(noise: TrackNoise) -> dict[tuple[str, str], float]:
    table = triangulate(_windows(noise, 0), learn_sigmas(_windows(noise, 100)), noise)
    return {(name, quantity): value for name, quantity, value in table.select(pl.nth(0, 1, 2)).iter_rows()}


def test_both_sigmas_are_the_planted_one_under_independent_noise() -> None:
    found = learn_sigmas(_windows(WHITE, 0))
    assert found.residual_px == pytest.approx(0.3, rel=0.03)
    assert found.consistent_px == pytest.approx(0.3, rel=0.1)


@pytest.mark.parametrize("covariance", ["residual sigma", "consistent sigma", "whole tracks"])
def test_intervals_contain_what_they_claim_under_independent_noise(covariance: str) -> None:
    found = _found(WHITE)
    assert found[covariance, "coverage_95"] == pytest.approx(0.95, abs=0.03)
    assert found[covariance, "z_square"] == pytest.approx(1.0, abs=0.2)
    assert found[covariance, "error_ratio"] == pytest.approx(1.0, abs=0.01)


def test_the_sigma_of_residuals_is_overconfident_under_a_walk_and_whole_tracks_are_not() -> None:
    found = _found(WALK)
    assert found["residual sigma", "coverage_95"] < 0.75
    assert found["consistent sigma", "coverage_95"] == pytest.approx(0.95, abs=0.03)
    assert found["whole tracks", "coverage_95"] == pytest.approx(0.95, abs=0.03)
    assert found["whole tracks", "error_ratio"] < 1.0
    assert found["1 px", "coverage_95"] > 0.99


def test_intervals_are_over_scenes() -> None:
    table = triangulate(_windows(WHITE, 0), learn_sigmas(_windows(WHITE, 100)), WHITE)
    row = table.filter(covariance="whole tracks", quantity="coverage_95").row(0, named=True)
    assert row["scenes"] == 10
    assert row["low"] < row["value"] < row["high"]
