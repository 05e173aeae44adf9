"""Bounds of the mean error agree with the test at their age, and hold the true mean as often as they say."""

import numpy as np
import pytest
from scipy import stats

from tracknoise.analysis.zero_mean import BOUNDS, mean_bounds
from tracknoise.inference.sign_flips import Chance, flip_test

FOUR_GROUPS = np.repeat(np.arange(4), 2)
UNEQUAL = np.repeat(np.arange(7), [1, 2, 3, 1, 2, 3, 2])


def chance_of(n: int, group: np.ndarray | None = None) -> Chance:
    return Chance.of([f"s{place:02}" for place in range(n)], group)


def bounds_of(means: np.ndarray, chance: Chance) -> dict[str, float]:
    """Of scene means (scenes, 2) at one age."""
    found = mean_bounds(means[:, None], chance)
    return {name: float(found[name][0]) for name in BOUNDS}


@pytest.mark.parametrize("group", [None, FOUR_GROUPS, UNEQUAL], ids=["scenes", "within groups", "groups"])
@pytest.mark.parametrize("bias", [0.0, 0.6])
def test_zero_lies_outside_exactly_where_the_test_rejects_it(group: np.ndarray | None, bias: float) -> None:
    n = 8 if group is None else len(group)
    chance, rng = chance_of(n, group), np.random.default_rng(3)
    rejected = 0
    for _ in range(40):
        means = rng.normal([bias, 0.0], size=(n, 2))
        found, p = bounds_of(means, chance), flip_test(means[:, None], chance=chance).sign_flip_p[0]
        assert (found["effect_low_px"] > 0) == (p <= 0.05)
        if p > 0.05:
            assert found["mean_u_low_px"] < 0 < found["mean_u_high_px"]
            assert found["mean_v_low_px"] < 0 < found["mean_v_high_px"]
        rejected += p <= 0.05
    assert rejected < 10 if bias == 0.0 else rejected > 3


def test_with_many_scenes_it_is_the_ellipse_of_hotelling() -> None:
    means = np.random.default_rng(4).normal([4.0, 0.0], [1.0, 3.0], size=(60, 2))
    found = bounds_of(means, chance_of(60))
    limit = 2 * 59 / 58 * stats.f.ppf(0.95, 2, 58)
    half = np.sqrt(limit * np.diag(np.cov(means.T)) / 60)
    centre = means.mean(axis=0)
    for place, name in enumerate(("mean_u", "mean_v")):
        assert found[f"{name}_low_px"] == pytest.approx(centre[place] - half[place], abs=0.15 * half[place])
        assert found[f"{name}_high_px"] == pytest.approx(centre[place] + half[place], abs=0.15 * half[place])
    assert found["effect_low_px"] < np.hypot(*centre) < found["effect_high_px"]


@pytest.mark.parametrize("bias", [0.0, 3.0])
def test_bounds_hold_the_true_mean_in_both_coordinates_at_once(bias: float) -> None:
    chance, rng, held = chance_of(8), np.random.default_rng(5), 0
    for _ in range(200):
        found = bounds_of(rng.normal([bias, 0.0], size=(8, 2)), chance)
        in_u = found["mean_u_low_px"] <= bias <= found["mean_u_high_px"]
        held += in_u and found["mean_v_low_px"] <= 0.0 <= found["mean_v_high_px"]
    assert held >= stats.binom.ppf(1e-4, 200, 0.95)


def test_without_a_test_there_are_no_bounds() -> None:
    assert np.isnan(list(bounds_of(np.ones((5, 2)), chance_of(5)).values())).all()
    means = np.random.default_rng(6).normal(size=(8, 2))
    means[:4] = np.nan
    assert np.isnan(list(bounds_of(means, chance_of(8)).values())).all()


def test_a_coordinate_without_errors_has_bounds_of_zero() -> None:
    """As of a stereo tracker, whose errors across the epipolar line are 0."""
    means = np.stack([np.random.default_rng(7).normal(size=9) + 5.0, np.zeros(9)], axis=1)
    found = bounds_of(means, chance_of(9))
    assert found["mean_v_low_px"] == pytest.approx(0.0)
    assert found["mean_v_high_px"] == pytest.approx(0.0)
    assert 0 < found["effect_low_px"] < means.mean(axis=0)[0] < found["effect_high_px"]
    assert found["effect_low_px"] == pytest.approx(found["mean_u_low_px"], rel=1e-3)
