from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.estimators.simulated_tracks import error_tracks

import tracknoise
from tracknoise.experiments.geometry_tables import frame_geometry
from tracknoise.statistics import noise_sums
from tracknoise.statistics.noise_sums import noise_tables, products, until_unknown
from tracknoise.tables.enumerations import Product

ERRORS = np.array([[0.0, 0.0], [0.1, 0.2], [0.4, -0.1], [0.3, 0.3]])
CARRIED = np.array([1.0, 1.1, 1.3, 1.6])


@pytest.fixture
def one_track():
    tracks = error_tracks(np.random.default_rng(0), n_tracks=1, most=4, mean_length=1e9)
    walked = np.cumsum([0.0, *(1.0 / CARRIED[1:] ** 2)])
    return replace(tracks, error_px=ERRORS.copy(), magnification=CARRIED, walked=walked)


def test_products_of_one_track(one_track) -> None:
    found = dict(products(one_track))
    np.testing.assert_allclose(found[Product.error].values[:, 0], ERRORS[1:, 0] ** 2)
    np.testing.assert_allclose(found[Product.error].values[:, 1], ERRORS[1:].prod(axis=1))
    ratio = CARRIED[2:] / CARRIED[1:-1]
    change = ERRORS[2:] - ratio[:, None] * ERRORS[1:-1]
    np.testing.assert_allclose(found[Product.change].values[:, 2], change[:, 1] ** 2)
    np.testing.assert_allclose(found[Product.before].values[:, 0], (ratio * ERRORS[1:-1, 0]) ** 2)
    np.testing.assert_allclose(found[Product.lagged].values[1, 0], change[1, 0] * change[0, 0])
    assert [len(found[kind].rows) for kind in Product] == [3, 2, 2, 2]


@pytest.mark.parametrize("component", ["first", "white", "walk", "drift"])
@pytest.mark.parametrize("motion", ["sideways", "forward"])
def test_factors_are_those_of_the_expectation(component: str, motion: str) -> None:
    random = np.random.default_rng(4)
    tracks = error_tracks(random, n_tracks=40_000, most=6, mean_length=1e9, motion=motion, **{component: 1.0})
    column = ("first", "white", "walk", "drift").index(component)
    for found in dict(products(tracks)).values():
        age = tracks.age[found.rows]
        for one in np.unique(age):
            chosen = age == one
            measured, expected = found.values[chosen][:, [0, 2]].mean(), found.factors[chosen, column].mean()
            scale = np.sqrt((found.values[chosen][:, 0] ** 2).mean()) + 1e-12
            assert abs(measured - expected) < 0.03 * scale + 1e-9


def test_gaps_and_outliers_break_products(one_track) -> None:
    error = ERRORS.copy()
    error[2] = np.nan
    found = dict(products(replace(one_track, error_px=error)))
    assert [len(found[kind].rows) for kind in Product] == [1, 0, 0, 0]


def test_a_track_ends_before_its_first_unknown_error(one_track) -> None:
    error = ERRORS.copy()
    error[2] = np.nan
    places, length = until_unknown(replace(one_track, error_px=error))
    assert places.tolist() == [0]
    assert length.tolist() == [2]


@pytest.fixture(scope="module")
def measured():
    sequence = tracknoise.open_sequence(
        "simulated", motions=["forward"], frames=10, width=160, height=120, worlds=1, supersampling=1
    )
    oracle = tracknoise.Oracle(n_features=60, covariance_px2=((0.04, 0.0), (0.0, 0.04)), loss_rate=0.05)
    measurement = tracknoise.measure(sequence, oracle, speeds=[1, 2])
    return measurement.prepared, frame_geometry(sequence, measurement.n_frames)


def test_sums_of_a_measured_sequence(measured) -> None:
    prepared, geometry = measured
    tables = noise_tables(replace(prepared, slowest=1), geometry)
    sums, outliers = tables["noise_sums"], tables["noise_outliers"]
    of_errors = sums.filter(pl.col("product") == "error")
    for speed, part in of_errors.group_by("speed"):
        counted = outliers.filter(pl.col("speed") == speed[0])
        assert part["n"].sum() == counted["n"][0] - counted["n_outliers"][0]
        variance = (part["uu"].sum() + part["vv"].sum()) / (2 * part["n"].sum())
        assert variance == pytest.approx(0.04, rel=0.15)
        assert part["white"].sum() == part["n"].sum()
        assert (part["age"] % speed[0] == 0).all()
    assert (of_errors["first"] > of_errors["n"]).all()  # the camera moves towards the points
    assert sums.filter(pl.col("speed") == 2)["block"].max() == 0


def test_errors_beyond_the_limit_are_counted_and_left_out(measured) -> None:
    prepared, geometry = measured
    seen = prepared.seen
    error = seen.error_px.copy()
    gross = np.flatnonzero((seen.age == 2) & seen.visible)[:3]
    error[gross] += 50.0
    spoilt = replace(prepared, seen=replace(seen, error_px=error))
    before, after = (noise_tables(one, geometry) for one in (prepared, spoilt))
    assert after["noise_outliers"]["n_outliers"].sum() == before["noise_outliers"]["n_outliers"].sum() + 3
    assert after["noise_sums"]["uu"].sum() < before["noise_sums"]["uu"].sum()


def test_scans_have_no_sums(measured) -> None:
    prepared, geometry = measured
    tables = noise_tables(replace(prepared, key_frame=3), geometry)
    assert all(table.is_empty() for table in tables.values())


def test_sampled_tracks_have_the_errors_of_the_sums(measured, monkeypatch) -> None:
    prepared, geometry = measured
    tables = noise_tables(replace(prepared, slowest=1), geometry)
    found, sums = tables["track_errors"], tables["noise_sums"].filter(pl.col("product") == "error")
    for (speed,), part in found.filter(pl.col("age") > 0).group_by("speed"):
        assert part.height <= sums.filter(speed=speed)["n"].sum()
        assert (part["du_px"] ** 2 + part["dv_px"] ** 2).mean() == pytest.approx(0.08, rel=0.2)
    born = found.filter(age=0)
    assert not born.select("du_px", "dv_px").to_numpy().any()
    assert born["motion_px"].null_count() == born.height
    monkeypatch.setattr(noise_sums, "MOST_TRACKS", 10)
    some = noise_tables(replace(prepared, slowest=1), geometry)["track_errors"]
    assert some.filter(age=0).group_by("speed").len()["len"].to_list() == [10, 10]
    assert some.join(found, on=found.columns, how="semi", nulls_equal=True).height == some.height
