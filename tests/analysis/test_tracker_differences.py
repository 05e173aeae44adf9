"""Differences between trackers with intervals: what is established, and what is not."""

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.truth_shares import tracker_differences
from tracknoise.tables.schema import BETWEEN_TRACKERS

COVARIANCE = np.array([[0.5, 0.2], [0.2, 0.4]])


def moments(*, bias_u=0.0, scenes=8, blocks=1, n=300, seed=0, ages=(1, 4, 10)):
    """Sums of differences with a bias along u and a known covariance."""
    rng, rows = np.random.default_rng(seed), []
    for scene in range(scenes):
        for block in range(blocks):
            for age in ages:
                drawn = rng.multivariate_normal([bias_u, 0.0], COVARIANCE, n)
                rows.append(
                    {
                        "dataset": "d", "scene": f"{scene}", "lighting": "default", "rotation": 0,
                        "direction": "forward", "camera": "", "tracker": "a", "speed": 1, "other": "b", "block": block,
                        "age": age, "n": n, "mean_u": drawn[:, 0].mean(), "mean_v": drawn[:, 1].mean(),
                        "m_uu": n * drawn[:, 0].var(), "m_vv": n * drawn[:, 1].var(),
                        "m_uv": n * np.cov(drawn.T, bias=True)[0, 1],
                    }
                )  # fmt: skip
    return pl.DataFrame(rows, schema=dict(BETWEEN_TRACKERS))


@pytest.mark.parametrize(("layout", "resampled"), [({}, "scenes"), ({"scenes": 1, "blocks": 16}, "blocks")])
def test_a_bias_between_trackers_is_established(layout, resampled):
    found = tracker_differences(moments(bias_u=0.3, **layout))
    means = found.filter(statistic="mean")
    assert means.filter(coordinate="u")["established"].all()
    assert not means.filter(coordinate="v")["established"].any()
    assert means.filter(coordinate="u")["value"].to_numpy() == pytest.approx(0.3, abs=0.06)
    assert found["resampled"].unique().to_list() == [resampled]
    assert found["n"].unique().to_list() == [300 * layout.get("scenes", 8) * layout.get("blocks", 1)]


def test_the_covariance_is_that_of_the_differences():
    found = tracker_differences(moments(n=2000)).filter(statistic="central", age=4).sort("coordinate")
    assert found["coordinate"].to_list() == ["u", "uv", "v"]
    assert found["value"].to_numpy() == pytest.approx(COVARIANCE[[0, 0, 1], [0, 1, 1]], rel=0.1)
    assert (
        (found["low"] < COVARIANCE[[0, 0, 1], [0, 1, 1]]) & (found["high"] > COVARIANCE[[0, 0, 1], [0, 1, 1]])
    ).all()
    assert found["established"].null_count() == 3


def test_where_nothing_differs_little_is_established():
    alarms = [tracker_differences(moments(seed=seed, n=50))["established"].any() for seed in range(60)]
    assert np.mean(alarms) <= 0.12


def test_no_tables_give_no_rows():
    assert tracker_differences(moments().clear()).is_empty()
