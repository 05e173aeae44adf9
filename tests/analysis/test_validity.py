"""How often verdicts are right in worlds whose truth is known: a small version of benchmarks/validity/dependence.py."""

import numpy as np
import pytest
from scipy import stats

from tracknoise.analysis.paired_tests import Answer, Question, answer
from tracknoise.inference.multiple_tests import rotations
from tracknoise.inference.paired_differences import differences
from tracknoise.inference.units import Resampled, scheme

MARGIN, AGES, RUNS = float(np.log(1.1)), 6, 150


def asked(levels: np.ndarray, seed: int, *, group: np.ndarray | None = None, logarithms: bool = True) -> Answer:
    """The answer about curves (scenes, levels, points)."""
    scenes = len(levels)
    group = np.arange(scenes) if group is None else group
    resampled = scheme(group)
    assert resampled is not None
    n_groups = len(np.unique(group))
    size = {Resampled.scenes: scenes, Resampled.groups: n_groups}.get(resampled, scenes - n_groups + 1)
    question = Question(MARGIN, 0.95, group, resampled, rotations(size, n_draws=199, seed=seed), cancels=not logarithms)
    found = answer(differences(levels, np.ones(levels.shape[:2], dtype=bool), logarithms=logarithms), question)
    assert found is not None
    return found


def drawn(rng: np.random.Generator, effect: object, *, scenes: int, levels: int = 2, own: float = 0.1) -> np.ndarray:
    """Log curves whose scenes differ (log sd 0.7 at all levels); the last level differs by `effect` at each age."""
    shared = 0.7 * rng.standard_normal((scenes, 1, 1))
    level = own * rng.standard_normal((scenes, levels, 1))
    values = shared + level + own * rng.standard_normal((scenes, levels, AGES))
    values[:, -1] += np.asarray(effect)
    return values


@pytest.mark.parametrize("scenes", [8, 28])
@pytest.mark.parametrize("levels", [2, 6])
def test_at_the_margin_yes_and_no_are_rare(scenes: int, levels: int) -> None:
    rng = np.random.default_rng(1)
    found = [asked(drawn(rng, MARGIN, scenes=scenes, levels=levels), seed) for seed in range(RUNS)]
    assert sum(one.p_yes <= 0.05 for one in found) <= stats.binom(RUNS, 0.05).ppf(0.999)
    assert sum(one.p_no <= 0.025 for one in found) <= stats.binom(RUNS, 0.025).ppf(0.999)


@pytest.mark.parametrize(("scenes", "own"), [(8, 0.3), (11, 0.3), (28, 0.7)])
def test_the_power_is_close_to_that_of_the_paired_t_test(scenes: int, own: float) -> None:
    rng = np.random.default_rng(2)
    yes = plain = 0
    for seed in range(RUNS):
        values = drawn(rng, np.log(2), scenes=scenes, own=own)
        yes += asked(values, seed).p_yes <= 0.05
        plain += stats.ttest_1samp((values[:, 0] - values[:, 1]).mean(axis=1), 0.0).pvalue <= 0.05
    assert plain > 0.5 * RUNS
    assert yes >= plain - 0.1 * RUNS


def test_the_interval_holds_the_true_ratio_as_often_as_it_says() -> None:
    rng = np.random.default_rng(3)
    found = [asked(drawn(rng, np.log(2), scenes=8), seed) for seed in range(2 * RUNS)]
    held = sum(one.low <= -np.log(2) <= one.high for one in found)
    low, high = stats.binom(2 * RUNS, 0.95).interval(0.999)
    assert low <= held <= high


def test_curves_that_cross_are_never_the_same_and_are_found() -> None:
    rng = np.random.default_rng(4)
    crossing = np.where(np.arange(AGES) < AGES / 2, np.log(2), -np.log(2))
    found = [asked(drawn(rng, crossing, scenes=11), seed) for seed in range(60)]
    assert all(one.p_no > 0.025 and one.point is not None for one in found)
    assert sum(one.p_yes <= 0.05 for one in found) >= 57


def test_levels_that_agree_are_found_to_be_the_same() -> None:
    rng = np.random.default_rng(5)
    found = [asked(drawn(rng, 0.0, scenes=11, own=0.01), seed) for seed in range(60)]
    assert all(one.p_no <= 0.025 < one.p_yes for one in found)
    assert all(one.most < MARGIN for one in found)


def test_signed_differences_at_the_margin() -> None:
    rng = np.random.default_rng(6)
    found = [asked(drawn(rng, MARGIN, scenes=11), seed, logarithms=False) for seed in range(RUNS)]
    assert sum(one.p_yes <= 0.05 for one in found) <= stats.binom(RUNS, 0.05).ppf(0.999)
    assert all(one.point is not None for one in found)


@pytest.mark.parametrize(("groups", "resampled"), [(8, Resampled.groups), (4, Resampled.within)])
def test_scenes_in_groups_keep_their_level(groups: int, resampled: Resampled) -> None:
    # Scenes of a group share half of their variance. Within groups, the truth is that of these groups.
    rng = np.random.default_rng(7)
    group = np.repeat(np.arange(groups), 4)
    held = 0
    for seed in range(RUNS):
        of_group = 0.2 * rng.standard_normal(groups)[group] * (resampled == Resampled.groups)
        values = drawn(rng, np.log(2) + of_group[:, None], scenes=len(group))
        found = asked(values, seed, group=group)
        held += found.low <= -np.log(2) <= found.high
    assert scheme(group) == resampled
    low, high = stats.binom(RUNS, 0.95).interval(0.999)
    assert low <= held <= high


def test_more_scenes_settle_what_they_are_said_to() -> None:
    rng = np.random.default_rng(8)
    needed = [asked(drawn(rng, np.log(1.6), scenes=8, own=0.5), seed).more_scenes for seed in range(RUNS)]
    typical = 8 + int(np.median([number for number in needed if number is not None]))
    later = [asked(drawn(rng, np.log(1.6), scenes=typical, own=0.5), seed).p_yes <= 0.05 for seed in range(RUNS)]
    assert 0.6 < np.mean(later) < 0.95
