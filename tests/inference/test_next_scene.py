"""Spread between scenes, prediction for the next one, and coverage outside the tested range."""

import numpy as np
import polars as pl
import pytest
from scipy import stats

from tracknoise.inference.coverage import MOST_SPREAD, coverage_outside
from tracknoise.inference.next_scene import next_scene
from tracknoise.inference.units import Units


def units_of_values(n_scenes: int, resampled: str | None = "scenes", group: np.ndarray | None = None) -> Units:
    sums, scenes = np.ones((n_scenes, 1, 1)), tuple(map(str, range(n_scenes)))
    return Units(sums, pl.DataFrame(), scenes, np.arange(n_scenes), resampled, group)


def test_spread_and_prediction_are_those_of_a_textbook() -> None:
    own = np.random.default_rng(0).lognormal(size=(1, 3, 8))
    found = next_scene(units_of_values(8), own, ["log"], level=0.9)
    logs = np.log(own[0])
    np.testing.assert_allclose(found.spread[0], logs.std(axis=1, ddof=1))
    reach = stats.t.ppf(0.95, 7) * logs.std(axis=1, ddof=1) * np.sqrt(1 + 1 / 8)
    np.testing.assert_allclose(found.low[0], np.exp(logs.mean(axis=1) - reach))
    np.testing.assert_allclose(found.high[0], np.exp(logs.mean(axis=1) + reach))


@pytest.mark.parametrize(("resampled", "group"), [("scenes", None), ("groups", np.arange(28) % 14)])
def test_the_next_scene_is_held_as_often_as_it_says(resampled: str, group: np.ndarray | None) -> None:
    rng, runs = np.random.default_rng(1), 4000
    of_group = np.arange(28) if group is None else group
    common = 0.9 * rng.normal(size=(runs, of_group.max() + 2))
    own = np.exp(common[:, of_group] + 0.3 * rng.normal(size=(runs, 28)))
    following = np.exp(common[:, -1] + 0.3 * rng.normal(size=runs))
    found = next_scene(units_of_values(28, resampled, group), own[None], ["log"], level=0.95)
    assert 0.93 < ((found.low[0] <= following) & (following <= found.high[0])).mean() < 0.97


def test_few_scenes_have_a_spread_and_no_prediction() -> None:
    own = np.array([[[1.0, 2.0, 4.0, np.nan]]])
    found = next_scene(units_of_values(4, "blocks"), own, ["log"], level=0.95)
    assert found.spread[0, 0] == pytest.approx(np.log(2))
    assert np.isnan([found.low[0, 0], found.high[0, 0]]).all()


def test_a_scene_at_a_limit_of_the_scale_leaves_no_spread() -> None:
    found = next_scene(units_of_values(6), np.array([[[0.0, 1, 2, 3, 4, 5]]]), ["log"], level=0.95)
    assert np.isnan([found.spread, found.low, found.high]).all()


def test_coverage_is_only_given_outside_the_tested_range() -> None:
    n, worth = np.full(4, 8), np.array([8.0, 8.0, 2.0, 8.0])
    spread = np.array([0.5, MOST_SPREAD + 1, 0.5, np.nan])
    found = coverage_outside(n, spread, worth, "log", level=0.95)
    assert np.isnan(found).tolist() == [True, False, False, True]
    assert ((found[1:3] > 0.8) & (found[1:3] < 1)).all()
    linear = coverage_outside(n, spread, worth, "linear", level=0.95)
    assert np.isnan(linear).tolist() == [True, True, False, True]
