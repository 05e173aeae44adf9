"""The self-test's own statistics, by hand."""

import numpy as np
import polars as pl
import pytest
from benchmarks.selfcheck.known_worlds import Script
from benchmarks.selfcheck.reference import (
    Trim,
    autocorrelation,
    counts,
    curves,
    kept,
    long_lived,
    rates,
    survival,
    threshold_px,
)

ALIVE = np.array([[1, 1, 1], [1, 1, 0], [0, 1, 1], [0, 1, 0]], dtype=bool)


def script(du: list[list[float]], *, speed: int = 1, end: tuple[str, ...] | None = None) -> Script:
    """Tracks that live as `ALIVE` says, with errors in u; v has their negative half."""
    u = np.array(du)
    return Script(
        frames=speed * np.arange(3),
        alive=ALIVE,
        true_px=np.zeros((4, 3, 2)),
        error_px=np.stack([u, -u / 2], axis=-1),
        status=np.array([["valid"] * 3, ["valid", "occluded", "valid"], ["valid"] * 3, ["valid"] * 3]),
        end=np.array(end or ("sequence_end", "outlier", "sequence_end", "lost")),
        depth_m=np.ones(4),
        zero_frame=speed * ALIVE.argmax(axis=1),
    )


DU = [[0.0, 1.0, 3.0], [0.0, 8.0, 9.0], [9.0, 0.0, -2.0], [9.0, 0.0, 9.0]]


def points(table: pl.DataFrame, **keys: str) -> dict[int, tuple[int, float]]:
    """n and u by age."""
    chosen = table.filter(**keys).select("at", "n", "u")
    return {at: (n, u) for at, n, u in chosen.iter_rows()}


def test_curves_of_visible_and_projected_errors():
    table = curves([script(DU, speed=2)], Trim(100.0, "all", "visible"), axis="age")
    where = {"trimming": "untrimmed", "weighting": "features"}
    assert points(table, **where, population="visible", statistic="nu") == {0: (4, 0.0), 2: (2, -0.5), 4: (1, 3.0)}
    assert points(table, **where, population="projected", statistic="nu")[2] == (3, pytest.approx(7 / 3))
    assert points(table, **where, population="projected", statistic="Phi")[2] == (3, pytest.approx(69 / 3))
    central = points(table, **where, population="projected", statistic="central")[2]
    assert central == (3, pytest.approx((69 - 49 / 3) / 2))


def test_scenes_weigh_alike_only_if_asked():
    few = script([[0.0, 4.0, 0.0], *DU[1:2], [0.0, 0.0, 0.0], DU[3]])
    table = curves([script(DU), few], Trim(100.0, "all", "visible"), axis="frame")
    where = {"trimming": "untrimmed", "population": "visible", "statistic": "mu"}
    assert points(table, **where, weighting="features")[2] == (4, pytest.approx(0.25))
    means = {weighting: points(table, **where, weighting=weighting)[1][1] for weighting in ("features", "scenes")}
    assert means == {"features": pytest.approx(5 / 6), "scenes": pytest.approx(5 / 6)}


def test_trimming_drops_whole_tracks():
    whole = script(DU)
    limit, largest = threshold_px(whole, Trim(50.0, "all", "projected"))
    length = np.sqrt(1.25)
    assert largest.tolist() == pytest.approx([3 * length, 8 * length, 2 * length, 0.0])
    assert limit == pytest.approx(2.5 * length)
    assert kept(whole, Trim(50.0, "all", "projected")).tolist() == [False, False, True, True]
    assert threshold_px(whole, Trim(50.0, "followed", "visible"))[0] == pytest.approx(2.5 * length)
    assert threshold_px(whole, Trim(50.0, "all", "visible"))[0] == pytest.approx(1.0 * length)


def test_lifetimes_rates_and_counts():
    table = survival([script(DU)])
    assert table["survival"].to_list() == pytest.approx([3 / 4, 3 / 4 * 1 / 2, None])
    assert rates([script(DU)]) == {"mean_lifetime": 2.0, "outlier_ratio": 1 / 6}
    assert counts([script(DU)]).rows() == [
        ("truth", "occluded", 1),
        ("truth", "valid", 7),
        ("end", "lost", 1),
        ("end", "outlier", 1),
        ("end", "sequence_end", 2),
    ]


def test_changes_and_long_lived_tracks():
    assert autocorrelation([script(DU)]) == pytest.approx((2 / 2.5, 2 / 2.5))
    old = long_lived([script(DU)], 2).filter(statistic="nu", weighting="features")
    assert old.select("at", "n", "u").rows() == [(0, 1, 0.0), (1, 1, 1.0), (2, 1, 3.0)]
