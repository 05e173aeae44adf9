import numpy as np
import pytest

from tracknoise.analysis.error_shape import PROBABILITIES, radii, tail_ratios


def test_a_gaussian_has_ratios_of_one_and_quantiles_as_expected() -> None:
    squared = np.random.default_rng(0).chisquare(2, 400_000)
    assert tail_ratios(squared) == pytest.approx((1.0, 1.0), abs=0.2)  # four standard errors of the rarer: 0.2
    probabilities, expected, observed = radii(squared)
    assert tuple(probabilities) == PROBABILITIES
    assert observed == pytest.approx(expected, rel=0.02)


def test_ratios_count_what_is_beyond() -> None:
    squared = np.repeat([1.0, 10.0, 20.0], [1900, 60, 40])
    assert tail_ratios(squared) == pytest.approx((100 / 20, 40 / 2))


def test_tails_that_too_few_errors_can_tell_of_are_left_out() -> None:
    assert np.isnan(tail_ratios(np.ones(99))).tolist() == [True, True]
    assert np.isnan(tail_ratios(np.ones(100))).tolist() == [False, True]
    assert radii(np.ones(100))[0].max() == 0.95
    assert len(radii(np.ones(3))[0]) == 0
