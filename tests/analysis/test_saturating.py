import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.condition_units import units_of
from tracknoise.analysis.growth_models import Parts, SaturatingFit, predicted, saturating_curve
from tracknoise.analysis.time_structure import GROWTH_SUMS, pooled_saturating
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.intervals import Method
from tracknoise.statistics.definitions import LAGS

SINCE = np.arange(1.0, 31.0)
EVEN = np.ones(30)


@pytest.mark.parametrize("truth", [(0.04, 0.09, 6.0), (0.0, 0.09, 3.0), (0.02, 0.5, 20.0)])
def test_what_went_in_comes_back(truth: tuple[float, float, float]) -> None:
    second = saturating_curve(np.array(truth), SINCE)
    assert SaturatingFit.at(SINCE, EVEN).fit(second) == pytest.approx(truth, rel=0.03, abs=2e-3)


def test_a_constant_and_a_line_are_its_limits() -> None:
    flat, line = np.full(30, 0.04), 0.01 * SINCE
    for second in (flat, line):
        fitted = saturating_curve(SaturatingFit.at(SINCE, EVEN).fit(second), SINCE)
        assert fitted == pytest.approx(second, rel=0.1)
    assert (SaturatingFit.at(SINCE, EVEN).fit(1 / SINCE) >= 0).all()


def test_a_line_has_no_longest_time_constant() -> None:
    rng = np.random.default_rng(4)
    scale = np.repeat(rng.lognormal(sigma=0.1, size=8), 12) * rng.lognormal(sigma=0.02, size=96)
    columns = {"scene": np.repeat([f"s{place}" for place in range(8)], 12), "since": np.tile(np.arange(1, 13), 8)}
    sums = {"n": np.full(96, 200.0), "uu": 200 * 0.04 * columns["since"] * scale}
    units = units_of(pl.DataFrame({**columns, **sums, "vv": sums["uu"]}), points=["since"], columns=GROWTH_SUMS)
    weights = Draws(units.scenes, n_draws=200).weights(units)
    found = pooled_saturating(units, weights, np.ones(12, dtype=bool), Method().by_bootstrap())[0]["time_constant"]
    assert found.high is None
    assert found.low is not None
    assert found.low > 12


def test_curves_of_any_shape_are_fitted_at_once() -> None:
    second = np.random.default_rng(1).random((30, 2, 3)) + SINCE[:, None, None] / 30
    found = SaturatingFit.at(SINCE, EVEN).fit(second)
    assert found.shape == (3, 2, 3)
    assert found[:, 1, 2] == pytest.approx(SaturatingFit.at(SINCE, EVEN).fit(second[:, 1, 2]), rel=1e-9)


def correlations(errors: np.ndarray) -> np.ndarray:
    steps = np.diff(errors, axis=1)
    pairs = [(steps[:, lag:], steps[:, :-lag]) for lag in range(1, LAGS + 1)]
    return np.array([(a * b).sum() / ((a**2 + b**2) / 2).sum() for a, b in pairs])


@pytest.mark.parametrize("phi", [0.3, 0.8])
@pytest.mark.parametrize("relative", [False, True])
def test_autocorrelations_are_those_of_simulated_processes(phi: float, relative: bool) -> None:
    rng = np.random.default_rng(2)
    process = np.zeros((20_000, 11))
    process[:, 0] = rng.standard_normal(len(process)) if relative else 0
    for k in range(1, 11):
        process[:, k] = phi * process[:, k - 1] + np.sqrt(1 - phi**2) * rng.standard_normal(len(process))
    process -= process[:, :1]
    white = 0.3 * rng.standard_normal(process.shape)
    walk = 0.2 * rng.standard_normal(process.shape)
    walk[:, 0] = white[:, 0] = 0
    drift = 0.1 * rng.standard_normal((len(process), 1)) * np.arange(11)
    found = correlations(process + white + walk.cumsum(axis=1) + drift)
    parts = Parts(*map(np.array, (0.09, 0.04, 0.01, 2.0 if relative else 1.0, phi)), relative)
    expected = predicted(parts, np.full(10, 1.0), np.arange(1.0, 11.0), found[0])
    assert expected == pytest.approx(found, abs=0.012)


def test_an_offset_and_white_noise_differ_at_the_first_lag_only() -> None:
    parts = Parts(*map(np.array, (0.04, 0.0, 0.0, 0.0, 0.0)))
    counts, steps = np.full(10, 1.0), np.arange(1.0, 11.0)
    assert predicted(parts, counts, steps, np.array(-0.5)) == pytest.approx([-0.5, 0, 0, 0, 0], abs=0.05)
    assert predicted(parts, counts, steps, np.array(0.0)) == pytest.approx([0, 0, 0, 0, 0])
