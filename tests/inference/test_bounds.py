"""Intervals of the same statistics by several methods."""

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.condition_units import units_of
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.intervals import Method, column_means, geometric, pooled, pooled_by

METHODS = [Method("bca"), Method("student"), Method("percentile", 0.8)]


def test_several_methods_give_what_each_gives_and_compute_the_statistics_once() -> None:
    names = [f"scene-{place}" for place in range(8)]
    values = np.random.default_rng(0).lognormal(size=8)
    units = units_of(pl.DataFrame({"scene": names, "n": np.ones(8), "u": values}), points=[], columns=["n", "u"])
    weights = Draws(names, n_draws=200).weights(units)
    asked = []

    def mean(sums: np.ndarray) -> np.ndarray:
        asked.append(sums.shape)
        return (sums[1] / np.where(sums[0] > 0, sums[0], np.nan))[None]

    together = pooled_by(METHODS, units, weights, mean, scales="log")
    assert asked == [(2, 1), (2, 1, 200), (2, 1, 8)]
    for method, found in zip(METHODS, together, strict=True):
        alone = pooled(units, weights, mean, method, scales=["log"])
        assert (found.kind, found.level) == (method.kind, method.level)
        np.testing.assert_array_equal([found.value, found.low, found.high], [alone.value, alone.low, alone.high])


def test_scenes_without_data_at_a_point_add_no_degrees_of_freedom() -> None:
    rng = np.random.default_rng(3)
    blocks = pl.DataFrame(
        {
            "scene": np.repeat(["a", "b", "c"], 16),
            "block": np.tile(np.arange(16), 3),
            "n": np.repeat([1.0, 0.0, 0.0], 16),
            "u": np.append(rng.normal(size=16), np.zeros(32)),
        }
    )
    bounds = []
    for table in (blocks, blocks.filter(scene="a")):
        units = units_of(table, table, points=[], columns=["n", "u"])
        found = pooled(units, np.empty((0, len(units.sums))), column_means, Method())
        bounds.append((found.low.item(), found.high.item(), found.n_units.item(), found.n_scenes.item()))
    assert bounds[0] == pytest.approx(bounds[1], rel=1e-12)


def test_a_scale_of_zero_counts_the_scenes_that_it_is_of() -> None:
    values = pl.DataFrame({"scene": [f"s{place}" for place in range(7)], "n": [1.0] * 7, "u": [0.0, *[2.0] * 6]})
    units = units_of(values, points=[], columns=["n", "u"])

    def logarithm(sums: np.ndarray) -> np.ndarray:
        return np.log(sums[1:], out=np.full_like(sums[1:], -np.inf), where=sums[1:] > 0)

    found = geometric(units, np.empty((0, 7)), logarithm, Method())
    assert (found.value.item(), found.n_units.item(), found.n_scenes.item()) == (0.0, 7, 7)
