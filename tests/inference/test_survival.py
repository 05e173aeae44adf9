"""The Kaplan-Meier estimate, against numbers computed by hand and against that of SciPy."""

import numpy as np
import polars as pl
import pytest
from scipy.stats import CensoredData, ecdf

from tracknoise.analysis.lifetime_intervals import cumulative_incidence, survival
from tracknoise.estimators.fit import lengths_of_tracks
from tracknoise.inference.survival import kaplan_meier, restricted_mean


def test_tracks_alive_in_the_last_frame_are_not_at_risk_there():
    # 50 end at 3, 50 are alive at 3 in the last frame, 100 live on: 50 of 150 end, 100 of 150 are left.
    # At 9, 40 of the 100 end and 60 are alive: 40 of 40 that were looked for again.
    found = kaplan_meier([50, 40], [50, 60])
    np.testing.assert_array_equal(found.at_risk, [150, 40])
    np.testing.assert_allclose(found.beyond, [2 / 3, 0], rtol=1e-15)


def test_ends_that_are_no_events_are_at_risk_once_more():
    # at 2, 8 were looked for once more: 2 events, 3 other ends, 3 live on; at 5, 3: 1 event, 2 other ends
    found = kaplan_meier([5, 3], [2, 0], n_events=[2, 1])
    np.testing.assert_array_equal(found.at_risk, [8, 3])
    np.testing.assert_allclose(found.beyond, [6 / 8, 6 / 8 * 2 / 3], rtol=1e-15)


def test_the_curve_stays_where_no_track_is_at_risk():
    found = kaplan_meier([[1, 0, 0], [0, 0, 0]], [[0, 1, 0], [0, 0, 0]])
    np.testing.assert_array_equal(found.beyond, [[0.5, 0.5, 0.5], [1, 1, 1]])
    np.testing.assert_array_equal(found.at_risk, [[2, 0, 0], [0, 0, 0]])


def test_no_lifetimes_have_no_curve():
    assert kaplan_meier([], []).beyond.shape == (0,)


@pytest.mark.parametrize("seed", range(5))
def test_along_any_axis_it_is_that_of_scipy(seed):
    rng = np.random.default_rng(seed)
    counts = rng.integers(0, 6, size=(2, 7, 4))
    counts[0, -1] += 1
    found = kaplan_meier(*counts, axis=0).beyond
    np.testing.assert_array_equal(found, kaplan_meier(*np.moveaxis(counts, 1, 2)).beyond.T)
    life = np.arange(1, 8)
    for column in range(4):
        ended, censored = (np.repeat(life, counts[kind, :, column]) for kind in (0, 1))
        expected = ecdf(CensoredData(uncensored=ended, right=censored - 1)).sf
        np.testing.assert_allclose(found[:, column], expected.evaluate(life), atol=1e-12)


def test_all_that_use_it_have_the_same_curve():
    ended, censored = np.array([10, 50, 0, 30]), np.array([0, 50, 20, 40])
    life = np.arange(1, 5)
    curve = kaplan_meier(ended, censored).beyond
    np.testing.assert_allclose(curve, [190 / 200, 190 / 200 * 90 / 140, 190 / 200 * 90 / 140, 0], rtol=1e-15)
    sums = np.array([ended, censored], dtype=np.float64)[..., None]
    np.testing.assert_array_equal(survival(sums)[0, :, 0], curve)
    causes = np.array([censored, ended, 0 * ended], dtype=np.float64)[..., None]
    np.testing.assert_allclose(1 - cumulative_incidence(causes).sum(axis=0)[:, 0], curve, atol=1e-15)
    assert restricted_mean(ended, censored, 4) == pytest.approx(1 + curve[:3].sum())
    ends = pl.DataFrame({"lifetime": life, "n_ended": ended, "n_censored": censored})
    lengths = lengths_of_tracks(ends, longest=100)
    np.testing.assert_allclose([(lengths > at).mean() for at in life], curve, atol=1e-3)
