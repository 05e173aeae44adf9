import numpy as np
import pytest

from tracknoise.exceptions import SettingsError
from tracknoise.inference.bootstrap import draws, draws_within, interval, leave_one_out, resample
from tracknoise.inference.jackknife import acceleration


def means(sums: np.ndarray, count: int, **options: object) -> tuple[np.ndarray, np.ndarray]:
    """Intervals of the mean over units of values (units, points), each point by itself."""
    columns = sums[..., None]
    drawn = resample(columns, draws(count))[..., 0] / count
    without = leave_one_out(columns)[..., 0] / (count - 1)
    made = {"n_units": count, "acceleration": acceleration(without), **options}
    return interval(sums.mean(axis=0), drawn, **made)


def held(low: np.ndarray, high: np.ndarray, true: float) -> float:
    return float(((low <= true) & (true <= high)).mean())


def test_every_draw_has_as_many_units_as_there_are_and_the_seed_decides():
    counts = draws(7, n_draws=50, seed=3)
    assert counts.shape == (50, 7)
    assert (counts.sum(axis=1) == 7).all()
    assert np.array_equal(counts, draws(7, n_draws=50, seed=3))
    assert not np.array_equal(counts, draws(7, n_draws=50, seed=4))
    assert counts.std() > 0


def test_draws_stay_within_their_stratum():
    counts = draws_within([3, 5], n_draws=100)
    assert (counts[:, :3].sum(axis=1) == 3).all()
    assert (counts[:, 3:].sum(axis=1) == 5).all()


def test_resampled_sums_are_those_of_the_units_as_often_as_drawn():
    rng = np.random.default_rng(0)
    sums, weights = rng.normal(size=(4, 3, 2)), np.array([[1.0, 1, 1, 1], [2, 0, 1, 1], [0, 0, 0, 4]])
    found = resample(sums, weights)
    assert found.shape == (3, 3, 2)
    np.testing.assert_allclose(found[0], sums.sum(axis=0))
    np.testing.assert_allclose(found[1], 2 * sums[0] + sums[2] + sums[3])
    np.testing.assert_allclose(found[2], 4 * sums[3])


def test_leaving_out_each_unit_in_turn():
    sums = np.array([1.0, 10, 100]).reshape(3, 1, 1)
    assert leave_one_out(sums).ravel().tolist() == [110, 101, 11]


def test_percentiles_of_many_units_are_those_of_a_normal_mean():
    values = np.random.default_rng(1).normal(2.0, 3.0, size=(400, 1))
    low, high = means(values, 400, kind="percentile")
    error = values.std(ddof=1) / 20
    np.testing.assert_allclose([low[0], high[0]], values.mean() + error * np.array([-1.966, 1.966]), atol=0.2 * error)


def test_a_wider_level_makes_a_wider_interval():
    values = np.random.default_rng(2).normal(size=(10, 5))
    narrow, wide = means(values, 10, level=0.8), means(values, 10, level=0.99)
    assert (wide[0] < narrow[0]).all()
    assert (narrow[1] < wide[1]).all()


@pytest.mark.parametrize("kind", ["percentile", "bca"])
@pytest.mark.parametrize("n_units", [8, 28])
def test_intervals_of_a_mean_hold_it_as_often_as_they_say(kind, n_units):
    values = np.random.default_rng(5).normal(1.0, 2.0, size=(n_units, 2000))
    assert 0.935 < held(*means(values, n_units, kind=kind), 1.0) < 0.97


def test_without_expansion_intervals_of_few_units_would_be_too_narrow():
    values = np.random.default_rng(5).normal(size=(8, 1000))
    assert held(*means(values, 8, n_units=10**9), 0.0) < 0.92


def test_bca_is_nearer_to_its_level_than_percentiles_on_either_side_of_a_skewed_mean():
    values = np.random.default_rng(7).lognormal(sigma=0.6, size=(28, 2500))
    true = np.exp(0.18)
    below = {kind: float((means(values, 28, kind=kind)[1] < true).mean()) for kind in ("percentile", "bca")}
    assert abs(below["bca"] - 0.025) < abs(below["percentile"] - 0.025) - 0.005


def test_bca_does_not_depend_on_the_scale_on_which_a_statistic_is_written():
    values = np.random.default_rng(8).lognormal(sigma=0.5, size=(12, 3))
    columns = values[..., None]
    drawn = resample(columns, draws(12))[..., 0] / 12
    for power in (1.0, 3.0):  # percentiles go along exactly; the acceleration nearly
        low, high = interval(values.mean(axis=0) ** power, drawn**power, n_units=12, kind="percentile")
        np.testing.assert_allclose(low ** (1 / power), means(values, 12, kind="percentile")[0], rtol=2e-3)
        np.testing.assert_allclose(high ** (1 / power), means(values, 12, kind="percentile")[1], rtol=2e-3)


@pytest.mark.parametrize("kind", ["percentile", "bca"])
def test_units_that_are_all_alike_leave_no_interval_but_the_value(kind):
    low, high = means(np.full((9, 2), 0.1), 9, kind=kind)
    np.testing.assert_allclose(low, 0.1, rtol=1e-14)
    np.testing.assert_allclose(high, 0.1, rtol=1e-14)


def test_what_rests_on_one_unit_or_is_undefined_has_no_bounds():
    values = np.random.default_rng(9).normal(size=(6, 3))
    columns = values[..., None]
    drawn, without = resample(columns, draws(6))[..., 0], leave_one_out(columns)[..., 0]
    low, high = interval([0.0, 0.0, np.nan], drawn, n_units=[6, 1, 6], acceleration=acceleration(without))
    assert np.isnan(low).tolist() == np.isnan(high).tolist() == [False, True, True]


def test_draws_without_a_value_are_left_out():
    values = np.random.default_rng(10).normal(size=(8, 1))
    columns = values[..., None]
    drawn, without = resample(columns, draws(8))[..., 0] / 8, leave_one_out(columns)[..., 0] / 7
    options = {"n_units": 8, "acceleration": acceleration(without)}
    expected = interval(values.mean(axis=0), drawn, **options)
    missing = np.concatenate([drawn, np.full((30, 1), np.nan)])
    assert interval(values.mean(axis=0), missing, **options) == expected


def test_strata_that_differ_do_not_make_the_interval_wider():
    rng = np.random.default_rng(11)
    values = rng.normal(size=(32, 1)) + np.repeat([0.0, 100.0], 16)[:, None]
    columns, strata = values[..., None], np.repeat([0, 1], 16)
    drawn = resample(columns, draws_within([16, 16]))[..., 0] / 32
    grows = acceleration(leave_one_out(columns)[..., 0] / 31, strata)
    low, high = interval(values.mean(axis=0), drawn, n_units=16, acceleration=grows)
    assert 0.5 < (high - low)[0] < 1.1  # 2 t(15) sqrt(16 / 15) / sqrt(32) = 0.78


@pytest.mark.parametrize(("options", "message"), [({"kind": "normal"}, "kind of interval"), ({"level": 95}, "level")])
def test_a_kind_or_level_that_is_none_is_refused(options, message):
    with pytest.raises(SettingsError, match=message):
        means(np.zeros((6, 1)), 6, **options)
