"""The linear benchmark: tables of section 3.2 of the note on estimators, and what must hold exactly."""

from functools import cache

import numpy as np
import pytest

from tracknoise.estimators.linear_window import (
    CAMERA,
    LinearEstimate,
    LinearTracks,
    Motion,
    Outcome,
    TrackGates,
    consistent_sigma,
    determines_poses,
    linear_tracks,
    outcome,
    scalar_variances,
    simulated_tracks,
    trajectory,
    true_covariances,
    without,
)
from tracknoise.estimators.model import Landmark, Purpose
from tracknoise.inference.track_noise import Reference, TrackNoise

WHITE = TrackNoise.isotropic(first=0.3, white=0.3)
WALK = TrackNoise.isotropic(walk=0.1)
BOTH = TrackNoise.isotropic(white=0.3, walk=0.1)
_TINY = 1e-6
_SEEDS = (0, 1, 2, 3)


@cache
def _window(motion: Motion, n_frames: int = 11, seed: int = 0) -> tuple[LinearTracks, ...]:
    poses = trajectory(motion, n_frames)
    return tuple(linear_tracks(CAMERA, poses, tracks) for tracks in simulated_tracks(poses, seed=seed))


def _regular(covariances: list[np.ndarray]) -> list[np.ndarray]:
    return [part + _TINY**2 * np.eye(part.shape[1]) for part in covariances]


def _by_age(window: tuple[LinearTracks, ...], noise: TrackNoise) -> list[np.ndarray]:
    """Independent errors about the first position, the first of variance 0."""
    whole = [noise.covariance(part.magnification, reference=Reference.BIRTH) for part in window]
    return _regular([part * np.eye(part.shape[1]) for part in whole])


def _whole(window: tuple[LinearTracks, ...], noise: TrackNoise, *, magnified: bool = True) -> list[np.ndarray]:
    magnifications = [part.magnification if magnified else np.ones_like(part.magnification) for part in window]
    return _regular([noise.covariance(part, reference=Reference.BIRTH) for part in magnifications])


def _averaged(motion: Motion, noise: TrackNoise, assumed) -> np.ndarray:
    """NEES of the newest pose, and ratios of position and rotation to one sigma, over four draws of points."""
    rows = []
    for seed in _SEEDS:
        window = _window(motion, seed=seed)
        actual = _regular(list(true_covariances(window, noise)))
        one = outcome(window, actual, scalar_variances(window, 1.0))
        other = outcome(window, actual, assumed(window, noise))
        rows.append((other.nees_newest, other.position_m / one.position_m, other.rotation_rad / one.rotation_rad))
    return np.mean(rows, axis=0)


@pytest.mark.parametrize(
    ("noise", "innovations", "all_poses", "newest"),
    [(WHITE, 0.300, 0.300, 0.297), (WALK, 0.121, 0.134, 0.269), (BOTH, 0.311, 0.316, 0.353)],
)
def test_sigmas_named_by_what_they_make_right(noise, innovations, all_poses, newest) -> None:
    found = [
        np.mean([consistent_sigma(_window(Motion.SIDEWAYS, seed=seed), noise, purpose=purpose) for seed in _SEEDS])
        for purpose in (Purpose.INNOVATIONS, Purpose.ALL_POSES, Purpose.NEWEST_POSE)
    ]
    assert found == pytest.approx([innovations, all_poses, newest], abs=0.005)


@pytest.mark.parametrize(
    ("n_frames", "all_poses", "newest"), [(5, 0.10, 0.15), (11, 0.13, 0.27), (20, 0.18, 0.41), (30, 0.21, 0.54)]
)
def test_a_walk_asks_for_more_in_longer_windows(n_frames, all_poses, newest) -> None:
    window = _window(Motion.SIDEWAYS, n_frames)
    found = [consistent_sigma(window, WALK, purpose=purpose) for purpose in (Purpose.ALL_POSES, Purpose.NEWEST_POSE)]
    assert found == pytest.approx([all_poses, newest], abs=0.02)


def test_a_filter_whose_innovations_look_right_is_overconfident_under_a_walk() -> None:
    window = _window(Motion.SIDEWAYS)
    sigma = consistent_sigma(window, WALK, purpose=Purpose.INNOVATIONS)
    found = outcome(window, true_covariances(window, WALK), scalar_variances(window, sigma))
    assert found.innovations == pytest.approx(1.0)
    assert found.nees_newest == pytest.approx(4.95, abs=0.2)
    assert TrackGates.of(window, WALK).factors([0.95], sigma=sigma)[0] == pytest.approx(1.45, abs=0.05)


@pytest.mark.parametrize(
    ("motion", "noise", "nees", "position", "rotation"),
    [
        (Motion.FORWARD, WHITE, (1.75, 2.03), (1.31, 1.50), (1.30, 1.53)),
        (Motion.SIDEWAYS, WHITE, (1.85, 2.03), (1.20, 1.48), (1.30, 1.53)),
        (Motion.SIDEWAYS, WALK, (2.1, 2.5), (1.03, 1.20), (1.05, 1.11)),
        (Motion.SIDEWAYS, BOTH, (1.50, 1.64), (0.93, 1.04), (0.90, 0.99)),
    ],
)
def test_covariances_by_age_are_worse_than_one_sigma(motion, noise, nees, position, rotation) -> None:
    found = _averaged(motion, noise, _by_age)
    for value, (low, high) in zip(found, (nees, position, rotation), strict=True):
        assert low - 0.02 <= value <= high + 0.02


@pytest.mark.parametrize(
    ("motion", "position", "rotation"),
    [(Motion.SIDEWAYS, (0.83, 0.98), (0.83, 0.95)), (Motion.FORWARD, (0.83, 0.95), (0.83, 0.95))],
)
def test_covariances_of_whole_tracks_are_consistent_and_better_under_a_walk(motion, position, rotation) -> None:
    found = _averaged(motion, WALK, _whole)
    assert found[0] == pytest.approx(1.0, abs=1e-6)
    assert position[0] <= found[1] <= position[1]
    assert rotation[0] <= found[2] <= rotation[1]


@pytest.mark.parametrize(("noise", "nees"), [(WHITE, (1.45, 1.58)), (WALK, (1.4, 1.4)), (BOTH, (1.2, 1.3))])
def test_magnification_matters_forward(noise, nees) -> None:
    found = _averaged(Motion.FORWARD, noise, lambda window, true: _whole(window, true, magnified=False))
    assert nees[0] - 0.05 <= found[0] <= nees[1] + 0.05


def _same(one: Outcome, other: Outcome) -> None:
    """The same to first order: the camera also turns, by which an image is not only magnified."""
    assert np.allclose(np.diag(one.actual), np.diag(other.actual), rtol=1e-3)
    assert np.allclose(np.diag(one.claimed), np.diag(other.claimed), rtol=1e-3)


@pytest.mark.parametrize("motion", Motion)
@pytest.mark.parametrize("noise", [WHITE, TrackNoise.isotropic(first=0.2, white=0.1, walk=0.08)])
def test_errors_may_be_counted_from_the_first_position_or_from_the_true_one(motion, noise) -> None:
    window = _window(motion)
    free = true_covariances(window, noise)
    _same(outcome(window, free, free), outcome(window, free, _whole(window, noise)))


@pytest.mark.parametrize("purpose", Purpose)
def test_independent_noise_has_the_same_sigma_for_all_purposes(purpose: Purpose) -> None:
    for motion in Motion:
        assert consistent_sigma(_window(motion), WHITE, purpose=purpose) == pytest.approx(0.3, rel=1e-6)


def test_an_exact_first_observation_asks_for_twice_the_sigma_of_detections() -> None:
    window = _window(Motion.SIDEWAYS)
    exact = consistent_sigma(window, WHITE, purpose=Purpose.NEWEST_POSE, landmark=Landmark.EXACT)
    state = consistent_sigma(window, WHITE, purpose=Purpose.NEWEST_POSE, landmark=Landmark.STATE)
    assert exact == pytest.approx(0.60, abs=0.02)
    assert state == pytest.approx(0.30, rel=1e-4)
    walked = consistent_sigma(window, WALK, purpose=Purpose.NEWEST_POSE, landmark=Landmark.EXACT)
    assert walked == pytest.approx(0.44, abs=0.02)


def test_lengths_of_tracks_are_those_given() -> None:
    poses = trajectory(Motion.SIDEWAYS, 11)
    groups = simulated_tracks(poses, lengths=[4], n_tracks=50)
    assert max(part.frames.shape[1] for part in groups) == 4
    assert all((np.diff(part.frames) == 1).all() for part in groups)
    assert len({int(first) for part in groups for first in part.frames[:, 0]}) > 3


@pytest.mark.parametrize("noise", [{"first": 0.3, "white": 0.05, "walk": 0.02}, {"white": 0.3}])
def test_tracks_that_began_before_the_window_have_no_first_position_in_it(noise: dict[str, float]) -> None:
    """Their errors about a first position nine frames earlier: its error and the walk until the window are in all."""
    poses = trajectory(Motion.SIDEWAYS, 11)
    drawn = simulated_tracks(poses, lengths=[25], n_tracks=60)
    window = [linear_tracks(CAMERA, poses, tracks) for tracks in drawn]
    true = TrackNoise.isotropic(**noise)
    actual = []
    for tracks, stated in zip(window, true_covariances(window, true), strict=True):
        longer = true.covariance(np.ones((1, tracks.magnification.shape[1] + 9)), reference=Reference.BIRTH)[
            :, 18:, 18:
        ]
        actual.append(np.where(tracks.born[:, None, None], stated, longer))
    assert 0.2 < np.mean(np.concatenate([tracks.born for tracks in window])) < 0.4
    one = scalar_variances(window, 1.0)
    found, expected = (outcome(window, of, one) for of in (true_covariances(window, true), actual))
    assert found.nees_newest == pytest.approx(expected.nees_newest, rel=1e-6)
    assert found.innovations == pytest.approx(expected.innovations, rel=1e-6)


def test_a_state_has_its_prior_only_where_its_track_begins() -> None:
    """With independent noise after an exact first position, the right sigma is that noise, whenever tracks begin."""
    poses = trajectory(Motion.SIDEWAYS, 8)
    drawn = simulated_tracks(poses, lengths=[20], n_tracks=60)
    window = [linear_tracks(CAMERA, poses, tracks) for tracks in drawn]
    noise = TrackNoise.isotropic(white=0.3)
    for purpose in Purpose:
        found = consistent_sigma(window, noise, purpose=purpose, landmark=Landmark.STATE)
        assert found == pytest.approx(0.3, rel=1e-4)


def test_tracks_begin_equally_often_in_each_frame_so_that_long_ones_are_seen_more_often() -> None:
    still = np.tile(np.eye(4), (11, 1, 1))
    groups = simulated_tracks(still, lengths=[4, 40], n_tracks=4000)
    first = np.concatenate([part.frames[:, 0] for part in groups])
    assert np.bincount(first) / 4000 == pytest.approx([40 / 56, *[2 / 56] * 8], abs=0.03)
    assert sum(len(part.frames) for part in groups if part.frames.shape[1] == 11) / 4000 == pytest.approx(
        30 / 56, abs=0.03
    )


def test_errors_of_simulated_tracks_have_the_covariance_that_is_stated() -> None:
    noise = TrackNoise.isotropic(first=0.4, white=0.2, walk=0.1, drift=0.05)
    magnification = np.array([1.0, 1.2, 1.5, 1.9])
    random = np.random.default_rng(1)
    n = 200_000
    a, d = (sigma * random.standard_normal((n, 2)) for sigma in (0.4, 0.05))
    walked, rows = np.zeros((n, 2)), [np.zeros((n, 2))]
    for k in range(1, 4):
        walked = walked * magnification[k] / magnification[k - 1] + 0.1 * random.standard_normal((n, 2))
        rows.append(magnification[k] * a + 0.2 * random.standard_normal((n, 2)) + walked + k * d)
    drawn = np.stack(rows, axis=1).reshape(n, 8)
    stated = noise.covariance(magnification[None], reference=Reference.BIRTH)[0]
    assert np.allclose(np.cov(drawn.T), stated, atol=0.01)


def test_influences_are_known_of_windows_whose_poses_are_hardly_determined():
    poses = trajectory(Motion.FORWARD, 4)
    poses[:, :3, 3] *= 0.01
    window = [linear_tracks(CAMERA, poses, tracks) for tracks in simulated_tracks(poses, n_tracks=4, seed=11)]
    assert determines_poses(window)
    found = LinearEstimate.of(window, scalar_variances(window, 1.0, first=10.0)).influences()
    assert all(np.isfinite(found[purpose]).all() for purpose in Purpose)


@pytest.mark.parametrize("kind", ["white", "walk"])
def test_errors_in_common_add_what_is_said_for_each_feature(kind: str) -> None:
    """Errors that are the same in all tracks, drawn onto windows with twice as many tracks as it was computed for."""
    noise = TrackNoise.isotropic(first=0.3, white=0.3, walk=0.1)
    poses = trajectory(Motion.SIDEWAYS, 11)
    lengths = np.array([4, 6, 11])
    few, many = (
        [linear_tracks(CAMERA, poses, own) for own in simulated_tracks(poses, n_tracks=n, lengths=lengths)]
        for n in (80, 160)
    )
    added = LinearEstimate.of(few, scalar_variances(few, 1.0)).influences_in_common(noise)
    steps = np.random.default_rng(1).standard_normal((2000, 11, 2))
    errors = []
    for tracks in many:
        drawn = steps[:, tracks.frames]
        walked = np.cumsum(np.where(np.arange(drawn.shape[2])[:, None] > 0, drawn, 0.0), axis=2)
        errors.append((0.3 * drawn if kind == "white" else 0.1 * walked).reshape(2000, len(tracks.frames), -1))
    rows = [without(tracks.by_pose, np.linalg.qr(tracks.by_point)[0]) for tracks in many]
    size = rows[0].shape[2]
    information = sum(own.reshape(-1, size).T @ own.reshape(-1, size) for own in rows)
    right = sum(own.reshape(2000, -1) @ row.reshape(-1, size) for own, row in zip(errors, rows, strict=True))
    found = np.einsum("di,ij,dj->d", right, np.linalg.inv(information), right).mean() / size
    features = np.bincount(np.concatenate([tracks.frames.ravel() for tracks in many]))
    expected = added[Purpose.ALL_POSES][int(kind == "walk")] * np.square(features).sum() / features.sum()
    assert found == pytest.approx(expected, rel=0.1)
    assert not added[Purpose.INNOVATIONS].any()
