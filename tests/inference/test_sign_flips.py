import numpy as np
import pytest
from scipy import stats

from tracknoise.inference.sign_flips import Chance, family_p, flip_test


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


def named(count: int) -> list[str]:
    return [f"{place:02}" for place in range(count)]


def test_a_family_of_one_is_adjusted_over_its_ages_alone():
    means = walks(np.random.default_rng(0), 9, 5)
    found = flip_test(means)
    assert family_p([found])[0] == pytest.approx(found.adjusted_p)
    assert family_p([found, found])[1] == pytest.approx(found.adjusted_p)  # the same condition twice is one


def test_six_dependent_conditions_are_rejected_no_more_often_than_one():
    rng, runs = np.random.default_rng(1), 300
    alone = family = 0
    for run in range(runs):
        chance = Chance.of(named(8), seed=run)
        common = walks(rng, 8, 4)
        found = [flip_test(common + walks(rng, 8, 4), chance=chance) for _ in range(6)]
        alone += min(test.overall_p for test in found) <= 0.05
        family += min(p.min() for p in family_p(found)) <= 0.05
    assert family <= 0.05 * runs + 3 * np.sqrt(0.05 * runs)
    assert alone > 2 * family


def test_conditions_without_a_test_do_not_count():
    rng = np.random.default_rng(2)
    chance = Chance.of(named(8))
    many = flip_test(walks(rng, 8, 3), chance=chance)
    few = flip_test(walks(rng, 4, 3), chance=chance.some(named(4)))
    first, second = family_p([many, few])
    assert first == pytest.approx(many.adjusted_p)
    assert np.isnan(second).all()


def test_groups_are_flipped_as_a_whole():
    rng = np.random.default_rng(3)
    own = walks(rng, 7, 3)
    group = np.repeat(np.arange(7), 2)
    found = flip_test(own[group], chance=Chance.of(named(14), group))
    expected = flip_test(2 * own)
    assert found.sign_flip_p == pytest.approx(expected.sign_flip_p)
    assert found.hotelling_p == pytest.approx(expected.hotelling_p)
    assert (found.n_scenes == 14).all()


def test_within_few_groups_the_covariance_is_that_within_them():
    rng = np.random.default_rng(4)
    group = np.repeat(np.arange(3), [3, 4, 3])
    offset = 5 * np.array([-1.0, 0.0, 1.0])[group]
    means = rng.normal(size=(10, 2, 2)) + offset[:, None, None]
    found = flip_test(means, chance=Chance.of(named(10), group))
    for age in (0, 1):
        x = means[:, age]
        centred = x - np.stack([x[group == one].mean(axis=0) for one in group])
        covariance, middle = centred.T @ centred / 7, x.mean(axis=0)
        t2 = 10 * middle @ np.linalg.solve(covariance, middle)
        assert found.hotelling_p[age] == pytest.approx(stats.f.sf(t2 * 6 / (2 * 7), 2, 6))
        assert found.sign_flip_p[age] == pytest.approx(found.hotelling_p[age], abs=0.03)


def test_within_groups_a_true_zero_is_kept():
    rng, runs, group = np.random.default_rng(5), 300, np.repeat(np.arange(4), 3)
    fixed = np.array([-3.0, 1.0, 0.0, 2.0])[group, None, None]
    tests = [
        flip_test(fixed + walks(rng, 12, 3), chance=Chance.of(named(12), group, seed=run)).overall_p
        for run in range(runs)
    ]
    assert 0.02 <= np.mean(np.array(tests) <= 0.05) <= 0.09
    assert np.mean(np.array(tests) <= 0.5) == pytest.approx(0.5, abs=0.1)


def test_too_few_scenes_within_groups_allow_no_test():
    means = walks(np.random.default_rng(6), 7, 2)
    found = flip_test(means, chance=Chance.of(named(7), np.array([0, 0, 1, 1, 2, 3, 4])))
    assert np.isnan(found.sign_flip_p).all()
    assert found.strongest is None
