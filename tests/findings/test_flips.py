import numpy as np
import pytest
from scipy import stats

from tracknoise.findings.flips import flip_test


def walks(rng: np.random.Generator, n_scenes: int, n_ages: int) -> np.ndarray:
    """Scene means (scenes, ages, 2) that walk from age to age."""
    return rng.normal(size=(n_scenes, n_ages, 2)).cumsum(axis=1)


@pytest.mark.parametrize("n_scenes", [6, 9, 30])
def test_hotelling_is_that_of_a_textbook(n_scenes):
    means = np.random.default_rng(n_scenes).normal(0.2, 1.0, size=(n_scenes, 3, 2))
    for age, found in enumerate(flip_test(means).hotelling_p):
        middle, covariance = means[:, age].mean(axis=0), np.cov(means[:, age].T)
        t2 = n_scenes * middle @ np.linalg.solve(covariance, middle)
        book = stats.f.sf(t2 * (n_scenes - 2) / (2 * (n_scenes - 1)), 2, n_scenes - 2)
        assert found == pytest.approx(book)


def test_all_flips_of_six_scenes_by_hand():
    means = np.array([1.0, 2, 3, 4, 5, -0.5])[:, None, None] * np.array([1.0, 0.0]) + np.array([0.0, 1e-3])
    means[::2, :, 1] *= -1
    signs = 1 - 2 * (np.arange(64)[:, None] >> np.arange(6) & 1)
    centre = np.linalg.inv(np.einsum("sai,saj->ij", means, means))
    sums = np.einsum("fs,sai->fi", signs, means)
    q = np.einsum("fi,ij,fj->f", sums, centre, sums)
    expected = (q >= q[0] - 1e-9).mean()
    found = flip_test(means)
    assert found.sign_flip_p[0] == pytest.approx(expected)
    assert found.overall_p == pytest.approx(expected)


def test_six_scenes_that_agree_are_just_enough():
    means = np.random.default_rng(1).normal(10.0, 1.0, size=(6, 2, 2))
    assert flip_test(means).overall_p == pytest.approx(2 / 64)


def test_a_true_zero_is_rejected_as_often_as_stated_however_ages_depend_on_each_other():
    rng = np.random.default_rng(3)
    found = [flip_test(walks(rng, 8, 10)) for _ in range(800)]
    overall = np.mean([test.overall_p <= 0.05 for test in found])
    single = np.mean([test.sign_flip_p[4] <= 0.05 for test in found])
    assert 0.028 < overall < 0.07  # 0.047 is what eight scenes allow; +- 3 standard errors
    assert 0.028 < single < 0.07


def test_ages_without_a_bias_are_rarely_said_to_have_one_beside_ages_that_have():
    rng, runs = np.random.default_rng(5), 600
    bias = np.repeat([0.0, 2.0], 5)[:, None]
    found = [flip_test(rng.normal(size=(9, 10, 2)) + bias).adjusted_p for _ in range(runs)]
    assert np.mean([p[:5].min() <= 0.05 for p in found]) < 0.05 + 3 * np.sqrt(0.05 * 0.95 / runs)
    assert np.mean([p[5:].min() <= 0.05 for p in found]) > 0.95


def test_power_is_that_of_theory():
    rng, n_scenes, runs = np.random.default_rng(4), 28, 1500  # as many ages that do not depend on each other
    means = rng.normal(size=(n_scenes, runs, 2)) + 0.3 * np.array([0.6, 0.8])
    found = [flip_test(part) for part in np.split(means, 5, axis=1)]
    theory = stats.ncf.sf(stats.f.ppf(0.95, 2, n_scenes - 2), 2, n_scenes - 2, n_scenes * 0.09)
    error = np.sqrt(theory * (1 - theory) / runs)
    for name in ("hotelling_p", "sign_flip_p"):
        power = np.mean([getattr(test, name) <= 0.05 for test in found])
        assert abs(power - theory) < 3 * error
