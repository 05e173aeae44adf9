"""The noise of an oracle in windows, from the images' geometry to the table of a run."""

import polars as pl
import pytest

import tracknoise as tn
from tracknoise.sequences.simulated import Simulated
from tracknoise.trackers.oracle import Oracle

NOISE_PX = 0.4


@pytest.fixture(scope="module")
def table() -> pl.DataFrame:
    options = {"frames": 14, "width": 320, "height": 240, "supersampling": 1, "worlds": 6}
    reader = Simulated(motions=("sideways",), **options)
    measured = [
        tn.measure(reader.open(scene), Oracle(covariance_px2=((NOISE_PX**2, 0.0), (0.0, NOISE_PX**2))))
        for scene in reader.sequences()
    ]
    return tn.analyse(measured).table("window_sigmas", trimming="untrimmed")


@pytest.mark.parametrize("window", [5, 10])
def test_independent_noise_is_honest_in_every_window(table, window):
    rows = {row["quantity"]: row for row in table.filter(window=window).to_dicts()}
    # the oracle's first position is exact, and its later ones have the noise: residuals show nearly all of it
    assert 0.9 * NOISE_PX < rows["residual_sigma"]["value"] < 1.02 * NOISE_PX
    assert rows["overconfidence"]["value"] == pytest.approx(1.0, abs=0.2)
    assert rows["gate_95"]["value"] == pytest.approx(1.0, abs=0.1)
    for row in rows.values():
        assert row["low"] is None or row["low"] <= row["value"] <= row["high"]
