from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from tracknoise.statistics.moments import FOURTH, VARIANCES, JointMoments, measure_moments, pool_moments

SAMPLES = st.lists(
    st.integers(0, 6).flatmap(
        lambda n: hnp.arrays(
            np.float64, (n, 2), elements=st.floats(-1e3, 1e3, allow_nan=False, allow_subnormal=False, width=32)
        )
    ),
    min_size=1,
    max_size=6,
)


def of_one(pairs: np.ndarray) -> JointMoments:
    return measure_moments(pairs, np.zeros(len(pairs), dtype=np.intp), 1)


def of_each(samples: list[np.ndarray]) -> JointMoments:
    group = np.repeat(np.arange(len(samples)), [len(sample) for sample in samples])
    return measure_moments(np.concatenate(samples), group, len(samples))


def scale(pairs: np.ndarray) -> np.ndarray:
    """What each central sum is made of in size: sum of |x - mean|^p |y - mean|^q, plus a little where all is 0."""
    if not len(pairs):
        return np.ones(len(FOURTH))
    size = np.abs(pairs - pairs.mean(axis=0)).max(axis=0) + 1e-3
    return np.array([len(pairs) * size[0] ** p * size[1] ** q for p, q in FOURTH])


def assert_same(found: JointMoments, expected: JointMoments, pairs: np.ndarray, relative: float = 1e-9) -> None:
    np.testing.assert_array_equal(found.n, expected.n)
    spread = np.abs(pairs).max(initial=1.0)
    np.testing.assert_allclose(found.mean, expected.mean, rtol=0, atol=relative * spread)
    assert np.all(np.abs(found.central - expected.central) <= relative * scale(pairs))


def exact(pairs: np.ndarray) -> tuple[list[float], list[float]]:
    """Means and central sums in rational arithmetic: no rounding before the end."""
    columns = [[Fraction(float(value)) for value in column] for column in pairs.T]
    means = [sum(column) / len(column) for column in columns]
    x, y = ([value - mean for value in column] for column, mean in zip(columns, means, strict=True))
    sums = [sum(a**p * b**q for a, b in zip(x, y, strict=True)) for p, q in FOURTH]
    return [float(mean) for mean in means], [float(total) for total in sums]


def test_orders_are_every_joint_order_from_two_to_four() -> None:
    orders = [(2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4)]
    assert list(FOURTH) == orders


@pytest.mark.parametrize("offset", [0.0, 1e3, -1e6])
def test_measured_moments_agree_with_rational_arithmetic(offset: float) -> None:
    pairs = np.random.default_rng(1).normal(scale=(1e-2, 3.0), size=(40, 2)) + offset
    means, sums = exact(pairs)
    found = of_one(pairs)
    np.testing.assert_allclose(found.mean[0], means, rtol=1e-15, atol=1e-17)
    assert np.all(np.abs(found.central[0] - sums) <= 1e-11 * scale(pairs))


@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_pooled_moments_agree_with_rational_arithmetic(offset: float) -> None:
    rng = np.random.default_rng(2)
    samples = [rng.normal(scale=1e-2, size=(n, 2)) + offset for n in (1, 2, 3, 17, 5)]
    means, sums = exact(np.concatenate(samples))
    found = pool_moments(of_each(samples), np.zeros(5, dtype=np.intp), 1)
    np.testing.assert_allclose(found.mean[0], means, rtol=1e-15, atol=1e-17)
    assert np.all(np.abs(found.central[0] - sums) <= 1e-9 * scale(np.concatenate(samples)))


@settings(max_examples=60)
@given(SAMPLES)
def test_pooling_equals_measuring_all_at_once(samples: list[np.ndarray]) -> None:
    together = np.concatenate(samples)
    assert_same(pool_moments(of_each(samples), np.zeros(len(samples), dtype=np.intp), 1), of_one(together), together)


@settings(max_examples=40)
@given(SAMPLES, st.integers(0, 5), st.randoms(use_true_random=False))
def test_order_and_grouping_of_pooling_do_not_matter(samples: list[np.ndarray], cut: int, random) -> None:
    parts, count = of_each(samples), len(samples)
    at_once = pool_moments(parts, np.zeros(count, dtype=np.intp), 1)
    halves = (np.arange(count) >= cut).astype(np.intp)
    in_two_steps = pool_moments(pool_moments(parts, halves, 2), np.zeros(2, dtype=np.intp), 1)
    shuffled = random.sample(samples, count)
    reordered = pool_moments(of_each(shuffled), np.zeros(count, dtype=np.intp), 1)
    together = np.concatenate(samples)
    assert_same(in_two_steps, at_once, together)
    assert_same(reordered, at_once, together)


def test_a_sample_far_from_the_others_keeps_a_small_spread_measurable() -> None:
    rng = np.random.default_rng(3)
    samples = [rng.normal(scale=1e-2, size=(1000, 2)) + offset for offset in (1e3, 1e3 + 1e-2)]
    found = pool_moments(of_each(samples), np.zeros(2, dtype=np.intp), 1)
    variance = np.concatenate(samples).var(axis=0)
    np.testing.assert_allclose(found.central[0, [0, 2]] / 2000, variance, rtol=1e-9)


def test_empty_groups_have_zero_moments_and_change_nothing() -> None:
    pairs = np.array([[1.0, 2.0], [3.0, 5.0]])
    parts = measure_moments(pairs, np.array([1, 1]), 3)
    assert parts.n.tolist() == [0, 2, 0]
    assert not parts.central[[0, 2]].any()
    pooled = pool_moments(parts, np.zeros(3, dtype=np.intp), 1)
    np.testing.assert_array_equal(pooled.central, parts.central[[1]])
    np.testing.assert_array_equal(pooled.mean, [[2.0, 3.5]])


def test_no_rows_and_no_groups() -> None:
    parts = measure_moments(np.zeros((0, 2)), np.zeros(0, dtype=np.intp), 0)
    assert parts.central.shape == (0, 12)
    assert pool_moments(parts, np.zeros(0, dtype=np.intp), 0).mean.shape == (0, 2)


def test_variances_alone_are_the_same_numbers() -> None:
    pairs = np.random.default_rng(4).normal(size=(50, 2))
    group = np.arange(50) % 3
    few = measure_moments(pairs, group, 3, orders=VARIANCES)
    np.testing.assert_array_equal(few.central, measure_moments(pairs, group, 3).central[:, [0, 2]])
    pooled = pool_moments(few, np.zeros(3, dtype=np.intp), 1)
    np.testing.assert_allclose(pooled.central[0], 50 * pairs.var(axis=0), rtol=1e-13)


def test_inputs_stay_as_they_were() -> None:
    pairs = np.array([[1.0, 2.0], [3.0, 5.0]])
    before = pairs.copy()
    parts = of_one(pairs)
    central = parts.central.copy()
    pool_moments(parts, np.zeros(1, dtype=np.intp), 1)
    np.testing.assert_array_equal(pairs, before)
    np.testing.assert_array_equal(parts.central, central)
