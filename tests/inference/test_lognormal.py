"""Intervals of scales that differ much between scenes; `benchmarks/validity/differing_scenes.py` does it in full."""

import numpy as np
import pytest
from benchmarks.validity.differing_scenes import World, coverage

from tracknoise.inference.jackknife import student_interval, variance_of_units

RUNS = 2000


@pytest.mark.parametrize("n_scenes", [8, 11, 28])
@pytest.mark.parametrize("world", [World(0.0, 0.0), World(0.4, 0.0), World(0.7, 0.0), World(1.1, 0.0)])
def test_scales_of_scenes_that_differ_are_held_as_often_as_it_says(n_scenes: int, world: World) -> None:
    held = dict(coverage(n_scenes, world, runs=RUNS, seed=n_scenes))
    for name in ("second, features", "second, scenes", "second, geometric"):
        assert 0.93 - 0.012 < held[name] < 0.975 + 0.007, name


def test_heavy_tails_are_held_more_often_than_by_the_jackknife_alone() -> None:
    rng = np.random.default_rng(0)
    values = 0.01 + (0.3 * rng.standard_t(3, size=(8, 5000)) / np.sqrt(3)) ** 2
    mean, without = values.mean(axis=0), (values.sum(axis=0) - values) / 7
    low, high = student_interval(mean, without, scale="log")
    logs, change = np.log(mean), np.log(mean) - np.log(without)
    width = 2.365 * np.sqrt((change**2).sum(axis=0) * 49 / 56)
    alone = (np.exp(logs - width) <= 0.1) & (np.exp(logs + width) >= 0.1)
    assert ((low <= 0.1) & (high >= 0.1)).mean() > alone.mean() + 0.08


def test_the_printed_value_lies_in_its_interval() -> None:
    rng = np.random.default_rng(1)
    values = np.concatenate([rng.lognormal(sigma=2.0, size=(8, 500)), rng.random((8, 500)) ** 8], axis=1)
    sizes = rng.lognormal(sigma=1.0, size=values.shape)
    total, all_of = (sizes * values).sum(axis=0), sizes.sum(axis=0)
    low, high = student_interval(total / all_of, (total - sizes * values) / (all_of - sizes), scale="log", sizes=sizes)
    assert ((low < total / all_of) & ~(high < total / all_of)).all()


def test_a_scene_of_0_among_others_leaves_finite_bounds() -> None:
    values = np.array([0.0, 1, 2, 1, 2, 1, 2, 1])[:, None]
    low, high = student_interval(values.mean(axis=0), (values.sum(axis=0) - values) / 7, scale="log")
    assert 0 < low[0] < values.mean() < high[0] < 10


def test_variance_is_that_of_a_textbook_and_about_the_means_of_groups() -> None:
    rng = np.random.default_rng(2)
    values, group = rng.normal(size=(8, 5)), np.repeat([0, 1, 2, 3], 2)
    variance, freedom = variance_of_units(values, np.ones((8, 1)))
    np.testing.assert_allclose(variance, values.var(axis=0, ddof=1))
    assert freedom == pytest.approx(7)
    apart, freedom = variance_of_units(values + 100 * group[:, None], np.ones((8, 1)), group)
    np.testing.assert_allclose(apart, ((values[::2] - values[1::2]) ** 2).sum(axis=0) / 8)
    assert freedom == pytest.approx(4)


def test_small_units_count_less_in_a_variance() -> None:
    values, sizes = np.array([1.0, 1, 1, 1, 1, 9])[:, None], np.array([50.0, 60, 50, 70, 50, 1])[:, None]
    with_small, _ = variance_of_units(values, sizes)
    alike, _ = variance_of_units(values, np.ones((6, 1)))
    assert with_small < alike / 10


def test_an_infinite_value_has_no_variance_and_no_warning() -> None:
    variance, _ = variance_of_units(np.array([[-np.inf], [0.0], [1.0]]), np.ones((3, 1)))
    assert np.isnan(variance).all()
