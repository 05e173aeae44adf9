"""Small Monte Carlo runs of `benchmarks.validity.time_structure`: kinds of growth are named rightly or refused."""

import numpy as np
import pytest
from benchmarks.validity.time_structure import REFUSED, WORLDS, growth_units_of, one_run, white

from tracknoise.analysis.growth_models import Ages
from tracknoise.analysis.time_structure import growth_fits
from tracknoise.inference.bootstrap import draws
from tracknoise.inference.intervals import Method

RUNS = 6


@pytest.mark.parametrize("name", WORLDS)
def test_growth_is_named_rightly_or_refused(name: str) -> None:
    world, rng = WORLDS[name], np.random.default_rng(3)
    found = [one_run(world, rng, (11, 100, 31), 0.5, short=run % 2 == 1)[0] for run in range(RUNS)]
    right = sum(verdict == world.verdict for verdict in found)
    refused = sum(verdict in REFUSED for verdict in found)
    assert right + refused >= RUNS - 1  # at 97 %, fewer come in 1 % of cases
    if world.truth and world.related is not None:
        assert right >= RUNS - 2


def test_geometric_sizes_hold_the_truth_whatever_the_spread_of_scenes() -> None:
    world, rng = WORLDS["random walk"], np.random.default_rng(4)
    sizes = [one_run(world, rng, (8, 60, 21), 0.7, short=False)[1].geometric["walk"] for _ in range(30)]
    held = sum(size.low <= 0.1 <= size.high for size in sizes)  # type: ignore[operator]
    assert held >= 25  # of 30; a binomial of 95 % is below 25 in 0.3 % of cases


def test_pooled_sizes_hold_the_truth_if_scenes_differ_by_factors() -> None:
    world, rng = WORLDS["random walk"], np.random.default_rng(5)
    sizes = [one_run(world, rng, (8, 60, 21), 0.7, short=False)[1].sizes["walk"] for _ in range(30)]
    true = 0.1 * float(np.exp(0.7**2))
    held = sum(size.low <= true <= size.high for size in sizes)  # type: ignore[operator]
    assert held >= 25  # of 30; with resampling alone they hold it in 75 % of runs


def test_tracks_that_are_lost_do_not_make_the_others_grow() -> None:
    """Tracks of small errors are lost first, so that those left have larger ones: no track's error grows."""
    rng = np.random.default_rng(6)
    scale = np.exp(0.5 * rng.standard_normal((12, 200, 1)))
    errors = scale * white(rng, (12, 200, 16))
    alive = np.ones(errors.shape, dtype=bool)
    alive[..., 8:] = scale > 1
    units = growth_units_of(errors, alive)
    ages = Ages(np.arange(1.0, 16), np.ones(15, dtype=bool), 1)
    fit, _ = growth_fits(units, ages, draws(12, n_draws=100), Method().by_bootstrap())
    second = units.errors.sums[..., 1].sum(axis=0) / units.errors.sums[..., 0].sum(axis=0)
    assert second[9] > 1.2 * second[0]
    assert fit.ratio is not None
    assert fit.ratio.value == pytest.approx(1.0, abs=0.05)
