"""Triangulated truth: exact worlds, injected noise and drift, and tracks that no point can be fitted to."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from benchmarks.validity.triangulated import CAMERA, NOISE_PX, make_tracks, noise_of, resolved, sideways
from scipy.spatial.transform import Rotation

import tracknoise
from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import from_quaternion, invert, transform
from tracknoise.sequences.folder import write_folder
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.triangulated import Triangulated
from tracknoise.truth.truth_registry import make_truth

DISTORTED = Camera(640, 480, 400.0, 410.0, 320.0, 238.0, (-0.2, 0.05, 0.001, -0.002))


@pytest.mark.parametrize("camera", [CAMERA, DISTORTED])
def test_exact_positions_give_the_exact_points(camera):
    sequence = sideways(6, camera)
    tracks = make_tracks(sequence, count=50, length=6, noise_px=0.0, rng=np.random.default_rng(0))
    found = resolved(sequence, tracks.observed)
    exact = np.swapaxes(tracks.exact, 0, 1).reshape(-1, 2)
    np.testing.assert_allclose(found.uv, exact, atol=1e-6)
    inside = camera.contains(exact)
    assert (found.status == np.where(inside, TruthStatus.valid, TruthStatus.out_of_image)).all()
    assert ((found.depth_m > 1.99) & (found.depth_m < 8.01)).all()
    np.testing.assert_allclose(found.epipolar[50:, 0], 0.0, atol=1e-6)
    assert np.isnan(found.epipolar[:50]).all()


@pytest.mark.parametrize("length", [3, 5, 12, 50])
@pytest.mark.parametrize("camera", [CAMERA, DISTORTED])
def test_the_corrected_variance_is_that_of_injected_white_noise(length, camera):
    sequence = sideways(length, camera)
    count = 6000 // length
    tracks = make_tracks(sequence, count=count, length=length, rng=np.random.default_rng(length))
    found = noise_of(resolved(sequence, tracks.observed), tracks.observed)
    assert found["share"] > 0.97
    assert found["raw"] ** 2 == pytest.approx(0.25 * (2 * length - 3) / (2 * length), rel=0.05)
    for name in ("triangulated", "u", "v"):
        assert found[name] ** 2 == pytest.approx(0.25, rel=0.05 if name == "triangulated" else 0.07)
    assert found["epipolar"] ** 2 == pytest.approx(0.25, rel=0.12)


def test_leverages_of_a_track_add_up_to_its_three_unknowns():
    sequence = sideways(7)
    tracks = make_tracks(sequence, count=20, length=7, rng=np.random.default_rng(1))
    taken = np.einsum("nii->n", resolved(sequence, tracks.observed).leverage).reshape(7, 20).sum(axis=0)
    np.testing.assert_allclose(taken, 3.0, rtol=1e-6)


def test_drift_along_the_epipolar_line_is_not_seen():
    sequence = sideways(12)
    tracks = make_tracks(sequence, count=500, length=12, drift_px=0.3, rng=np.random.default_rng(2))
    truly = np.sqrt(np.square(tracks.observed - tracks.exact).mean())
    found = noise_of(resolved(sequence, tracks.observed), tracks.observed)
    assert truly > 1.2
    assert found["triangulated"] == pytest.approx(0.5, rel=0.05)
    assert found["epipolar"] == pytest.approx(0.5, rel=0.05)


def test_an_error_across_the_epipolar_line_is_its_signed_distance():
    sequence = sideways(2)
    sequence = replace(
        sequence, world_from_camera=from_quaternion(np.array([[0.0, 0, 0], [0.1, 0, 0]]), np.eye(4)[[3, 3]])
    )
    tracks = make_tracks(sequence, count=30, length=2, noise_px=0.0, rng=np.random.default_rng(3))
    moved = tracks.observed.copy()
    moved[:15, 1, 1] += 0.4
    moved[15:, 1] += (0.7, -0.4)
    distance, variance = resolved(sequence, moved).epipolar[30:].T
    sign = np.sign(distance[0])
    np.testing.assert_allclose(distance * sign, [0.4] * 15 + [-0.4] * 15, atol=1e-6)
    np.testing.assert_allclose(variance, 2.0, atol=1e-3)


def test_short_tracks_and_tracks_without_parallax_have_no_depth():
    sequence = sideways(5)
    short = resolved(sequence, make_tracks(sequence, count=10, length=2, rng=np.random.default_rng(0)).observed)
    assert (short.status == TruthStatus.no_depth).all()
    assert np.isnan(short.uv).all()
    assert np.isnan(short.leverage).all()
    assert np.isnan(short.depth_m).all()
    assert not np.isnan(short.epipolar[10:]).any()
    poses = sequence.world_from_camera.copy()
    poses[:, :3, 3] = poses[0, :3, 3]
    turning = replace(sequence, world_from_camera=poses)
    still = resolved(turning, make_tracks(turning, count=10, length=5, rng=np.random.default_rng(0)).observed)
    assert (still.status == TruthStatus.no_depth).all()
    assert np.isnan(still.epipolar).all()


def test_a_point_too_far_for_the_baseline_has_no_depth():
    sequence = sideways(5)
    points = np.column_stack([np.linspace(-1, 1, 8), np.zeros(8), np.geomspace(2.0, 2000.0, 8)])
    inverse = invert(sequence.world_from_camera)
    exact = np.stack([CAMERA.project(transform(inverse[index], points)) for index in range(5)], axis=1)
    known = ~np.isnan(resolved(sequence, exact).depth_m)
    assert known[:2].all()
    assert not known[-2:].any()
    assert (np.diff(known.astype(int)) <= 0).all()


def test_frames_without_a_pose_are_left_out_of_the_fit():
    sequence = sideways(9)
    poses = sequence.world_from_camera.copy()
    poses[[3, 4]] = np.nan
    gappy = replace(sequence, world_from_camera=poses)
    tracks = make_tracks(sequence, count=20, length=9, noise_px=0.0, rng=np.random.default_rng(0))
    moved = tracks.observed.copy()
    moved[:, 3:5] += 50.0
    found = resolved(gappy, moved)
    status = found.status.reshape(9, 20)
    assert (status[[3, 4]] == TruthStatus.no_pose).all()
    assert (status[[0, 1, 2, 5, 6, 7, 8]] == TruthStatus.valid).all()
    exact = np.swapaxes(tracks.exact, 0, 1)
    np.testing.assert_allclose(found.uv.reshape(9, 20, 2)[5:], exact[5:], atol=1e-6)


def test_no_observations():
    session = Triangulated().open(sideways(3)).start()
    found = session.resolve()
    assert (found.uv.shape, found.status.shape, found.depth_m.shape) == ((0, 2), (0,), (0,))
    session = Triangulated().open(sideways(3)).start()
    session.observe(0, np.empty(0, np.uint32), np.empty((0, 2)), np.empty(0, bool))
    assert session.resolve().epipolar.shape == (0, 2)


def test_a_gross_outlier_disturbs_no_other_track():
    sequence = sideways(8)
    tracks = make_tracks(sequence, count=10, length=8, rng=np.random.default_rng(4))
    wild = tracks.observed.copy()
    wild[0] = np.random.default_rng(5).uniform(0, 480, (8, 2))
    one, other = resolved(sequence, tracks.observed), resolved(sequence, wild)
    np.testing.assert_allclose(other.uv.reshape(8, 10, 2)[:, 1:], one.uv.reshape(8, 10, 2)[:, 1:], rtol=0, atol=1e-3)


def test_positions_that_fit_no_point_disturb_nothing():
    rng = np.random.default_rng(6)
    for spread_m in (0.0, 1e-9, 0.1, 100.0):
        poses = np.broadcast_to(np.eye(4), (6, 4, 4)).copy()
        poses[:, :3, :3] = Rotation.from_rotvec(rng.normal(0.0, 1.0, (6, 3))).as_matrix()
        poses[:, :3, 3] = rng.normal(0.0, spread_m, (6, 3))
        sequence = replace(sideways(6), world_from_camera=poses)
        found = resolved(sequence, rng.uniform(-50.0, 700.0, (100, 6, 2)))
        known = np.isin(found.status, (TruthStatus.valid, TruthStatus.out_of_image))
        assert np.isfinite(found.uv[known]).all()
        assert np.isnan(found.uv[~known]).all()
        assert (found.depth_m[~np.isnan(found.depth_m)] > 0).all()


def test_a_recording_without_depth_can_be_measured_by_triangulation(tmp_path):
    simulated = open_sequence("simulated", motions=["sideways"], frames=10, width=160, height=120, supersampling=1)
    write_folder(simulated, tmp_path / "scene")
    for path in (tmp_path / "scene" / "depth").iterdir():
        path.unlink()
    (tmp_path / "scene" / "depth").rmdir()
    sequence = open_sequence("folder", tmp_path)
    assert sequence.truths[-1] == "triangulated"
    settings = tracknoise.LucasKanade(min_features=60, max_features=90)
    found = tracknoise.measure(sequence, settings, truth="triangulated")
    assert found.truth == "triangulated"
    assert found.observations.filter(truth="valid").height > 300
    asked = tracknoise.measure(simulated, settings, truth="triangulated")
    assert asked.observations["u_px"].equals(found.observations["u_px"])
    one, other = (part.observations["du_px"].to_numpy() for part in (asked, found))
    np.testing.assert_allclose(one, other, atol=1e-6)


def test_the_oracle_needs_points_that_triangulation_does_not_have():
    with pytest.raises(tracknoise.TracknoiseError, match="a kind of truth that cannot place points"):
        tracknoise.measure(sideways(4), tracknoise.Oracle(n_features=5), truth="triangulated")


def test_a_single_pose_is_not_enough():
    sequence = sideways(4)
    poses = sequence.world_from_camera.copy()
    poses[1:] = np.nan
    with pytest.raises(DataError, match="1 pose for 4 frames"):
        make_truth(replace(sequence, world_from_camera=poses), "triangulated")


def imported(observed):
    """Tracks (tracks, length, 2) that begin in frame 0, as a tracker."""
    count, length, _ = observed.shape
    frames = np.tile(np.arange(length), count)
    return tracknoise.Imported.from_arrays(np.repeat(np.arange(count), length), frames, *observed.reshape(-1, 2).T)


def test_tracks_of_two_observations_have_distances_from_epipolar_lines_alone():
    sequence = sideways(2)
    observed = make_tracks(sequence, count=200, length=2, rng=np.random.default_rng(3)).observed
    run = tracknoise.analyse(tracknoise.measure(sequence, imported(observed), truth="triangulated"))
    noise = run.table("triangulated_noise", trimming="untrimmed").filter(pl.col("length_low").is_null())
    assert noise.select("measure", "n").rows() == [("epipolar", 200)]
    assert noise["sigma_px"][0] == pytest.approx(NOISE_PX, rel=0.15)
    text = run.findings().filter(topic="noise")["text"][0]
    assert "From distances to epipolar lines, the noise of imported is" in text


def test_a_camera_that_stays_where_it_is_is_named():
    sequence = sideways(5)
    poses = sequence.world_from_camera.copy()
    poses[:, :3, 3] = poses[0, :3, 3]
    observed = make_tracks(sequence, count=30, length=5, rng=np.random.default_rng(3)).observed
    with pytest.raises(DataError, match="a camera that changes its position"):
        tracknoise.measure(replace(sequence, world_from_camera=poses), imported(observed))
