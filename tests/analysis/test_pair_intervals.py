"""Quantities of two cameras, of positions whose errors are planted."""

import numpy as np
import polars as pl
import pytest
from benchmarks.validity import pair_coverage

from tracknoise.analysis.pair_intervals import PAIRS, pair_intervals
from tracknoise.statistics.pair_sums import pair_sums
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.tables.schema import PAIR_SUMS, empty

FIRST, SECOND = pair_coverage.FIRST_PX, pair_coverage.SECOND_PX


def values(law: str, correlation: float, scenes: int = 60) -> dict[str, dict]:
    rng = np.random.default_rng(4)
    return {row["quantity"]: row for row in pair_coverage.quantities(law, correlation, scenes, rng).to_dicts()}


@pytest.fixture(scope="module")
def white():
    return values("white", 0.0)


def test_correlations_are_those_that_were_planted(white):
    for axis in "uv":
        assert abs(white[f"correlation_{axis}"]["value"]) < 0.03
        shared = values("white", pair_coverage.SHARED)[f"correlation_{axis}"]
        assert shared["low"] < pair_coverage.SHARED < shared["high"]


def test_sizes_are_those_of_both_errors(white):
    both = np.hypot(FIRST, SECOND)
    assert white["epipolar_core"]["value"] == pytest.approx(both, rel=0.12)
    assert white["disparity_core"]["value"] == pytest.approx(both, rel=0.12)
    assert white["disparity_mean"]["low"] < 0.0 < white["disparity_mean"]["high"]


def test_depths_spread_with_their_square(white):
    per_px = 1.0 / (450.0 * 0.12)
    square = white["depth_sd_square"]["value"]
    assert square == pytest.approx(white["disparity_core"]["value"] * per_px, rel=0.1)
    assert abs(white["depth_sd_constant"]["value"]) < 0.1 * square * 4.0


def test_units_are_stated():
    table = pair_coverage.quantities("white", 0.0, 3, np.random.default_rng(1))
    assert table.schema == dict(PAIRS)
    assert {f"pair_{name}" for name in table["quantity"]} == {*PAIRS.quantities}


def test_without_a_second_camera_there_are_no_rows():
    assert pair_intervals([empty(PAIR_SUMS)]).is_empty()
    assert pair_intervals([]).is_empty()


def test_depths_of_one_size_show_no_law():
    sums = pair_coverage.scene("s", "white", 0.0, np.random.default_rng(1))
    one = sums.filter(pl.col("cell") == sums["cell"].mode()[0])
    assert "depth_sd_square" not in {*pair_intervals([one])["quantity"]}


def test_observations_without_a_true_depth_have_no_sums():
    observations, tracks = pair_coverage.tables("s", "white", 0.0, np.random.default_rng(1))
    unknown = observations.with_columns(first_depth_m=pl.lit(None, pl.Float64))
    assert pair_sums(prepare_sequence(unknown, tracks)).is_empty()
