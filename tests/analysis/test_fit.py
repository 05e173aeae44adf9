import numpy as np
import pytest
from scipy.optimize import nnls

from tracknoise.analysis.growth_models import GrowthFit, misfit

SINCE = np.arange(1.0, 21.0)
EVEN = np.ones(20)


@pytest.mark.parametrize("truth", [(0.04, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 9e-4), (0.04, 0.01, 9e-4)])
def test_what_went_in_comes_back(truth: tuple[float, float, float]) -> None:
    second = SINCE[:, None] ** [0, 1, 2] @ truth
    assert GrowthFit.at(SINCE, EVEN).bounded(second) == pytest.approx(truth, abs=1e-12)
    assert GrowthFit.at(SINCE, EVEN).free(second) == pytest.approx(truth, abs=1e-12)
    assert misfit(second, SINCE, np.array(truth)) == pytest.approx(0.0, abs=1e-12)


def test_the_fit_is_that_of_nonnegative_least_squares_by_search() -> None:
    rng = np.random.default_rng(0)
    second, weight = rng.normal(0.3, 0.5, (20, 200)), rng.uniform(0.1, 2, 20)
    root = np.sqrt(weight)
    columns = SINCE[:, None] ** [0, 1, 2] * root[:, None]
    expected = np.stack([nnls(columns, root * values)[0] for values in second.T], axis=1)
    found = GrowthFit.at(SINCE, weight).bounded(second)
    assert found == pytest.approx(expected, abs=1e-9)
    assert (found == 0).any(axis=1).all()  # the bounds matter
    assert GrowthFit.at(SINCE, weight).free(second).min() < 0


def test_curves_of_any_shape_are_fitted_at_once() -> None:
    second = np.random.default_rng(1).random((20, 2, 3))
    found = GrowthFit.at(SINCE, EVEN).bounded(second)
    assert found.shape == (3, 2, 3)
    assert found[:, 1, 2] == pytest.approx(GrowthFit.at(SINCE, EVEN).bounded(second[:, 1, 2]), rel=1e-9)


def test_what_falls_with_age_is_missed() -> None:
    second = 1 / SINCE
    assert misfit(second, SINCE, GrowthFit.at(SINCE, EVEN).bounded(second)) > 0.5
