import numpy as np
import pytest
from scipy import stats

from tracknoise.findings.sampling.jackknife import student_interval


def left_out(values: np.ndarray) -> np.ndarray:
    """Means of all values (units, ...) but one."""
    return (values.sum(axis=0) - values) / (len(values) - 1)


def test_of_a_mean_it_is_the_interval_of_a_textbook():
    values = np.random.default_rng(0).normal(3.0, 2.0, size=(9, 4))
    low, high = student_interval(values.mean(axis=0), left_out(values))
    book = stats.t.interval(0.95, 8, loc=values.mean(axis=0), scale=stats.sem(values, axis=0))
    np.testing.assert_allclose([low, high], book)


@pytest.mark.parametrize("n_units", [6, 8, 11, 28])
def test_it_holds_a_skewed_second_moment_more_often_than_on_a_linear_scale(n_units):
    values = np.random.default_rng(1).lognormal(sigma=0.6, size=(n_units, 20_000))
    held = {}
    for scale in ("linear", "log"):
        low, high = student_interval(values.mean(axis=0), left_out(values), scale=scale)
        held[scale] = float(((low <= np.exp(0.18)) & (high >= np.exp(0.18))).mean())
    assert 0.925 < held["log"] < 0.96
    assert held["linear"] < held["log"]


def test_bounds_of_shares_are_shares():
    values = np.random.default_rng(2).random((6, 50)) ** 4
    low, high = student_interval(values.mean(axis=0), left_out(values), scale="logit")
    assert (low > 0).all()
    assert (high < 1).all()
    assert (low < high).all()


def test_a_share_that_one_unit_makes_alone_has_an_interval():
    values = np.array([[0.5], [0.0], [0.0], [0.0], [0.0], [0.0]])
    low, high = student_interval(values.mean(axis=0), left_out(values), scale="logit")
    assert 0 < low[0] < 1 / 12 < high[0] < 1


def test_at_a_limit_and_without_spread_nothing_is_left_but_the_value():
    for value, scale in ((0.0, "log"), (0.3, "logit"), (-2.0, "linear")):
        values = np.full((6, 1), value)
        np.testing.assert_allclose(student_interval(values.mean(axis=0), left_out(values), scale=scale), value)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_what_was_never_seen_or_always_has_no_bounds(share: float) -> None:
    values = np.full((6, 1), share)
    assert np.isnan(student_interval(values.mean(axis=0), left_out(values), scale="logit")).all()


def test_strata_that_differ_do_not_make_it_wider_and_add_to_the_degrees_of_freedom():
    values = np.random.default_rng(3).normal(size=(32, 1))
    strata = np.repeat([0, 1], 16)
    apart = values + 100 * strata[:, None]
    options = {"n_units": 16, "strata": strata}
    low, high = student_interval(apart.mean(axis=0), left_out(apart), **options)
    within = np.sqrt(sum(values[strata == place].var(ddof=1) for place in (0, 1)) / 16) / 2
    np.testing.assert_allclose(high - low, 2 * stats.t.ppf(0.975, 30) * within, rtol=1e-6)


def test_what_rests_on_one_unit_or_is_undefined_has_no_bounds():
    values = np.random.default_rng(4).normal(size=(6, 3))
    middle = np.array([0.0, 0.0, np.nan])
    low, high = student_interval(middle, left_out(values), n_units=[6, 1, 6])
    assert np.isnan(low).tolist() == np.isnan(high).tolist() == [False, True, True]
