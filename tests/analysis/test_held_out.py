import numpy as np
import pytest

from tracknoise.analysis.error_shape import MAX_FITTED, MIN_FITTED, gains
from tracknoise.inference.densities import fit_gaussian, fit_mixture, fit_student, terms


def student(rng: np.random.Generator, nu: float, n: int) -> np.ndarray:
    return rng.standard_normal((n, 2)) * np.sqrt(nu / rng.chisquare(nu, n))[:, None]


def found(*samples: np.ndarray):
    sample = np.repeat(np.arange(len(samples)), [len(pairs) for pairs in samples])
    pairs = np.concatenate(samples)
    return gains(pairs, sample, np.arange(len(pairs)) % 4, len(samples)), sample


def test_heavy_tails_gain_and_a_gaussian_does_not() -> None:
    rng = np.random.default_rng(0)
    gained, sample = found(student(rng, 3, 2000), rng.standard_normal((2000, 2)))
    assert gained.student[sample == 0].mean() > 0.2
    assert abs(gained.student[sample == 1].mean()) < 0.005
    assert abs(gained.mixture[sample == 1].mean()) < 0.005
    assert gained.nu[0] == pytest.approx(3.0, abs=0.7)


def test_gains_do_not_depend_on_units_but_the_spread_does() -> None:
    pairs = student(np.random.default_rng(1), 4, 600)
    one, _ = found(pairs)
    other, _ = found(3 * pairs)
    assert other.student == pytest.approx(one.student, abs=1e-9)
    assert other.spread == pytest.approx(3 * one.spread, rel=1e-9)


def test_a_fold_is_told_by_what_was_fitted_to_the_others() -> None:
    rng = np.random.default_rng(2)
    folds = [rng.standard_normal((300, 2)), 1.5 * rng.standard_normal((300, 2)), student(rng, 3, 300)]
    fold = np.repeat([4, 0, 2], 300)
    gained = gains(np.concatenate(folds), np.zeros(900, dtype=np.intp), fold, 1)
    for place, one in enumerate(folds):
        rest = terms([np.concatenate([other for other in folds if other is not one])])
        normal = fit_gaussian(rest).log_density(terms([one]))
        there = slice(300 * place, 300 * (place + 1))
        heavy, mixed = fit_student(rest, rounds=400), fit_mixture(rest)
        assert gained.student[there] == pytest.approx((heavy.log_density(terms([one])) - normal)[0], rel=1e-3, abs=1e-4)
        assert gained.mixture[there] == pytest.approx((mixed.log_density(terms([one])) - normal)[0], rel=1e-9)


def test_of_one_fold_nothing_is_told() -> None:
    pairs = np.random.default_rng(6).normal(size=(300, 2))
    assert np.isnan(gains(pairs, np.zeros(300, dtype=np.intp), np.zeros(300, dtype=np.intp), 1).student).all()


def test_no_more_than_so_many_are_fitted_and_all_are_told() -> None:
    gained, _ = found(student(np.random.default_rng(3), 5, 5 * MAX_FITTED))
    assert np.isfinite(gained.student).all()


@pytest.mark.parametrize("pairs", [np.ones((200, 2)), np.random.default_rng(4).normal(size=(MIN_FITTED, 2))])
def test_samples_that_are_too_small_or_have_no_spread_gain_nothing(pairs) -> None:
    gained, sample = found(pairs, np.random.default_rng(5).normal(size=(300, 2)))
    assert np.isnan(gained.student[sample == 0]).all()
    assert np.isnan(gained.nu[0])
    assert np.isfinite(gained.student[sample == 1]).all()
