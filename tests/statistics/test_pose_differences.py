import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.statistics.truth_errors import LAGS, pose_differences, relative_differences
from tracknoise.tables.identity import SequenceId

NAME = SequenceId("made", "scene")


def small(rotation_rad: np.ndarray, translation_m: np.ndarray) -> np.ndarray:
    poses = np.broadcast_to(np.eye(4), (len(rotation_rad), 4, 4)).copy()
    poses[:, :3, :3] = Rotation.from_rotvec(rotation_rad).as_matrix()
    poses[:, :3, 3] = translation_m
    return poses


def path(count: int) -> np.ndarray:
    steps = np.arange(count)[:, None] / 10
    return small(np.sin(steps * (1.0, 0.7, 0.3)), steps * (0.2, -0.1, 0.4))


def rms(table: pl.DataFrame, column: str) -> dict[int, float]:
    sums = table.group_by("lag").agg(pl.col(column).sum(), pl.col("n").sum())
    return {row["lag"]: np.sqrt(row[column] / row["n"]) for row in sums.to_dicts()}


def test_another_world_frame_is_no_difference():
    moved = small(np.array([[0.3, -1.0, 0.5]]), np.array([[5.0, 2.0, -7.0]]))
    table = pose_differences(NAME, path(40), moved @ path(40))
    assert table["rotation_rad2"].max() < 1e-25
    assert table["translation_m2"].max() < 1e-25
    assert table.group_by("lag").agg(pl.col("n").sum()).sort("lag").rows() == [
        (lag, 40 - lag) for lag in LAGS if lag < 40
    ]


def test_a_known_difference_is_that_of_the_axes_of_the_later_camera():
    turn, shift = np.array([0.01, -0.02, 0.005]), np.array([0.1, 0.2, -0.3])
    other = path(5)
    other[3] = other[3] @ small(turn[None], shift[None])[0]
    found = relative_differences(path(5), other, 1)
    np.testing.assert_allclose(found[2], [*turn, *shift], atol=1e-12)
    np.testing.assert_allclose(found[:2], 0.0, atol=1e-12)


@pytest.mark.parametrize(("walk", "growth"), [(False, 0.0), (True, 0.5)], ids=["white", "random walk"])
def test_planted_noise_is_measured_with_its_growth(walk, growth):
    rng, count = np.random.default_rng(1), 3000
    rotation, translation = rng.normal(0.0, 1e-3, (count, 3)), rng.normal(0.0, 2e-3, (count, 3))
    if walk:
        rotation, translation = rotation.cumsum(axis=0), translation.cumsum(axis=0)
    # in the camera frame of each pose, so that relative poses differ by what is planted
    table = pose_differences(NAME, path(1)[[0] * count], small(rotation, translation))
    for column, planted in (("rotation_rad2", 1e-3), ("translation_m2", 2e-3)):
        found = rms(table, column)
        for lag in (1, 4, 16):
            expected = planted * (lag**growth if walk else np.sqrt(2.0))
            assert found[lag] == pytest.approx(expected, rel=0.05)


def test_frames_without_a_pose_take_no_part():
    first, second = path(10), path(10)
    first[4], second[7] = np.nan, np.nan
    table = pose_differences(NAME, first, second)
    assert table.filter(lag=1)["n"].sum() == 9 - 4
    assert table["rotation_rad2"].max() < 1e-25


def test_a_single_frame_has_no_pairs():
    assert pose_differences(NAME, path(1), path(1)).is_empty()
