"""What positions in two cameras are to an estimator: derivatives, one sigma for both, and what the second one gains."""

import json
from functools import cache

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation
from tests.estimators.exports.models import lucas_kanade

from tracknoise.estimators.kernels import NEWEST, weighted_step
from tracknoise.estimators.linear_window import (
    CAMERA,
    Gauge,
    LinearTracks,
    Motion,
    Rig,
    linear_tracks,
    simulated_tracks,
    trajectory,
)
from tracknoise.estimators.model import Equivalent, Interval, KnownPoints, Landmark, OfBoth, Purpose
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.training import Recording, Windows, windows
from tracknoise.estimators.two_cameras import TwoCameras
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert, transform
from tracknoise.inference.units import NO_GROUPS
from tracknoise.tables.schema import PAIR_TRACKS

LENGTH, SIGMA, DRAWS = 11, 0.3, 150
PLACE = np.eye(4)
PLACE[:3, :3] = Rotation.from_rotvec([0.02, -0.05, 0.03]).as_matrix()
PLACE[:3, 3] = [0.12, 0.01, -0.02]
RIG = Rig(Camera(600, 400, 400.0, 410.0, 300.0, 200.0), PLACE)
ALONE = [
    Equivalent(landmark=landmark, purpose=purpose, window=LENGTH, sigma=Interval(value=SIGMA), gate_95=1.0, gate_99=1.0)
    for landmark in (Landmark.FREE, Landmark.EXACT, Landmark.STATE)
    for purpose in Purpose
]
LAWS = {
    "independent": lambda white, walk: (white[0], white[1]),
    "shared": lambda white, walk: (white[0], 0.98 * white[0] + 0.2 * white[1]),
    "opposite in part": lambda white, walk: (white[0], 0.8 * white[1] - 0.6 * white[0]),
    "shared walk": lambda white, walk: (white[0] + walk[0], white[1] + walk[0]),
    "own walks": lambda white, walk: (white[0] + walk[0], white[1] + walk[1]),
}
"""Errors in the first camera and in the second, from white noise and walks of both."""


def drawn(law: str, count: int, length: int, random: np.random.Generator) -> np.ndarray:
    """(tracks, frames, cameras, 2) px."""
    white, steps = SIGMA * random.standard_normal((2, 2, count, length, 2))
    steps[:, :, 0] = 0.0
    return np.stack(LAWS[law](white, 0.5 * np.cumsum(steps, axis=2)), axis=2)


def table(law: str, scenes: int = 4, count: int = 400) -> pl.DataFrame:
    """Sampled tracks with planted errors."""
    random, parts = np.random.default_rng(1), []
    for scene in range(scenes):
        errors = drawn(law, count, LENGTH, random).reshape(-1, 4)
        names = ("first_du_px", "first_dv_px", "du_px", "dv_px")
        labels = {"dataset": "d", "scene": f"s{scene}", "lighting": "", "camera": ""}
        rows = {"track": np.repeat(np.arange(count), LENGTH), "stands_for": 1.0}
        rows |= {"age": np.tile(np.arange(LENGTH), count), **dict(zip(names, errors.T, strict=True))}
        parts.append(pl.DataFrame({**labels, **rows}))
    found = pl.concat(parts)
    return found.cast({name: PAIR_TRACKS[name] for name in found.columns})


@cache
def window(motion: Motion) -> tuple[LinearTracks, ...]:
    poses = trajectory(motion, LENGTH)
    return tuple(linear_tracks(CAMERA, poses, one, rig=RIG) for one in simulated_tracks(poses))


@cache
def pair(law: str) -> TwoCameras:
    windows = Windows([window(motion) for motion in Motion], [None] * len(Motion))
    found = TwoCameras.of(table(law), {LENGTH: windows}, np.inf)
    assert found is not None
    return found


def of(found, landmark: Landmark = Landmark.FREE, purpose: Purpose = Purpose.NEWEST_POSE) -> Equivalent:
    return next(one for one in found if (one.landmark, one.purpose) == (landmark, purpose))


def nees(law: str) -> float:
    """NEES of the newest pose with 1 px, by drawn errors in both cameras, mean over draws and windows."""
    random, found = np.random.default_rng(2), []
    for tracks in map(window, Motion):
        errors, own = [], []
        for group in tracks:
            count, n = group.frames.shape
            each = drawn(law, DRAWS * count, n, random).reshape(DRAWS, count, n, 2, 2)
            errors.append(each.swapaxes(2, 3).reshape(DRAWS, count, -1))
            own.append(group.of_both)
        _, pose, claimed = weighted_step(own, errors, [np.ones_like(one) for one in errors])
        ends, blocks = pose[:, -NEWEST:], claimed[:, -NEWEST:, -NEWEST:]
        found += [float(one @ np.linalg.solve(block, one)) / NEWEST for one, block in zip(ends, blocks, strict=True)]
    return float(np.mean(found))


def test_derivatives_in_the_second_camera_are_those_of_its_images():
    poses, step = trajectory(Motion.FORWARD, 4), 1e-6
    tracks = simulated_tracks(poses, n_tracks=6)[-1]
    found = linear_tracks(CAMERA, poses, tracks, rig=RIG).of_both
    n, free = tracks.frames.shape[1], np.eye(24)
    changes = Gauge.of(poses[:, :3, 3]).free(free[None])[0]

    def images(change: np.ndarray, points: np.ndarray) -> np.ndarray:
        moved = poses.copy()
        for pose, (a, b) in zip(moved, change.reshape(-1, 2, 3), strict=True):
            pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(a).as_matrix()
            pose[:3, 3] += b
        seen = (moved[tracks.frames] @ PLACE).reshape(-1, 4, 4)
        return RIG.camera.project(transform(invert(seen), np.repeat(points, n, axis=0))).reshape(len(points), -1)

    at = images(np.zeros(24), tracks.points)
    for place, change in enumerate(changes.T):
        by_pose = (images(step * change, tracks.points) - at) / step
        np.testing.assert_allclose(found.by_pose[:, 2 * n :, place], by_pose, rtol=1e-3, atol=2e-3)
    for axis in range(3):
        by_point = (images(np.zeros(24), tracks.points + step * np.eye(3)[axis]) - at) / step
        np.testing.assert_allclose(found.by_point[:, 2 * n :, axis], by_point, rtol=1e-3, atol=2e-3)
    np.testing.assert_array_equal(found.by_pose[:, : 2 * n], linear_tracks(CAMERA, poses, tracks).by_pose)


@pytest.mark.parametrize("law", LAWS)
def test_one_sigma_for_both_makes_the_newest_pose_right(law):
    """Errors are drawn anew, and poses found from them by least squares."""
    found = of(pair(law).equivalents(ALONE, NO_GROUPS, 0.95)).sigma.value
    assert found == pytest.approx(np.sqrt(nees(law)), rel=0.07)


def test_independent_errors_of_one_size_need_no_other_sigma():
    found = [one for one in pair("independent").equivalents(ALONE, NO_GROUPS, 0.95) if one.landmark is Landmark.FREE]
    assert [one.sigma.value for one in found] == pytest.approx([SIGMA] * 3, rel=0.03)
    assert [one.gate_95 for one in found] == pytest.approx([1.0] * 3, rel=0.1)


def test_errors_that_both_cameras_share_need_a_larger_sigma():
    found = pair("shared").equivalents(ALONE, NO_GROUPS, 0.95)
    assert 1.2 < of(found).sigma.value / SIGMA < np.sqrt(2.0)
    assert of(found, purpose=Purpose.INNOVATIONS).sigma.value < of(found).sigma.value


@pytest.mark.parametrize(
    ("law", "ratio"), [("independent", 1.0), ("shared", np.sqrt(1.98)), ("opposite in part", np.sqrt(0.4))]
)
def test_one_pose_from_known_points_has_both_positions_of_one_time(law, ratio):
    points = [KnownPoints(window=LENGTH, kernel=None, knee_px=None, sigma=Interval(value=0.5, low=0.4, high=0.6))]
    (found,) = pair(law).known_points(points)
    assert found.sigma.value == pytest.approx(0.5 * ratio, rel=0.03)
    assert found.sigma.high == pytest.approx(0.6 * ratio, rel=0.03)


def test_the_second_camera_gains_what_its_errors_leave():
    """Independent errors halve the variance; the same errors again say nothing new across the baseline."""
    known = {}
    for law in ("independent", "shared"):
        both = pair(law)
        known[law] = both.trial(LENGTH, NO_GROUPS, 0.95)
    assert known["independent"].correlation == pytest.approx(0.0, abs=0.02)
    assert known["shared"].correlation == pytest.approx(0.98, abs=0.01)
    assert known["independent"].rotation_ratio.value < known["shared"].rotation_ratio.value < 1.0
    assert known["independent"].position_ratio.value < 0.75


def test_exports_are_for_both_cameras():
    both = OfBoth(
        correlation=0.8,
        correlated_ratio=0.8,
        position_ratio=Interval(value=0.7, low=0.6, high=0.8),
        rotation_ratio=Interval(value=0.5),
        windows=24,
    )
    model = lucas_kanade(of_both=both)
    found, alone = model.export("gtsam"), lucas_kanade().export("gtsam")
    plain = float(found.files["gtsam_noise.py"].split("SMART_SIGMA_PX = ")[1].split()[0])
    assert "stereo_noise" not in alone.files["gtsam_noise.py"]
    written = found.files["gtsam_noise.py"].split("def stereo_noise")[1].split("np.array(")[1].split("))")[0]
    variance = (0.8 * plain) ** 2
    expected = variance * np.array([[1.0, 0.8, 0.0], [0.8, 1.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(json.loads(written), expected, rtol=0.01)
    said = " ".join(model.export("openvins").text.split())
    assert "positions in both cameras" in said
    assert "0.7 (0.6 to 0.8) times" in said
    assert "both cameras" not in lucas_kanade().export("openvins").text


def test_documents_of_two_cameras_come_back(tmp_path):
    both = OfBoth(
        correlation=0.8,
        correlated_ratio=0.8,
        position_ratio=Interval(value=0.7),
        rotation_ratio=Interval(value=0.5),
        windows=24,
    )
    path = tmp_path / "noise.json"
    lucas_kanade(of_both=both).write(path)
    assert NoiseModel.read(path).of_both == both
    assert "of_both" not in lucas_kanade().text


def test_simulated_windows_have_the_second_camera_of_the_recordings():
    recording = Recording("s0", pl.DataFrame(), pl.DataFrame(), np.empty((0, 3)), np.array([8]), RIG)
    found = windows([recording], speed=1, length=LENGTH, lifetimes=np.full(20, 8))
    assert found.simulated
    assert all(group.beside is not None for one in found.each for group in one)
    assert TwoCameras.of(table("shared"), {LENGTH: found}, np.inf) is not None


def test_cameras_without_errors_say_nothing():
    without = table("independent").with_columns(first_du_px=pl.lit(0.0), first_dv_px=pl.lit(0.0))
    assert TwoCameras.of(without, {LENGTH: Windows([window(Motion.SIDEWAYS)], [None])}, np.inf) is None
    assert TwoCameras.of(table("independent").clear(), {}, np.inf) is None
