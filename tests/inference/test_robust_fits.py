"""Degrees of freedom of fits whose clusters do not know equally much."""

import numpy as np
import pytest
from scipy import special

from tracknoise.inference.robust_fits import Jackknife, jackknife, normal_equations

EVERY = np.arange(2)


def made(counts_u: list[int], counts_v: list[int]) -> Jackknife:
    """Two numbers: the mean in u of some observations of each cluster, and the mean in v of others."""
    rng = np.random.default_rng(0)
    rows = [
        (cluster, axis)
        for axis, counts in enumerate((counts_u, counts_v))
        for cluster, count in enumerate(counts)
        for _ in range(count)
    ]
    cluster, axis = np.array(rows, dtype=np.intp).T
    design = np.zeros((len(rows), 2, 2))
    design[np.arange(len(rows)), axis, axis] = 1.0
    residual = 1e-6 * rng.standard_normal((len(rows), 2))
    return jackknife(normal_equations(0 * cluster, cluster, design, residual, np.ones(len(rows)), np.full(2, 1e-9)))


def test_equal_clusters_count_fully_and_unequal_ones_less() -> None:
    found = made([30, 30], [30, 10])
    assert found.effective(EVERY[:1]) == pytest.approx(2.0, abs=1e-6)
    assert found.effective(EVERY[1:]) == pytest.approx(40**2 / (30**2 + 10**2), abs=1e-6)


def test_numbers_together_have_the_mean_of_their_shares() -> None:
    """One number is known from the first cluster alone, the other from the second: together from two."""
    found = made([30, 0], [0, 30])
    assert found.effective(EVERY[:1]) == pytest.approx(1.0)
    assert found.effective(EVERY) == pytest.approx(2.0)


def test_an_interval_has_the_degrees_of_freedom_of_its_clusters() -> None:
    found = made([30, 30, 30, 30], [60, 30, 20, 10])
    freedom = np.array([3.0, 120**2 / (60**2 + 30**2 + 20**2 + 10**2) - 1.0])
    assert found.half_widths(0.9) == pytest.approx(special.stdtrit(freedom, 0.95) * found.standard_errors, rel=1e-5)
