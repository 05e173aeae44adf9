"""Sequences of a run in three dimensions: true points project onto true positions, and recordings hold everything."""

import subprocess
import sys

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import SettingsError, StoreError, UnknownNameError
from tracknoise.experiments.view3d import open_scene, write_recording


@pytest.fixture
def run(finished):
    return finished(2)[1]


def test_true_points_project_onto_true_positions(run):
    scene = open_scene(run)
    (tracker,) = scene.trackers.values()
    seen = tracker.observations.join(tracker.points, on="track").drop_nulls("u_true_px")
    assert seen.height > 20
    points = scene.geometry.to_camera(
        seen["frame"].to_numpy().astype(np.int64), seen.select("x_m", "y_m", "z_m").to_numpy()
    )
    uv = scene.geometry.cameras[0].project(points)
    assert np.abs(uv - seen.select("u_true_px", "v_true_px").to_numpy()).max() < 1e-6


def test_errors_are_lengths_and_images_are_those_of_the_data(run):
    scene = open_scene(run, "seq-02")
    assert scene.sequence.id.scene == "seq-02"
    assert scene.sequence.image(scene.n_frames - 1).shape == (48, 64)
    (tracker,) = scene.trackers.values()
    known = tracker.observations.drop_nulls("error_px")
    offset = known.select(u=pl.col("u_px") - pl.col("u_true_px"), v=pl.col("v_px") - pl.col("v_true_px")).to_numpy()
    assert np.allclose(np.hypot(*offset.T), known["error_px"].to_numpy())
    assert 0 < scene.large_error_px() <= known["error_px"].max()


def test_what_cannot_be_shown_is_refused(run, finished):
    with pytest.raises(UnknownNameError, match=r"scene 'seq-09'.*seq-01, seq-02"):
        open_scene(run, "seq-09")
    with pytest.raises(StoreError, match="keeps no observations"):
        open_scene(finished(2, keep="statistics")[1])


def test_without_the_extra_the_package_is_named(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)  # as if it were not installed
    with pytest.raises(
        SettingsError, match=r"^a recording for Rerun: needs the extra `rerun`: pip install 'tracknoise\[rerun\]'$"
    ):
        write_recording(run, tmp_path / "out.rrd")
    assert not (tmp_path / "out.rrd").exists()


def test_a_recording_holds_images_tracks_points_and_the_path(run, tmp_path):
    pytest.importorskip("rerun", reason="the extra rerun is not installed")
    path = tmp_path / "new" / "out.rrd"
    write_recording(run, path, scene="seq-02")
    command = [sys.executable, "-m", "rerun", "rrd", "print", str(path)]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    for entity in ("/world/camera/image", "/world/path", "/world/points/oracle", "/world/camera/image/oracle/errors"):
        assert entity in printed
    assert "seq-02" in printed
