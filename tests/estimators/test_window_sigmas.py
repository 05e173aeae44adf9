"""Quantities of windows from their sums and histograms."""

import numpy as np
import polars as pl
import pytest

from tracknoise.estimators.window_noise import QUANTITIES, window_sigmas
from tracknoise.statistics.histograms import LOG_HISTOGRAM_BINS, bin_of
from tracknoise.tables.schema import WINDOW_NOISE

SIGMA_PX, DEPTH_PX, WINDOW, COUNT = 0.3, 0.9, 10, 20_000


def table(scene: str, *, lost: float = 0.0, scale: float = 1.0) -> pl.DataFrame:
    """Windows whose residuals have `SIGMA_PX`, and z `DEPTH_PX`, both times a scale; a share has 100 times as much."""
    rng = np.random.default_rng(len(scene))
    factor = scale * np.where(rng.random(COUNT) < lost, 100.0, 1.0)
    freedom = 2 * WINDOW - 3
    squares = (SIGMA_PX * factor) ** 2 * rng.chisquare(freedom, COUNT)
    z = np.abs(DEPTH_PX * factor * rng.standard_normal(COUNT))
    row = {
        "dataset": "d",
        "scene": scene,
        "lighting": "l",
        "rotation": 0,
        "direction": "forward",
        "camera": "",
        "tracker": "lk",
        "speed": 1,
        "trimming": "untrimmed",
        "window": WINDOW,
        "n": COUNT,
        "n_depth": COUNT,
        **{f"squares_{axis}": squares.sum() / 2 for axis in "uv"},
        **{f"freedom_{axis}": COUNT * freedom / 2 for axis in "uv"},
        "squares_z": (z**2).sum(),
        "residual_counts": np.bincount(bin_of(np.sqrt(squares / freedom)), minlength=LOG_HISTOGRAM_BINS).tolist(),
        "z_counts": np.bincount(bin_of(z), minlength=LOG_HISTOGRAM_BINS).tolist(),
    }
    return pl.DataFrame([{name: row[name] for name in WINDOW_NOISE}], schema=dict(WINDOW_NOISE))


def quantities(**options: float) -> dict[str, float]:
    found = window_sigmas([table("s" * (1 + number), **options) for number in range(7)])
    return dict(found.select("quantity", "value").iter_rows())


def test_without_tails_both_sizes_of_residuals_are_the_same() -> None:
    found = quantities()
    assert set(found) == set(QUANTITIES)
    assert found["residual_sigma"] == pytest.approx(SIGMA_PX, rel=0.01)
    assert found["residual_core"] == pytest.approx(SIGMA_PX, rel=0.02)
    assert found["consistent_sigma"] == pytest.approx(DEPTH_PX, rel=0.02)
    assert found["overconfidence"] == pytest.approx(3.0, rel=0.02)
    assert found["core_overconfidence"] == pytest.approx(3.0, rel=0.03)


def test_a_few_lost_tracks_change_the_residual_sigma_and_hardly_the_core() -> None:
    found = quantities(lost=0.02)
    assert found["residual_sigma"] > 10 * SIGMA_PX
    assert found["overconfidence"] < 0.3
    assert found["residual_core"] == pytest.approx(SIGMA_PX, rel=0.03)
    assert found["core_overconfidence"] == pytest.approx(3.0, rel=0.05)


def test_tracks_without_errors_have_no_overconfidence() -> None:
    found = quantities(scale=1e-12)
    assert found["residual_sigma"] == pytest.approx(1e-12 * SIGMA_PX, rel=0.01)
    medians = {"consistent_sigma", "residual_core", "overconfidence", "core_overconfidence"}
    assert medians.isdisjoint(found)
    assert not any(name.startswith(("coverage", "gate")) for name in found)
