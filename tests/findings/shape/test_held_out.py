import numpy as np
import pytest

from tracknoise.findings.shape.elliptical import terms
from tracknoise.findings.shape.gaussian import fit_gaussian
from tracknoise.findings.shape.held_out import MAX_FITTED, MIN_FITTED, gains
from tracknoise.findings.shape.student import fit_student


def student(rng: np.random.Generator, nu: float, n: int) -> np.ndarray:
    return rng.standard_normal((n, 2)) * np.sqrt(nu / rng.chisquare(nu, n))[:, None]


def found(*samples: np.ndarray):
    sample = np.repeat(np.arange(len(samples)), [len(pairs) for pairs in samples])
    pairs = np.concatenate(samples)
    return gains(pairs, sample, np.arange(len(pairs)) % 2 == 0, len(samples)), sample


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


def test_a_half_is_told_by_what_was_fitted_to_the_other() -> None:
    rng = np.random.default_rng(2)
    one, other = rng.standard_normal((500, 2)), student(rng, 3, 500)
    gained = gains(np.concatenate([one, other]), np.zeros(1000, dtype=np.intp), np.repeat([False, True], 500), 1)
    heavy, normal = fit_student(terms([one])), fit_gaussian(terms([one]))
    expected = heavy.log_density(terms([other])) - normal.log_density(terms([other]))
    assert gained.student[500:] == pytest.approx(expected[0], rel=1e-9)


def test_no_more_than_so_many_are_fitted_and_all_are_told() -> None:
    gained, _ = found(student(np.random.default_rng(3), 5, 5 * MAX_FITTED))
    assert np.isfinite(gained.student).all()


@pytest.mark.parametrize("pairs", [np.ones((200, 2)), np.random.default_rng(4).normal(size=(2 * MIN_FITTED - 1, 2))])
def test_samples_that_are_too_small_or_have_no_spread_gain_nothing(pairs) -> None:
    gained, sample = found(pairs, np.random.default_rng(5).normal(size=(300, 2)))
    assert np.isnan(gained.student[sample == 0]).all()
    assert np.isnan(gained.nu[0])
    assert np.isfinite(gained.student[sample == 1]).all()
