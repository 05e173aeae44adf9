import numpy as np
import pytest

from tracknoise.statistics.histograms import LOG_HISTOGRAM_BINS, bin_of, quantile, share_below


def counted(values):
    return np.bincount(bin_of(values), minlength=LOG_HISTOGRAM_BINS).astype(np.float64)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.95, 0.99])
def test_quantiles_and_shares_are_those_of_the_numbers(share):
    values = np.abs(np.random.default_rng(0).standard_normal(200_000)) * 0.37
    found = quantile(counted(values), share)
    assert found == pytest.approx(np.quantile(values, share), rel=0.01)
    assert share_below(counted(values), np.array(np.quantile(values, share))) == pytest.approx(share, abs=0.005)


def test_numbers_beyond_the_bins_are_in_the_outermost_and_nothing_is_counted_of_none():
    assert bin_of(np.array([0.0, 1e-9, 1e9])).tolist() == [0, 0, LOG_HISTOGRAM_BINS - 1]
    empty = np.zeros((LOG_HISTOGRAM_BINS, 2))
    assert np.isnan(quantile(empty, 0.5)).all()
    assert np.isnan(share_below(empty, np.ones(2))).all()


def test_numbers_that_are_too_small_to_tell_apart_have_no_quantiles():
    exact, mixed = np.full(100, 1e-15), np.concatenate([np.zeros(40), np.full(60, 0.5)])
    assert np.isnan(quantile(counted(exact), 0.5))
    assert np.isnan(share_below(counted(exact), np.array(2e-15)))
    assert np.isnan(quantile(counted(mixed), 0.3))
    assert quantile(counted(mixed), 0.7) == pytest.approx(0.5, rel=0.1)
    assert share_below(counted(mixed), np.array(0.1)) == pytest.approx(0.4)
    assert share_below(counted(np.full(100, 0.5)), np.array(1e-9)) == 0.0
