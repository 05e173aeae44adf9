"""Intervals of the largest ratio: by hand where there is one, and how often they are right where there are many."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from tracknoise.findings.factors.largest import Largest, largest
from tracknoise.findings.factors.ratios import Ratios

from tracknoise.findings.factors.rotation import rotations

MARGIN, LEVEL = 0.1, 0.95
SCENES = 10
DIRECTIONS = rotations(SCENES, n_draws=399, seed=0)


def centred(values: np.ndarray) -> np.ndarray:
    """What scenes add to the error of their mean."""
    return (values - values.mean(axis=0)) / np.sqrt(len(values) * (len(values) - 1))


def measured(differences: np.ndarray, commons: np.ndarray) -> Ratios:
    """Ratios of means over scenes, (scenes, points), whose common is not the range of a curve."""
    points = differences.shape[1]
    return Ratios(
        difference=differences.mean(axis=0),
        common=commons.mean(axis=0),
        difference_parts=centred(differences),
        common_parts=centred(commons),
        degrees=np.full(points, len(differences) - 1.0),
        curve=np.zeros(points, dtype=np.intp),
        curve_parts=np.zeros((len(differences), 1, 0)),
    )


def found(differences: np.ndarray, commons: np.ndarray) -> Largest:
    return largest(measured(differences, commons), DIRECTIONS, margin=MARGIN, level=LEVEL)


def test_a_single_difference_over_what_is_exactly_known_has_students_interval() -> None:
    values = np.random.default_rng(0).normal(0.5, 0.2, (SCENES, 1))
    directions = rotations(SCENES, n_draws=9999, seed=0)
    ratios = measured(values, np.full((SCENES, 1), 2.0))
    row = largest(ratios, directions, margin=MARGIN, level=LEVEL)
    half = stats.t.ppf(0.975, SCENES - 1) * stats.sem(values[:, 0])
    assert row.effect == pytest.approx(values.mean() / 2)
    assert row.high == pytest.approx((values.mean() + half) / 2)
    assert row.low == pytest.approx((values.mean() - half) / 2, rel=0.02)
    assert row.p_no == pytest.approx(stats.ttest_1samp(values[:, 0], 2 * MARGIN, alternative="less").pvalue)


def test_the_sign_of_a_difference_does_not_matter() -> None:
    rng = np.random.default_rng(1)
    differences, commons = rng.normal(0.3, 0.1, (SCENES, 4)), rng.normal(1.0, 0.1, (SCENES, 4))
    flipped = differences * np.array([1, -1, 1, -1])
    assert found(differences, commons) == found(flipped, commons)


def test_a_scale_that_scenes_share_does_not_blur_the_ratio() -> None:
    scale = np.random.default_rng(2).uniform(0.5, 1.5, (SCENES, 1))
    row = found(0.3 * scale, scale)
    assert (row.low, row.high) == (pytest.approx(0.3), pytest.approx(0.3))
    assert row.p_yes < 1 / 400


def test_without_anything_in_common_there_is_no_upper_bound() -> None:
    rng = np.random.default_rng(3)
    noise = rng.normal(0, 1, (SCENES, 1))
    row = found(rng.normal(0, 1, (SCENES, 1)), noise * np.sign(noise.mean()))
    assert (row.low, row.high) == (0.0, np.inf)
    assert found(rng.normal(5, 1, (SCENES, 1)), np.zeros((SCENES, 1))).low == np.inf


def test_certainty() -> None:
    ones = np.ones((SCENES, 1))
    assert found(0.3 * ones, ones).low == found(0.3 * ones, ones).high == pytest.approx(0.3)
    assert found(0 * ones, ones) == Largest(0.0, 0.0, 0.0, 1.0, 0.0)
    assert found(0 * ones, 0 * ones) == Largest(0.0, 0.0, np.inf, 1.0, 0.5)


@pytest.mark.parametrize("points", [1, 30])
@pytest.mark.parametrize("true", [0.0, MARGIN, 0.4])
def test_intervals_hold_the_truth_and_agree_with_the_p_values(points: int, true: float) -> None:
    rng = np.random.default_rng([points, round(true * 100)])
    rows = []
    for _ in range(300):
        commons = rng.normal(1.0, 0.3, (SCENES, 1)) + rng.normal(0, 0.05, (SCENES, points))
        rows.append(found(true * commons + rng.normal(0, 0.1, (SCENES, points)), commons))
    for row in rows:
        assert 0 <= row.low <= row.effect <= row.high
        assert (row.low > MARGIN) == (row.p_yes <= 1 - LEVEL)
        assert (row.high < MARGIN) == (row.p_no < (1 - LEVEL) / 2)
    missed = sum(not row.low <= true <= row.high for row in rows)
    assert stats.binomtest(missed, len(rows), 1 - LEVEL, alternative="greater").pvalue > 0.01


def test_the_largest_of_many_is_not_taken_for_an_effect() -> None:
    rng = np.random.default_rng(4)
    ones = np.ones((SCENES, 200))
    rows = [found(rng.normal(0, 0.2, (SCENES, 200)), ones) for _ in range(100)]
    assert all(row.effect > MARGIN for row in rows)
    assert sum(row.low > MARGIN for row in rows) <= 5


def test_a_range_that_is_only_noise_does_not_make_a_difference_small() -> None:
    # the levels differ by little, and nothing is common to them but noise, whose range is taken for common
    rng = np.random.default_rng(5)
    wrong = {True: 0, False: 0}
    for _ in range(200):
        middle = np.concatenate([rng.normal(0, 1, (SCENES, 20)), np.zeros((SCENES, 1))], axis=1)
        top, bottom = middle.mean(axis=0).argmax(), middle.mean(axis=0).argmin()
        apart = np.full((SCENES, 1), 0.01) + rng.normal(0, 0.003, (SCENES, 1))
        ratios = measured(apart, middle[:, [top]] - middle[:, [bottom]])
        chosen = replace(ratios, curve_parts=centred(middle)[:, None])
        for known, each in ((True, chosen), (False, ratios)):
            wrong[known] += largest(each, DIRECTIONS, margin=MARGIN, level=LEVEL).high < MARGIN
    assert wrong[True] <= 0.05 * 200 < wrong[False]


def test_a_clear_effect_stays_clear_among_many_questions() -> None:
    # Of 400 draws none tells a p-value below 1/400; a true effect among sixty questions needs less than 0.05 / 60.
    differences = np.random.default_rng(6).normal(1.0, 0.05, (SCENES, 8))
    assert found(differences, np.ones_like(differences)).p_yes < 0.05 / 60
