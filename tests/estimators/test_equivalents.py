"""Standard deviations for all observations: of a first direction that is a state, they are those of the others."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from tests.estimators.simulated_tracks import units

from tracknoise.estimators.components import fit_components
from tracknoise.estimators.equivalents import Gates, MeanSquares, equivalents, gates
from tracknoise.estimators.fit import equivalents_of
from tracknoise.estimators.linear_window import (
    LinearTracks,
    Motion,
    TrackGates,
    outcome,
    scalar_variances,
    trajectory,
    true_covariances,
)
from tracknoise.estimators.model import Equivalent, Interval, Landmark, Purpose
from tracknoise.estimators.training import Recording, Windows, training_tables, windows
from tracknoise.inference.track_noise import TrackNoise
from tracknoise.tables.schema import WINDOW_NOISE, empty
from tracknoise.tables.store import RunFolder


def of_state(length: int, **planted: float) -> dict[Purpose, Interval]:
    fitted = fit_components(units(0, scenes=8, **planted), level=0.95)
    some = windows([], speed=1, length=length, lifetimes=np.full(50, 12))
    limits = Gates(TrackGates.of(some.each[0], fitted.noise), (1.0, 1.0, 1.0))
    found = equivalents(fitted, some, length=length, speed=1, gates=limits)
    return {one.purpose: one.sigma for one in found if one.landmark is Landmark.STATE}


@pytest.mark.parametrize("white", [0.1, 0.02])
@pytest.mark.parametrize("length", [5, 10])
def test_the_state_takes_the_noise_of_the_first_position_from_all_others(length: int, white: float) -> None:
    found = of_state(length, first=0.3, white=white)
    for purpose in (Purpose.INNOVATIONS, Purpose.ALL_POSES):
        assert found[purpose].value == pytest.approx(white, rel=0.03)
        assert found[purpose].low < white < found[purpose].high


@pytest.mark.parametrize("is_across", [False, True])
def test_sigma_for_poses_allows_for_noise_across_the_motion(*, is_across: bool) -> None:
    """The camera moves sideways in one window: errors in u then move points in depth, those in v turn poses."""
    isotropic = units(0, scenes=8, white=0.3)
    shape, sums = ((0.2, 1.8) if is_across else (1.8, 0.2)), isotropic.sums.copy()
    sums[..., 1:4] *= (shape[0], np.sqrt(shape[0] * shape[1]), shape[1])
    fitted = fit_components(replace(isotropic, sums=sums), level=0.95)
    (some, *_) = windows([], speed=1, length=10, lifetimes=np.full(50, 12)).each
    limits = Gates(TrackGates.of(some, fitted.noise), (1.0, 1.0, 1.0))
    found = equivalents(fitted, Windows([some], [None]), length=10, speed=1, gates=limits)
    sigma = {one.purpose: one.sigma for one in found if one.landmark is Landmark.FREE}

    def right(noise: TrackNoise) -> float:
        actual = true_covariances(some, noise)
        return float(outcome(some, actual, scalar_variances(some, 1.0)).nees_newest ** 0.5)

    shaped = right(TrackNoise(white=0.09 * np.diag(shape)))
    assert (shaped > 1.1 * right(TrackNoise.isotropic(white=0.3))) == is_across
    assert sigma[Purpose.NEWEST_POSE].value == pytest.approx(shaped, rel=0.03)
    assert sigma[Purpose.NEWEST_POSE].low < shaped < sigma[Purpose.NEWEST_POSE].high


def made_recording(scene: str, poses: np.ndarray, depth_m: float, random: np.random.Generator) -> Recording:
    moved = np.hstack([poses[:, :3, 3], Rotation.from_matrix(poses[:, :3, :3]).as_quat()])
    table = pl.DataFrame(moved, schema=["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"]).with_row_index("frame")
    camera = {"width": 640, "height": 480, "fx_px": 460.0, "fy_px": 460.0, "cx_px": 319.5, "cy_px": 239.5}
    uv, z = random.uniform((40, 40), (600, 440), (200, 2)), depth_m * random.uniform(0.5, 2.0, (200, 1))
    return Recording(scene, table, pl.DataFrame([camera]), np.hstack([uv, z]), np.full(100, 20))


def test_the_interval_of_sigma_contains_the_geometry_of_all_scenes() -> None:
    """Noise is the same in all scenes. Their motions and depths are not, and a walk counts by these."""
    random, fitted = np.random.default_rng(0), fit_components(units(0, scenes=12, walk=0.1), level=0.95)
    names = fitted.sums.units.scenes

    def width(recordings: list[Recording]) -> tuple[float, set[str]]:
        some = windows(recordings, speed=1, length=10, lifetimes=np.full(50, 12))
        sigma = MeanSquares.of(fitted, some, 1).sigmas(None)[Purpose.NEWEST_POSE]
        assert sigma.low < sigma.value < sigma.high
        return sigma.high / sigma.low, set(some.scenes)

    same, differing = [], []
    for place, name in enumerate(names):
        poses = trajectory(Motion.SIDEWAYS if place % 2 else Motion.FORWARD, 40)
        differing.append(made_recording(name, poses, 2.0 + 2.0 * place, random))
        same.append(made_recording(name, trajectory(Motion.SIDEWAYS, 40), 5.0, random))
    (wide, scenes), (narrow, _), walk = width(differing), width(same), fitted.components["walk"].sigma
    assert scenes == set(names)
    assert wide - 1.0 > max(1.2 * (narrow - 1.0), 1.5 * (walk.high / walk.low - 1.0))


def test_each_scene_has_its_own_noise_in_its_own_windows() -> None:
    """A noisy scene whose motion makes noise count little does not count as much as with the motion of all."""
    quiet, loud = (units(seed, scenes=3, white=white) for seed, white in ((1, 0.1), (2, 0.4)))
    both = replace(
        quiet,
        sums=np.concatenate([quiet.sums, loud.sums]),
        scenes=tuple(f"scene-{number:02}" for number in range(6)),
        scene=np.concatenate([quiet.scene, loud.scene + 3]),
    )
    fitted = fit_components(both, level=0.95)
    (still, moving, *_) = (windows([], speed=1, length=10, lifetimes=np.full(50, life)).each[0] for life in (12, 30))
    names = [f"scene-{number:02}" for number in range(6)]
    found = MeanSquares.of(fitted, Windows([still] * 3 + [moving] * 3, names), 1).sigmas(None)
    squares = []
    for window, white in ((still, 0.1), (moving, 0.4)):
        actual = true_covariances(window, TrackNoise.isotropic(white=white))
        squares.append(outcome(window, actual, scalar_variances(window, 1.0)).nees_newest)
    assert found[Purpose.NEWEST_POSE].value == pytest.approx(np.mean(squares) ** 0.5, rel=0.04)


def test_gates_of_a_walk_do_not_depend_on_the_speed(planted_run: Path) -> None:
    """Where too few windows were measured: the walk of all frames between two of the tracker counts."""
    fitted = fit_components(units(0, scenes=8, walk=0.1), level=0.95)
    found = {}
    for speed in (1, 2):
        read = training_tables(RunFolder(planted_run), tracker="oracle", speed=speed)
        unmeasured = replace(read, tables={**read.tables, "window_noise": empty(WINDOW_NOISE)})
        kept = [one for one in equivalents_of(unmeasured, fitted, (5,)) if one.landmark is Landmark.FREE]
        found[speed] = next(one for one in kept if one.purpose is Purpose.INNOVATIONS)
    assert found[2].sigma.value > 1.2 * found[1].sigma.value
    assert found[2].gate_95 == pytest.approx(found[1].gate_95, rel=0.1)


@pytest.mark.parametrize("measured", [None, (0.1, 0.2, 0.3)])
def test_noise_of_first_positions_alone_has_gates(measured: tuple[float, ...] | None) -> None:
    """Most tracks of a window were born before it, and have no innovations then: there is nothing to scale gates by."""
    fitted = fit_components(units(0, scenes=8, first=0.3, white=0.0), level=0.95)
    alone = replace(fitted.noise, white=np.zeros((2, 2)), walk=np.zeros((2, 2)), drift=np.zeros((2, 2)))
    some = windows([], speed=1, length=5, lifetimes=np.full(50, 40)).each
    limits = Gates(TrackGates.of(some[0], alone), measured)
    assert 0.0 in limits.modelled.factors((0.8,), sigma=1.0)
    for first in (None, 0.0001, 0.3):
        factors = limits.factors(0.1, first=first, born_only=first == 0.3)
        assert np.isfinite(factors).all()
        assert min(factors) > 0.0


def passing(window: Sequence[LinearTracks], noise: TrackNoise, one: Equivalent) -> float:
    """Share of good tracks that pass a gate at .95 times that of an equivalent, by drawing their errors."""
    random, first = np.random.default_rng(1), float(np.sqrt(np.trace(noise.first) / 2.0))
    of_first = {Landmark.FREE: one.sigma.value, Landmark.EXACT: 0.0, Landmark.STATE: first}[one.landmark]
    passed = []
    for tracks, covariances in zip(window, true_covariances(window, noise), strict=True):
        size = covariances.shape[1]
        for by_point, covariance, born in zip(tracks.by_point, covariances, tracks.born, strict=True):
            deviations = np.full(size, one.sigma.value)
            if born or one.landmark is not Landmark.STATE:
                deviations[:2] = max(of_first, 1e-4 * one.sigma.value)
            errors = random.multivariate_normal(np.zeros(size), covariance, 100) / deviations
            span = np.linalg.qr(by_point / deviations[:, None])[0]
            squares = np.square(errors - errors @ span @ span.T).sum(axis=1)
            passed.append(squares <= one.gate_95 * chi2.ppf(0.95, size - 3))
    return float(np.mean(passed))


@pytest.mark.parametrize("planted", [{"first": 0.3, "white": 0.1}, {"white": 0.2, "walk": 0.1}])
def test_gates_let_good_tracks_pass_however_the_first_observation_is_used(planted: dict[str, float]) -> None:
    fitted = fit_components(units(1, scenes=8, **planted), level=0.95)
    some = windows([], speed=1, length=5, lifetimes=np.full(50, 12))
    limits = gates(empty(WINDOW_NOISE), 5, limit_px=9.0, window=some.each[0], noise=fitted.noise)
    found = equivalents(fitted, some, length=5, speed=1, gates=limits)
    for one in found:
        if one.purpose in (Purpose.INNOVATIONS, Purpose.NEWEST_POSE):
            assert passing(some.each[0], fitted.noise, one) == pytest.approx(0.95, abs=0.015)


def test_noise_of_the_first_position_alone_leaves_the_others_exact() -> None:
    assert of_state(5, first=0.3) == dict.fromkeys(Purpose, Interval(value=0.0))
