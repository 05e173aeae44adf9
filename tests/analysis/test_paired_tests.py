"""Changes of made-up scenes: the tests of both directions, and what is reported."""

import numpy as np
import pytest

from tracknoise.analysis.paired_tests import FALLS, GROWS, ask, bias_change, change_of
from tracknoise.inference.units import Resampled
from tracknoise.tables.enumerations import ComparedAges

EVERY, MEAN = ComparedAges.every, ComparedAges.mean
MARGIN = float(np.log(1.1))
SCENES, POINTS = 10, 12


def question(scenes=SCENES, *, margin=MARGIN, group=None):
    groups = np.arange(scenes) if group is None else group
    asked = ask(np.ones((scenes, 1), bool), groups, margin=margin, level=0.95)
    assert asked is not None
    return asked


def noise(seed, scale=0.02, points=POINTS):
    return scale * np.random.default_rng(seed).standard_normal((SCENES, points))


def test_a_clear_growth_grows_and_does_not_fall():
    found = change_of(noise(0) + 0.3, question(), EVERY)
    assert found.sides[GROWS].p_beyond < 1e-4
    assert found.sides[FALLS].p_beyond == pytest.approx(1.0)
    assert found.sides[FALLS].p_within < 1e-4 < found.sides[GROWS].p_within
    assert found.low < 0.3 < found.high
    assert found.point is None


def test_a_fall_is_the_growth_of_the_negative_change():
    up, down = (change_of(sign * (noise(1) + 0.3), question(), EVERY) for sign in (1, -1))
    assert down.sides[FALLS].p_beyond == pytest.approx(up.sides[GROWS].p_beyond)
    assert down.effect == pytest.approx(-up.effect)


def test_a_large_improvement_is_shown_not_to_be_worse():
    found = change_of(noise(2, scale=0.3) - 1.5, question(), EVERY)
    assert found.sides[GROWS].p_within < 0.025


def test_a_change_of_nothing_stays_within_the_margin():
    found = change_of(noise(3, scale=0.005), question(), EVERY)
    assert found.p_none < 1e-4
    assert found.p_change == pytest.approx(1.0)


def test_a_single_age_decides_where_the_mean_does_not():
    values = noise(4)
    values[:, 7] += 0.6
    found = change_of(values, question(), EVERY)
    assert (found.point, found.direction) == (7, GROWS)
    assert found.low < 0.6 < found.high
    of_mean = change_of(values, question(), MEAN)
    assert of_mean.point is None
    assert of_mean.p_change > 0.05
    assert found.p_none > 0.5 > of_mean.p_none


def test_points_that_too_few_scenes_have_are_left_out():
    values = noise(5)
    values[4:, 3] = np.nan
    found = change_of(values, question(), EVERY)
    assert not found.compared[3]
    assert found.compared.sum() == POINTS - 1
    assert change_of(np.full_like(values, np.nan), question(), EVERY) is None


def test_groups_of_scenes_count_once():
    group = np.repeat(np.arange(4), 2)
    values = np.repeat(np.array([0.5, -0.4, 0.6, -0.5]), 2)[:, None] + 0.001 * np.arange(8)[:, None]
    asked = question(8, group=group)
    assert asked.resampled == Resampled.within
    assert ask(np.ones((2, 1), bool), np.arange(2), margin=MARGIN, level=0.95) is None
    found = change_of(values, asked, EVERY)
    assert found.high - found.low < 0.1


@pytest.mark.parametrize(("before", "after", "direction"), [(0.1, 0.5, GROWS), (-0.5, 0.1, FALLS), (0.1, -0.5, GROWS)])
def test_the_size_of_a_bias_grows_or_falls_whatever_its_sign(before, after, direction):
    first, second = before + noise(6), after + noise(7)
    found = bias_change(second - first, second + first, question(margin=0.05), EVERY)
    assert found.sides[direction].p_beyond < 1e-4
    assert found.sides[-direction].p_beyond > 0.5
    assert found.low < abs(after) - abs(before) < found.high
    assert found.sides[-direction].p_within < 1e-4


def test_a_bias_that_changes_its_sign_alone_is_not_worse():
    first, second = 0.5 + noise(8), -0.5 + noise(9)
    found = bias_change(second - first, second + first, question(margin=0.1), EVERY)
    assert found.p_change > 0.5
    assert found.p_none < 1e-3
    assert found.low < 0 < found.high


def test_the_mean_over_ages_of_a_bias_is_taken_for_each_coordinate():
    first, second = noise(10), noise(11)
    second[:, ::2] += 0.5
    found = bias_change(second - first, second + first, question(margin=0.05), MEAN)
    assert found.point is None
    assert found.effect == pytest.approx(0.5, abs=0.05)
    assert found.sides[GROWS].p_beyond < 1e-4


def test_claims_without_a_change_are_rare():
    rng = np.random.default_rng(12)
    asked = question(margin=1e-6)
    wrong = [0, 0]
    for _ in range(150):
        wrong[0] += change_of(rng.standard_normal((SCENES, 6)), asked, EVERY).p_change <= 0.05
        first, second = rng.standard_normal((2, SCENES, 6))
        wrong[1] += bias_change(second - first, second + first, asked, EVERY).p_change <= 0.05
    assert wrong[0] <= 16
    assert wrong[1] <= 8
