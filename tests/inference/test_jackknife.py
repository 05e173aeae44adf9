import numpy as np
import pytest
from scipy import stats

from tracknoise.inference.jackknife import degrees, parts, student_interval


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
    assert 0.94 < held["log"] < 0.975
    assert held["linear"] < held["log"]


def test_bounds_of_shares_are_shares():
    values = np.random.default_rng(2).random((6, 50)) ** 4
    low, high = student_interval(values.mean(axis=0), left_out(values), scale="logit")
    assert (low > 0).all()
    assert (high < 1).all()
    assert (low < high).all()


def test_bounds_of_correlations_are_correlations():
    values = 1 - 2 * np.random.default_rng(6).random((6, 50)) ** 6
    low, high = student_interval(values.mean(axis=0), left_out(values), scale="fisher")
    assert (low > -1).all()
    assert (high < 1).all()
    assert (low < high).all()
    assert np.array(student_interval(np.ones(1), np.ones((6, 1)), scale="fisher")).ravel().tolist() == [1.0, 1.0]


def test_a_share_that_one_unit_makes_alone_has_an_interval():
    values = np.array([[0.5], [0.0], [0.0], [0.0], [0.0], [0.0]])
    low, high = student_interval(values.mean(axis=0), left_out(values), scale="logit")
    assert 0 < low[0] < 1 / 12 < high[0] < 1


def test_at_a_limit_and_without_spread_nothing_is_left_but_the_value():
    for value, scale in ((0.0, "log"), (0.3, "logit"), (-2.0, "linear")):
        values = np.full((6, 1), value)
        np.testing.assert_allclose(student_interval(values.mean(axis=0), left_out(values), scale=scale), value)


@pytest.mark.parametrize("share", [0.0, 1.0, 1e-17, np.nextafter(1.0, 0.0)])  # the last two by rounding
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


def ratios_without(sums: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Ratios of all sums (units, ...) to all sizes but those of one unit."""
    return (sums.sum(axis=0) - sums) / (sizes.sum(axis=0) - sizes)


def test_units_of_one_size_have_one_degree_of_freedom_less_than_there_are():
    assert degrees(np.full(7, 3.0)) == pytest.approx(6.0)
    sizes = np.array([[1.0, 1.0], [1.0, 0.0], [1.0, 1.0]])  # a unit that holds nothing is none
    np.testing.assert_allclose(degrees(sizes), [2.0, 1.0])


def test_a_unit_that_outweighs_all_others_leaves_one_degree_of_freedom():
    assert degrees(np.array([1e9, 1.0, 1.0, 1.0, 1.0, 1.0])) == pytest.approx(1.0, abs=0.01)
    assert degrees(np.array([5.0, 0.0, 0.0])) == 1.0


def test_variance_and_degrees_of_freedom_of_unequal_units_are_those_of_the_variance_itself():
    rng, sizes = np.random.default_rng(5), np.array([9.0, 5.0, 3.0, 1.0, 1.0, 1.0])[:, None]
    values = rng.normal(size=(6, 200_000))
    mean = (values * sizes).sum(axis=0) / sizes.sum()
    variance = np.square(parts(mean - ratios_without(values * sizes, sizes), sizes)).sum(axis=0)
    assert variance.mean() == pytest.approx(np.square(sizes / sizes.sum()).sum(), rel=0.01)
    assert degrees(sizes).item() == pytest.approx(2 * variance.mean() ** 2 / variance.var(), rel=0.02)


@pytest.mark.parametrize("n_units", [6, 8, 11, 28])
def test_units_of_unequal_sizes_are_covered_as_often_as_it_says(n_units):
    rng = np.random.default_rng(n_units)
    sizes = rng.lognormal(sigma=0.6, size=(n_units, 10_000))
    sums = sizes * rng.normal(size=sizes.shape)
    mean, without = sums.sum(axis=0) / sizes.sum(axis=0), ratios_without(sums, sizes)
    held = {}
    for name, known in (("sizes", sizes), ("none", None)):
        low, high = student_interval(mean, without, sizes=known)
        held[name] = float(((low <= 0) & (high >= 0)).mean())
    assert 0.94 < held["sizes"] < 0.98
    assert held["none"] < held["sizes"]
