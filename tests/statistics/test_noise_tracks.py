"""Sampled tracks of a measured sequence: the same depths follow from them as from all windows."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import tracknoise
from tracknoise.estimators.linear_window import fit_points
from tracknoise.experiments.geometry_tables import frame_geometry
from tracknoise.statistics import windows as sampling
from tracknoise.statistics.windows import noise_tracks, window_noise

LENGTH = 5


@pytest.fixture(scope="module")
def measured():
    sequence = tracknoise.open_sequence(
        "simulated", motions=["forward"], frames=10, width=160, height=120, worlds=1, supersampling=1
    )
    oracle = tracknoise.Oracle(n_features=60, covariance_px2=((0.04, 0.0), (0.0, 0.04)), loss_rate=0.05)
    measurement = tracknoise.measure(sequence, oracle, speeds=[1, 2])
    return replace(measurement.prepared, slowest=1), frame_geometry(sequence, measurement.n_frames)


def depths(table: pl.DataFrame) -> np.ndarray:
    """z of windows of `LENGTH`, px, and the parallax of these windows, (2, windows)."""
    rows = table.filter(pl.len().over("track") >= LENGTH, pl.int_range(pl.len()).over("track") < LENGTH)
    names = [f"{name}_{axis}" for axis in "uv" for name in ("across", "other", "depth")]
    by_point = rows.select(names).to_numpy().astype(np.float64).reshape(-1, 2 * LENGTH, 3)
    errors = rows.select("du_px", "dv_px").to_numpy().astype(np.float64).reshape(-1, 2 * LENGTH)
    along = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (len(errors), 3))
    error, z = fit_points(by_point, errors, np.eye(2 * LENGTH)).along(along)
    return np.stack([z, z / error])


def test_depths_are_those_of_all_windows(measured) -> None:
    prepared, geometry = measured
    z, parallax = depths(noise_tracks(prepared, geometry, population="visible"))
    windows = window_noise(prepared, geometry, population="visible")["window_noise"]
    (row,) = windows.filter(speed=1, trimming="untrimmed", window=LENGTH).to_dicts()
    shown = parallax >= 1.0
    assert shown.sum() == row["n_depth"]
    assert np.square(z[shown]).sum() == pytest.approx(row["squares_z"], rel=1e-3)


def test_a_few_tracks_stand_for_all(measured, monkeypatch) -> None:
    prepared, geometry = measured
    every = noise_tracks(prepared, geometry, population="visible")
    monkeypatch.setattr(sampling, "MOST", 10)
    some = noise_tracks(prepared, geometry, population="visible")
    assert every["stands_for"].unique().to_list() == [1.0]
    is_long = pl.len().over("track") == 10  # no track has more
    of_all, of_some = (table.with_columns(is_long=is_long).unique("track") for table in (every, some))
    of_all, of_some = (table.group_by("is_long").len() for table in (of_all, of_some))
    assert dict(of_some.iter_rows()) == {is_long: min(n, 10) for is_long, n in of_all.iter_rows()}
    assert some["track"].n_unique() < every["track"].n_unique()
    assert some.unique("track")["stands_for"].sum() == pytest.approx(every["track"].n_unique())
    both = some.drop("stands_for").join(every.drop("stands_for"), on=["track", "age"], suffix="_of_all")
    assert both.height == some.height
    assert (both["depth_u"] == both["depth_u_of_all"]).all()


def test_only_the_slowest_speed_is_sampled_and_first_positions_have_no_error(measured) -> None:
    prepared, geometry = measured
    table = noise_tracks(prepared, geometry, population="visible")
    assert table["speed"].unique().to_list() == [1]
    born = table.filter(age=0)
    assert born.height == table["track"].n_unique()
    assert not born.select("du_px", "dv_px").to_numpy().any()
    assert (born["magnification"] == 1.0).all()
    assert (table.filter(pl.col("age") > 0)["magnification"] > 1.0).mean() > 0.9  # the camera moves towards the points
