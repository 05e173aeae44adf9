"""The noise of an oracle in windows, from the images' geometry to the table of a run."""

from collections.abc import Mapping

import numpy as np
import polars as pl
import pytest
from benchmarks.validity.window_noise import CASES, SIGMAS, found, measured, predicted
from benchmarks.window_table import quantities
from tests.lean import without_audit

import tracknoise as tn
from tracknoise.sequences.simulated import Simulated
from tracknoise.sequences.views import View
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.oracle import Oracle

NOISE_PX = 0.4


class Dark(View):
    """Images are black: an oracle does not look at them, and to render them takes longer than to measure."""

    def image(self, index):
        return np.zeros((self.camera.height, self.camera.width), dtype=np.uint8)


@pytest.fixture(scope="module")
def run() -> tn.Run:
    options = {"frames": 14, "width": 320, "height": 240, "supersampling": 1, "worlds": 6}
    reader = Simulated(motions=("sideways",), **options)
    measured = [
        tn.measure(Dark(reader.open(scene)), Oracle(covariance_px2=((NOISE_PX**2, 0.0), (0.0, NOISE_PX**2))))
        for scene in reader.sequences()
    ]
    with without_audit():
        return tn.analyse(measured)


@pytest.fixture(scope="module")
def table(run: tn.Run) -> pl.DataFrame:
    return run.table("window_sigmas", trimming="untrimmed")


@pytest.mark.parametrize("window", [5, 10])
def test_independent_noise_is_honest_in_every_window(table, window):
    rows = {row["quantity"]: row for row in table.filter(window=window).to_dicts()}
    # the oracle's first position is exact, and its later ones have the noise: residuals show nearly all of it
    assert 0.9 * NOISE_PX < rows["residual_sigma"]["value"] < 1.02 * NOISE_PX
    assert rows["overconfidence"]["value"] == pytest.approx(1.0, abs=0.2)
    assert rows["gate_95"]["value"] == pytest.approx(1.0, abs=0.1)
    for row in rows.values():
        assert row["low"] is None or row["low"] <= row["value"] <= row["high"]


def test_other_code_finds_the_same_in_the_observations(run, table):
    found = quantities(RunFolder(run.path), 10, least_parallax_px=1.0, trimmed=False)
    n, _, residual, consistent = found["oracle"]
    (row,) = table.filter(window=10, quantity="consistent_sigma").to_dicts()
    (share,) = table.filter(window=10, quantity="depth_share")["value"].to_list()
    assert n == round(share * row["n"])
    assert consistent == pytest.approx(row["value"], rel=0.02)  # the median of a histogram
    assert residual == pytest.approx(NOISE_PX, rel=0.1)


def test_depth_intervals_of_other_scenes_hold_what_they_claim(run):
    found = run.table("depth_intervals", trimming="untrimmed").filter(window=10, quantity="coverage_95")
    shares = {row["covariance"]: row for row in found.to_dicts()}
    assert set(shares) == {"1 px", "residual sigma", "consistent sigma", "whole tracks"}
    for name in ("residual sigma", "consistent sigma", "whole tracks"):
        # features leave their points along surfaces, which costs a few depths
        assert shares[name]["value"] == pytest.approx(0.93, abs=0.05)
        assert shares[name]["n_scenes"] == 6
    (headline,) = run.findings().filter(topic="depth")["text"].to_list()
    assert "Windows have 10 frames" in headline


Pairs = Mapping[str, tuple[float, float]]


@pytest.fixture(scope="module", params=["sideways", "forward"])
def planted(request: pytest.FixtureRequest) -> dict[str, Pairs]:
    """Of each kind of planted noise, what was measured in windows of 10 and what linear algebra predicts."""
    measurements = measured(request.param, scenes=1, frames=11, features=2000, seed=0)
    rows = {row["tracker"]: row for row in found(measurements).filter(window=10).to_dicts()}
    predictions = {name: predicted(measurements, name, 10) for name in CASES}
    return {name: {each: (rows[name][each], predictions[name][each]) for each in SIGMAS} for name in CASES}


@pytest.mark.parametrize("name", CASES)
def test_residual_and_consistent_sigma_are_those_of_the_planted_noise(planted, name):
    for quantity, rel in zip(SIGMAS, (0.03, 0.12, 0.12), strict=True):  # about 1000 windows: 4 % of a median
        value, expected = planted[name][quantity]
        assert value == pytest.approx(expected, rel=rel), quantity


def test_detection_noise_is_honest_and_a_walk_makes_depths_less_certain_than_residuals_say(planted):
    residual, consistent, overconfidence = (planted["detection"][quantity] for quantity in SIGMAS)
    assert (residual[1], consistent[1]) == pytest.approx((0.3, 0.3), rel=0.01)
    assert residual[0] == pytest.approx(0.3, rel=0.03)
    assert overconfidence[0] == pytest.approx(1.0, abs=0.1)
    assert planted["walk"]["overconfidence"][0] > 2
