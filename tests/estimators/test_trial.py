"""Trials of noise assumptions on simulated tracks: what helps, what does not, and what must not seem to."""

from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl
import pytest
from benchmarks.planted_windows import (
    simulated_problem,
    with_drift_reversed,
    with_noise_of,
    with_permuted_covariates,
    with_permuted_errors,
)
from scipy import stats

from tracknoise.estimators import learning
from tracknoise.estimators.bundle import Assumption, Loss, LossKind, adjust, expected_nees, gate_ratios
from tracknoise.estimators.learning import learn, mean_drift, sample_of_windows, student_of_errors
from tracknoise.estimators.linear_window import Motion
from tracknoise.estimators.model import log_factor
from tracknoise.estimators.proof import Verdict, sentence, summarise, verdict
from tracknoise.estimators.proof_windows import Problem, errors_of
from tracknoise.estimators.track_likelihood import TrackLaw
from tracknoise.estimators.trial import (
    ARMS,
    GATED,
    TEXTURE,
    Beliefs,
    Gated,
    PlantedNoise,
    one_sigma,
    perturbed,
    try_arms,
    whole_tracks,
)
from tracknoise.inference.track_noise import TrackNoise

WHITE = PlantedNoise(noise=TrackNoise.isotropic(first=0.3, white=0.3))
MIXED = PlantedNoise(noise=TrackNoise.isotropic(first=0.1, white=0.2, walk=0.1))
TEXTURED = PlantedNoise(noise=TrackNoise.isotropic(first=0.1, white=0.4), texture_exponent=1.0)


def _windows(planted: PlantedNoise, count: int, first: int, *, n_frames: int = 6) -> list[Problem]:
    return [
        simulated_problem(
            Motion.SIDEWAYS, planted, n_frames=n_frames, n_tracks=30, seed=first + place, scene=f"scene {place // 2}"
        )
        for place in range(count)
    ]


@cache
def _learned(planted: PlantedNoise) -> Beliefs:
    return learn(_windows(planted, 6, 1000), planted=planted)


def _untuned(windows: list[Problem], planted: PlantedNoise | None = None) -> Beliefs:
    """What is learned of the noise alone: no knee and no gate is tried, which takes most of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(learning, "tuned", lambda beliefs, _: beliefs)
        return learn(windows, planted=planted)


@cache
def _textured() -> Beliefs:
    return _untuned(_windows(TEXTURED, 6, 1000), TEXTURED)


def _sigmas(noise: TrackNoise) -> list[float]:
    return [float(np.sqrt(part[0, 0])) for part in (noise.first, noise.white, noise.walk)]


def test_planted_components_come_back() -> None:
    fitted = sample_of_windows(_windows(MIXED, 30, 0, n_frames=11)).fitted(TrackLaw(), ()).noise
    assert _sigmas(fitted) == pytest.approx([0.1, 0.2, 0.1], abs=0.02)


def test_planted_texture_comes_back() -> None:
    law = _textured().by_quality
    (texture,) = law.conditions
    assert texture.of == TEXTURE
    assert np.diff(log_factor(texture, np.exp([-0.5, 0.5]))) == pytest.approx(-2.0, abs=0.2)
    (of_one,) = np.exp(0.5 * log_factor(texture, np.array([1.0])))
    assert of_one * _sigmas(law.noise)[1] == pytest.approx(0.4, abs=0.03)


def test_tracks_of_one_scale_are_not_given_their_own() -> None:
    beliefs = _learned(MIXED)
    assert np.isinf(beliefs.scaled.nu)
    assert beliefs.scaled_by_quality.conditions == ()


def test_a_scale_of_each_track_is_learned_from_windows() -> None:
    beliefs = _untuned(_windows(replace(MIXED, track_nu=3.0), 12, 0))
    assert beliefs.scaled.nu == pytest.approx(3.0, rel=0.3)
    assert _sigmas(beliefs.scaled.noise) == pytest.approx([0.1, 0.2, 0.1], abs=0.03)


def test_a_tuned_knee_is_consistent_on_its_windows() -> None:
    windows, beliefs = _windows(WHITE, 6, 1000), _learned(WHITE)
    trial = try_arms(windows, beliefs, arms=["8d"])
    assert trial["nees_newest"].mean() == pytest.approx(1.0, rel=1e-3)


def test_planted_drift_and_tails_come_back() -> None:
    planted = PlantedNoise(
        noise=TrackNoise.isotropic(first=0.3, white=0.3), student_nu=4.0, bias_px_per_frame=(0.05, -0.02)
    )
    windows = _windows(planted, 20, 0)
    assert mean_drift(windows) == pytest.approx([0.05, -0.02], abs=0.01)
    assert student_of_errors(_windows(PlantedNoise(noise=WHITE.noise, student_nu=4.0), 20, 0))[0] == pytest.approx(
        4.0, abs=0.8
    )
    assert student_of_errors(_windows(WHITE, 20, 0))[0] > 30.0


def test_errors_that_are_zero_but_for_rounding_are_no_errors() -> None:
    """In a run the first position of a track fixes the true one."""
    windows = _windows(PlantedNoise(noise=TrackNoise.isotropic(white=0.3)), 6, 0)
    rounded = [
        window.with_uv(tuple(group.uv + 1e-13 * (group.ages == 0)[..., None] for group in window.groups))
        for window in windows
    ]
    (_, exact), (_, scale) = student_of_errors(windows), student_of_errors(rounded)
    assert exact == pytest.approx(0.3**2, rel=0.1)
    assert scale == pytest.approx(exact, rel=1e-3)


def test_errors_in_common_are_in_all_tracks_of_a_frame() -> None:
    planted = PlantedNoise(noise=TrackNoise.isotropic(first=0.3, white=0.3), common_share=0.5)
    last = [errors_of(window)[-1][:, -1].mean(axis=0) for window in _windows(planted, 60, 0)]
    assert np.mean(np.square(last)) == pytest.approx(0.5 * 0.3**2, rel=0.4)


@pytest.mark.parametrize(
    ("loss", "nu", "scale", "nees"),
    [
        (Loss(LossKind.HUBER, 1.345), np.inf, 1.0, 0.96),
        (Loss(LossKind.HUBER, 1.0), np.inf, 1.0, 0.89),
        (Loss(LossKind.HUBER, 2.45), np.inf, 1.0, 1.00),
        (Loss(LossKind.CAUCHY, 1.0), np.inf, 1.0, 0.61),
        (Loss(LossKind.CAUCHY, 2.385), np.inf, 1.0, 0.83),
        (Loss(LossKind.CAUCHY, 5.0**0.5), 3.0, (5.0 / 3.0) ** 0.5, 1.40),
        (Loss(LossKind.CAUCHY, 6.0**0.5), 4.0, 1.5**0.5, 4.0 / 3.0),
        (Loss(LossKind.HUBER, 1.345), 4.0, 1.0, 1.12),
    ],
)
def test_right_models_under_robust_losses_have_their_own_nees(loss, nu, scale, nees) -> None:
    assert expected_nees(loss, nu=nu, scale=scale) == pytest.approx(nees, abs=0.006)


def test_control_1_under_independent_noise_all_arms_tie() -> None:
    trial = try_arms(_windows(WHITE, 12, 0), _learned(WHITE), arms=["0", "1", "3", "4", "6", "U"])
    found = summarise(trial)
    ratios = found.filter(pl.col("quantity").str.ends_with("_ratio"))["value"].to_numpy()
    assert ratios == pytest.approx(1.0, abs=0.02)
    nees = dict(found.filter(quantity="nees_all").select("arm", "value").iter_rows())
    assert nees["U"] == pytest.approx(1.0, abs=3.0 * np.sqrt(2.0 / (12 * 29)))
    assert nees["6"] == pytest.approx(nees["U"], rel=0.05)
    assert nees["0"] == pytest.approx(0.09 * nees["U"], rel=0.01)


def test_control_2_a_covariate_of_other_tracks_does_not_help() -> None:
    beliefs, windows = _textured(), _windows(TEXTURED, 16, 0)
    gain, none = (
        _mean_log_ratio(try_arms(part, beliefs, arms=["1", "6b"]), "6b")
        for part in (windows, with_permuted_covariates(windows))
    )
    assert gain < -0.1
    assert none > gain + 0.1
    assert none > -0.02


def _mean_log_ratio(trial: pl.DataFrame, arm: str) -> float:
    rows = summarise(trial).filter(pl.col("quantity").str.ends_with("_ratio"), arm=arm)
    return float(np.log(rows["value"].to_numpy()).mean())


def test_control_3_keeps_errors_by_place_and_makes_them_independent() -> None:
    windows = _windows(PlantedNoise(noise=TrackNoise.isotropic(walk=0.1)), 30, 0)
    changed = with_permuted_errors(windows)
    kept, lost = [], []
    for before, after in zip(windows, changed, strict=True):
        old, new = errors_of(before)[-1], errors_of(after)[-1]
        assert np.allclose(np.sort(old, axis=0), np.sort(new, axis=0))
        kept.append(old[:, -1] * old[:, -2])
        lost.append(new[:, -1] * new[:, -2])
    assert np.concatenate(kept).mean() > 3.0 * abs(np.concatenate(lost).mean())


def test_controls_4_and_5_change_the_beliefs() -> None:
    own, other = _learned(MIXED), _learned(WHITE)
    assert with_noise_of(own, other).noise is other.noise
    assert np.array_equal(with_drift_reversed(own).drift_px, -own.drift_px)


def test_control_6_four_times_the_covariance_leaves_poses_unchanged() -> None:
    (problem,) = _windows(MIXED, 1, 7)
    covariances = whole_tracks(problem, MIXED.noise)
    one = adjust(problem, perturbed(problem), Assumption(covariances))
    four = adjust(problem, perturbed(problem), Assumption([4.0 * part for part in covariances]))
    assert np.allclose(one.poses, four.poses, atol=1e-9)
    assert np.allclose(4.0 * one.claimed, four.claimed, rtol=1e-6)


def test_a_correction_of_a_real_drift_helps_and_its_opposite_hurts() -> None:
    planted = PlantedNoise(noise=TrackNoise.isotropic(first=0.1, white=0.1), bias_px_per_frame=(0.1, 0.05))
    beliefs, windows = _untuned(_windows(planted, 6, 1000), planted), _windows(planted, 8, 0)
    helped = _mean_log_ratio(try_arms(windows, beliefs, arms=["1", "7b"]), "7b")
    hurt = _mean_log_ratio(try_arms(windows, with_drift_reversed(beliefs), arms=["1", "7b"]), "7b")
    assert helped < -0.1
    assert hurt > 0.1


def test_a_gate_at_true_poses_is_that_of_chi_square() -> None:
    ratios = []
    for window in _windows(WHITE, 40, 0):
        covariances = one_sigma(window, 0.3)
        found = adjust(window, perturbed(window), Assumption(covariances))
        true = replace(found, poses=window.world_from_camera, points=tuple(group.points for group in window.groups))
        ratios += gate_ratios(window, true, covariances)
    every = np.concatenate(ratios)
    assert np.mean(every <= 1.0) == pytest.approx(0.95, abs=0.02)
    assert np.mean(every <= 0.5) == pytest.approx(stats.chi2.cdf(0.5 * stats.chi2.ppf(0.95, 9), 9), abs=0.04)


def test_a_gate_leaves_out_tracks_that_jumped() -> None:
    beliefs = replace(_learned(WHITE), gated=Gated(sigma_px=0.3, factor=1.0), tuned_px=0.3)
    jumped = [_with_jumps(window, 4.0) for window in _windows(WHITE, 8, 0)]
    assert _mean_log_ratio(try_arms(jumped, beliefs, arms=["1", GATED]), GATED) < -0.5
    assert _mean_log_ratio(try_arms(_windows(WHITE, 8, 0), beliefs, arms=["1", GATED]), GATED) == pytest.approx(
        0.0, abs=0.1
    )


def test_where_too_few_tracks_pass_a_gate_all_are_used() -> None:
    beliefs = replace(_learned(WHITE), gated=Gated(sigma_px=0.3, factor=1e-6), tuned_px=0.3)
    trial = try_arms(_windows(WHITE, 2, 0), beliefs, arms=["1", GATED])
    (own,), (gated,) = (trial.filter(arm=arm, window=0)["position_m"] for arm in ("1", GATED))
    assert gated == pytest.approx(own, rel=1e-6)


def _with_jumps(problem: Problem, jump_px: float) -> Problem:
    """Every sixth track jumps in its last observation."""
    jump = [np.zeros_like(group.uv) for group in problem.groups]
    for part in jump:
        part[::6, -1] = jump_px
    return problem.with_uv(tuple(group.uv + part for group, part in zip(problem.groups, jump, strict=True)))


def test_every_arm_runs_and_is_described() -> None:
    trial = try_arms(_windows(MIXED, 2, 0), _learned(MIXED))
    found = summarise(trial)
    assert set(found["arm"]) == {"0", "1", "2", "3", "3b", *ARMS}
    assert "undecided" in sentence(found, "6")
    assert sentence(found, "8").startswith("One sigma, Huber")


def test_scalar_arms_share_their_poses() -> None:
    (problem,) = _windows(MIXED, 1, 3)
    trial = try_arms([problem], _learned(MIXED), arms=["0", "1", "2", "3"])
    assert trial["position_m"].n_unique() == 1
    assert trial["nees_newest"].n_unique() == 4
    one = adjust(problem, perturbed(problem, seed=0), Assumption(one_sigma(problem, 1.0)))
    assert trial.filter(arm="0")["innovations"][0] == pytest.approx(one.innovations)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.90, 0.97, Verdict.HELPS),
        (0.985, 1.015, Verdict.NO_DIFFERENCE),
        (1.03, 1.1, Verdict.HURTS),
        (0.95, 1.01, Verdict.UNDECIDED),
        (None, None, Verdict.UNDECIDED),
    ],
)
def test_decisions(low: float | None, high: float | None, expected: Verdict) -> None:
    assert verdict(low, high) is expected
