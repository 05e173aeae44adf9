"""Pairs of levels from sums by scene, and how often their largest effect is judged rightly."""

import numpy as np
import pytest
from scipy import stats
from tracknoise.findings.factors.largest import Largest, largest
from tracknoise.findings.factors.paired import Levels, pair_curves, pair_numbers

from tracknoise.findings.factors.rotation import rotations

MARGIN, LEVEL = 0.1, 0.95


def curves_of(values: np.ndarray, n: np.ndarray | None = None) -> Levels:
    """Scenes whose every sum is that of one value (scenes, levels, places) times its count."""
    count = np.full(values.shape, 50.0) if n is None else n
    sums = np.repeat((values * count)[..., None], 6, axis=-1)
    return Levels(count, sums, np.ones(values.shape[:2], dtype=np.bool_))


def numbers_of(values: np.ndarray, n: np.ndarray | None = None) -> Levels:
    count = np.full(values.shape, 50.0) if n is None else n
    return Levels(count[..., None], (values * count)[..., None, None], np.ones(values.shape, dtype=np.bool_))


def scenes_of(*, effect: float, scenes: int, levels: int, rng: np.random.Generator) -> Levels:
    """Scenes that differ in size and in number of features, and have something of their own at each level and age.

    What they have at ages next to each other is much the same. The last level is above the first by the effect.
    """
    wander = np.cumsum(rng.standard_normal((scenes, levels, 8)), axis=2) / np.sqrt(8)
    factor = np.ones(levels)
    factor[0], factor[-1] = 1 - effect / 2, 1 + effect / 2
    values = rng.uniform(0.7, 1.3, (scenes, 1, 1)) * (factor[:, None] + 0.04 * wander) * np.sqrt(np.arange(1, 9))
    n = np.broadcast_to(rng.integers(100, 200, (scenes, 1, 1)), values.shape).astype(np.float64)
    return curves_of(values, n)


def judged(levels: Levels, statistic: int, seed: int) -> Largest:
    ratios = pair_curves(levels).ratios[statistic]
    directions = rotations(len(levels.n), n_draws=199, seed=seed)
    return largest(ratios, directions, margin=MARGIN, level=LEVEL)


def test_two_curves_by_hand() -> None:
    # apart by 1 and 3; the middle goes from 0 through 1.5 to 3.5
    values = np.broadcast_to([[1.0, 2.0], [2.0, 5.0]], (6, 2, 2))
    paired = pair_curves(curves_of(values))
    absolute = paired.ratios[1]
    assert absolute.difference == pytest.approx([-1, -1, -3, -3])  # u and v at each place
    assert absolute.common == pytest.approx([3.5] * 4)
    assert not absolute.difference_parts.any()
    assert not absolute.common_parts.any()
    assert (paired.n_pairs, paired.n_scenes, paired.places.tolist()) == (1, 6, [True, True])


def test_what_scenes_add_is_the_error_of_a_mean() -> None:
    values = np.random.default_rng(0).normal(3.0, 1.0, (9, 2, 1))
    (first, *_) = pair_curves(curves_of(values)).ratios
    apart = values[:, 0, 0] - values[:, 1, 0]
    assert np.square(first.difference_parts).sum(axis=0) == pytest.approx([stats.sem(apart) ** 2] * 2)
    assert np.square(first.common_parts).sum(axis=0) == pytest.approx([stats.sem(values.mean(axis=1)[:, 0]) ** 2] * 2)
    assert first.degrees == pytest.approx([8, 8])


def test_scenes_that_weigh_unequally_leave_fewer_degrees_of_freedom() -> None:
    values = np.random.default_rng(0).normal(3.0, 1.0, (9, 2, 1))
    n = np.where(np.arange(9) == 0, 500.0, 50.0)[:, None, None] * np.ones((1, 2, 1))
    w = n[:, 0, 0] / n[:, 0, 0].sum()
    centring = np.eye(9) - w
    form = centring.T @ np.diag(w**2 / (1 - 2 * w + (w**2).sum())) @ centring
    expected = np.trace(form) ** 2 / np.trace(form @ form)
    assert pair_curves(curves_of(values, n)).ratios[0].degrees == pytest.approx([expected] * 2)
    assert 1 < expected < 4


def test_a_scene_measured_at_one_level_only_is_left_out_of_its_pairs() -> None:
    values = np.random.default_rng(0).normal(3.0, 1.0, (8, 3, 2))
    levels = curves_of(values)
    levels.measured[7, 2] = False
    levels.n[7, 2] = levels.sums[7, 2] = 0.0
    paired = pair_curves(levels)
    mean = paired.ratios[0]
    assert (paired.n_scenes, paired.n_pairs) == (7, 3)
    assert mean.difference[0] == pytest.approx((values[:, 0] - values[:, 1]).mean(axis=0)[0])
    assert mean.difference[4] == pytest.approx((values[:7, 0] - values[:7, 2]).mean(axis=0)[0])
    assert not mean.difference_parts[7, 4:].any()


def test_pairs_of_different_lengths_stand_together() -> None:
    values = np.random.default_rng(0).normal(3.0, 1.0, (8, 3, 4))
    levels = curves_of(values)
    levels.n[:, 2, 1:] = levels.sums[:, 2, 1:] = 0.0
    paired = pair_curves(levels)
    assert [len(each.difference) for each in paired.ratios] == [2 * (4 + 1 + 1)] * 4
    assert np.bincount(paired.ratios[0].curve).tolist() == [4, 4, 1, 1, 1, 1]
    assert paired.ratios[0].curve_parts.shape == (8, 6, 5)


def test_numbers_are_relative_to_the_mean_of_all_levels() -> None:
    values = np.broadcast_to([1.0, 2.0, 6.0], (7, 3))
    (ratios,) = pair_numbers(numbers_of(values)).ratios
    assert ratios.difference == pytest.approx([-1, -5, -4])
    assert ratios.common == pytest.approx([3, 3, 3])
    assert ratios.curve_parts.size == 0


def test_too_few_scenes_compare_nothing() -> None:
    values = np.random.default_rng(0).normal(3.0, 1.0, (5, 2, 3))
    for paired in (pair_curves(curves_of(values)), pair_numbers(numbers_of(values[..., 0]))):
        assert (paired.ratios, paired.n_pairs, paired.n_scenes) == ([], 0, 5)
        assert not paired.places.any()


@pytest.mark.parametrize(("scenes", "levels"), [(6, 2), (12, 2), (12, 4)])
def test_no_effect_is_not_said_to_matter_nor_one_at_the_margin_either_way(scenes: int, levels: int) -> None:
    runs = 120
    rng = np.random.default_rng([scenes, levels])
    for effect in (0.0, MARGIN):
        rows = [
            judged(scenes_of(effect=effect, scenes=scenes, levels=levels, rng=rng), 1, seed) for seed in range(runs)
        ]
        yes = sum(row.low > MARGIN for row in rows)
        no = sum(row.high < MARGIN for row in rows)
        assert stats.binomtest(yes, runs, 0.05, alternative="greater").pvalue > 0.01
        if effect:
            assert stats.binomtest(no, runs, 0.05, alternative="greater").pvalue > 0.01
        missed = sum(not row.low <= effect <= row.high for row in rows)
        assert stats.binomtest(missed, runs, 0.05, alternative="greater").pvalue > 0.01


def test_a_large_effect_is_found_and_never_denied() -> None:
    rng = np.random.default_rng(1)
    rows = [judged(scenes_of(effect=0.5, scenes=12, levels=3, rng=rng), 1, seed) for seed in range(60)]
    assert not any(row.high < MARGIN for row in rows)
    assert sum(row.low > MARGIN for row in rows) >= 54


def test_no_effect_is_recognised_as_none_with_scenes_enough() -> None:
    rng = np.random.default_rng(2)
    rows = [judged(scenes_of(effect=0.0, scenes=30, levels=2, rng=rng), 1, seed) for seed in range(60)]
    assert sum(row.high < MARGIN for row in rows) >= 54
