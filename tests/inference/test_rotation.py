import numpy as np
import pytest
from scipy import stats

from tracknoise.inference.multiple_tests import best_by_chance, least_share, rotations, students, within

DIRECTIONS = rotations(8, n_draws=3999, seed=0)


def test_directions_have_length_one_and_come_from_the_seed() -> None:
    assert np.linalg.norm(DIRECTIONS, axis=1) == pytest.approx(1.0)
    assert np.array_equal(rotations(8, n_draws=3999, seed=0), DIRECTIONS)
    assert not np.array_equal(rotations(8, n_draws=3999, seed=1), DIRECTIONS)


def test_directions_among_fewer_scenes() -> None:
    some = within(DIRECTIONS, np.arange(8) < 3)
    assert some.shape == (3999, 3)
    assert np.linalg.norm(some, axis=1) == pytest.approx(1.0)
    assert within(DIRECTIONS, np.ones(8, dtype=np.bool_)) is DIRECTIONS


def test_the_p_value_of_a_single_test_is_uniform() -> None:
    parts = np.random.default_rng(1).standard_normal((8, 1))
    assert stats.kstest(best_by_chance(parts, DIRECTIONS), "uniform").pvalue > 0.01


def test_tests_that_say_the_same_count_as_one() -> None:
    parts = np.random.default_rng(1).standard_normal((8, 1)) * np.array([1.0, -2.0, 7.0])
    assert best_by_chance(parts, DIRECTIONS) == pytest.approx(best_by_chance(parts[:, :1], DIRECTIONS))


def test_many_tests_are_between_one_and_bonferroni() -> None:
    parts = np.random.default_rng(1).standard_normal((8, 12))
    alone = least_share(best_by_chance(parts, DIRECTIONS), 0.05)
    assert 0.05 / 12 < alone < 0.05 / 4


def test_more_tests_than_are_turned_at_a_time() -> None:
    parts = np.random.default_rng(1).standard_normal((8, 9000))
    apart = [best_by_chance(columns, DIRECTIONS[:99]) for columns in np.array_split(parts, 7, axis=1)]
    assert best_by_chance(parts, DIRECTIONS[:99])[0] == min(each[0] for each in apart)


def test_a_test_without_error_does_not_count() -> None:
    parts = np.random.default_rng(1).standard_normal((8, 2)) * [1.0, 0.0]
    assert np.array_equal(best_by_chance(parts, DIRECTIONS), best_by_chance(parts[:, :1], DIRECTIONS))
    assert best_by_chance(np.zeros((8, 1)), DIRECTIONS).tolist() == [1.0] * 3999


def test_students_are_students_and_have_signs() -> None:
    parts = np.random.default_rng(1).standard_normal((8, 2)) * [1.0, 0.0]
    found = students(parts, DIRECTIONS)
    assert stats.kstest(found[:, 0], stats.t(7).cdf).pvalue > 0.01
    assert np.all(found[:, 1] == 0)
    smallest = np.sort(2 * stats.t(7).sf(np.abs(found[:, 0])))
    assert smallest == pytest.approx(best_by_chance(parts, DIRECTIONS))


def test_shares_by_hand() -> None:
    by_chance = np.arange(1, 20) / 20
    assert least_share(by_chance, 0.1) == pytest.approx(0.1)
    assert least_share(by_chance[:5], 0.1) == 0.0
