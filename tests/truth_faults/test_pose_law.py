"""The growth law of pose errors comes back from scenes in which it is known."""

import numpy as np
import polars as pl
import pytest

from tracknoise.tables.schema import POSE_GROWTH
from tracknoise.truth_faults.pose_accuracy import pose_law

LAGS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 48)


def growth(scene, *, white, walk, n=200, spread=0.15, seed=0):
    """A scene whose mean squares scatter about a law, more at large distances; the same for both motions."""
    rng = np.random.default_rng([seed, scene])
    rows = []
    for lag in LAGS:
        square = (2 * white**2 + walk**2 * lag) * (1 + spread * rng.standard_normal(3))
        row = {
            "dataset": "d",
            "scene": f"{scene}",
            "lighting": "l",
            "rotation": 0,
            "direction": "forward",
            "camera": "",
        }
        row |= {"lag": lag, "n": n - lag}
        row |= {f"rotation_{axis}_deg2": value for axis, value in zip(("xx", "yy", "zz"), square, strict=True)}
        row |= {f"translation_{axis}_m2": value / 1e4 for axis, value in zip(("xx", "yy", "zz"), square, strict=True)}
        rows.append(row)
    return pl.DataFrame(rows, schema=dict(POSE_GROWTH))


def values(table, motion):
    return {row["law"]: row for row in table.filter(motion=motion).to_dicts()}


@pytest.mark.parametrize(("white", "walk"), [(0.2, 0.0), (0.0, 0.1), (0.2, 0.1)])
def test_the_parts_come_back_with_intervals_over_scenes(white, walk):
    found = pose_law(growth(scene, white=white, walk=walk) for scene in range(8))
    for motion, unit in (("rotation", 1.0), ("translation", 0.01)):
        parts = values(found, motion)
        assert parts["white"]["value"] == pytest.approx(white * unit, abs=0.04 * unit)
        assert parts["random walk"]["value"] == pytest.approx(walk * unit, abs=0.02 * unit)
        assert parts["white"]["low"] - 1e-9 <= parts["white"]["value"] <= parts["white"]["high"] + 1e-9
    assert found["resampled"].unique().to_list() == ["scenes"]
    assert found["n_scenes"].unique().to_list() == [8]
    assert found["unit"].to_list() == ["deg", "deg per sqrt(frame)", "m", "m per sqrt(frame)"]


def test_one_scene_has_no_interval():
    found = pose_law([growth(0, white=0.2, walk=0.1)])
    assert found["value"].null_count() == 0
    assert found["low"].null_count() == found.height == 4


def test_no_motion_and_a_single_lag():
    assert pose_law([growth(0, white=0.0, walk=0.0)])["value"].to_list() == [0.0] * 4
    single = pose_law([growth(0, white=0.2, walk=0.0, spread=0.0).filter(lag=4)])
    assert values(single, "rotation")["white"]["value"] == pytest.approx(0.2)
    assert pose_law([]).is_empty()


def test_a_turn_that_is_traded_for_a_move_to_the_side_claims_no_more_than_the_image_shows():
    """Where depth varies little, tracks show 13 deg^2 beside a negative square of the translation."""
    traded = growth(0, white=0.0, walk=0.0).with_columns(
        rotation_yy_deg2=0.6 * pl.col("lag"), translation_xx_m2=-0.006 * pl.col("lag"),
        rigid_px2=0.02 * pl.col("lag"), error_px2=0.3 + 0.02 * pl.col("lag"), px2_per_degree=200.0, px2_per_metre=2e4,
    )  # fmt: skip
    found = values(pose_law([traded]), "rotation")
    assert found["random walk"]["value"] == pytest.approx(0.01, rel=0.02)  # 200 px^2 per degree^2 make .02 px^2
    assert found["white"]["value"] == pytest.approx(0.0, abs=1e-3)


def test_a_law_that_does_not_fit_is_as_small_as_the_errors_of_each_age():
    errors = pl.when(pl.col("lag") == 4).then(0.01).otherwise(0.3)
    seen = growth(0, white=0.0, walk=0.1, spread=0.0).with_columns(
        rigid_px2=0.1 * pl.col("lag"), error_px2=errors, px2_per_degree=10.0, px2_per_metre=0.0
    )
    walk = values(pose_law([seen]), "rotation")["random walk"]["value"]
    assert 10.0 * walk**2 * 4 == pytest.approx(0.01)
