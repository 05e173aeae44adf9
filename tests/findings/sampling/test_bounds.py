"""Intervals of the same statistics by several methods."""

import numpy as np
import polars as pl

from tracknoise.findings.sampling.bounds import Method, pooled, pooled_by
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.units import units_of

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
