"""Quantities of windows of single scenes: those of a condition that has this scene alone."""

import numpy as np
import polars as pl
import pytest

from tracknoise.estimators.window_noise import scene_quantities, window_sigmas
from tracknoise.statistics.histograms import LOG_HISTOGRAM_BINS, bin_of
from tracknoise.tables.schema import ORIGIN, WINDOW_NOISE

SCENES = ("one", "two", "three")


def windows(scene, seed):
    """Windows of 5 and 10 observations of a made-up scene, as the table of a sequence holds them."""
    rng = np.random.default_rng(seed)
    origin = dict(zip(ORIGIN, ["simulated", scene, "default", 0, "forward", "", "lk", 1], strict=True))
    rows = []
    for window in (5, 10):
        freedom = 2 * window - 3
        residuals = np.sqrt(rng.chisquare(freedom, 200) / freedom) * 0.3
        z = 0.4 * np.abs(rng.standard_normal(150))
        squares = float((residuals**2).sum() * freedom / 2)
        sums = {"squares_u": squares, "freedom_u": 100.0 * freedom, "squares_v": squares, "freedom_v": 100.0 * freedom}
        counts = {
            name: np.bincount(bin_of(of), minlength=LOG_HISTOGRAM_BINS).tolist()
            for name, of in (("residual", residuals), ("z", z))
        }
        rows.append(
            {**origin, "trimming": "untrimmed", "window": window, "n": 200, "n_depth": 150, **sums}
            | {"squares_z": float((z**2).sum()), "residual_counts": counts["residual"], "z_counts": counts["z"]}
        )
    return pl.DataFrame(rows, schema=dict(WINDOW_NOISE))


@pytest.fixture
def table():
    return pl.concat(windows(scene, seed) for seed, scene in enumerate(SCENES))


def test_each_scene_has_the_quantities_of_a_condition_of_its_own(table):
    found = scene_quantities(table)
    for scene in SCENES:
        alone = window_sigmas(table.filter(scene=scene)).select("window", "quantity", expected="value", counted="n")
        both = found.filter(scene=scene).join(alone, on=["window", "quantity"])
        assert both.height == alone.height > 20
        assert np.allclose(both["value"], both["expected"])


def test_quantities_rest_on_the_windows_that_show_them(table):
    found = scene_quantities(table)
    assert set(found.filter(quantity="residual_sigma")["n"]) == {200}
    assert set(found.filter(quantity="overconfidence")["n"]) == {150}


def test_without_windows_there_are_no_rows(table):
    assert scene_quantities(table.clear()).is_empty()
