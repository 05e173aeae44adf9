"""Difference of the relative poses of two truths, by lag.

With A and B the poses world_from_camera of two truths in frames i and j = i + lag, the relative poses differ by
E = (A_i^-1 A_j)^-1 (B_i^-1 B_j). It does not depend on either world frame. Its rotation vector and its translation are
those in the camera frame of frame j. (truths.poses)
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.statistics.blocks import BLOCKS
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import POSE_DIFFERENCES, SEQUENCE, check, empty

LAGS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96)
"""Frames between the two frames of a pair."""
_SQUARES = ("rotation_rad2", "translation_m2")


def pose_differences(sequence: SequenceId, first: NDArray[np.float64], second: NDArray[np.float64]) -> pl.DataFrame:
    """Squared differences of relative poses, summed by lag and stretch of the sequence.

    Parameters
    ----------
    sequence
        Name of the sequence.
    first, second
        (n, 4, 4) float64: world_from_camera of the same frames; NaN for a frame without a pose.

    Returns
    -------
    polars.DataFrame
        Schema `POSE_DIFFERENCES`, sorted by its columns before `n`. A pair of frames lies in the stretch of its first
        frame.
    """
    parts = [_of_lag(first, second, lag) for lag in LAGS if lag < len(first)]
    table = pl.concat([empty(POSE_DIFFERENCES).drop(*SEQUENCE), *parts])
    names = [pl.lit(getattr(sequence, name), dtype=kind).alias(name) for name, kind in SEQUENCE.items()]
    named = table.with_columns(names).select(*POSE_DIFFERENCES).sort(*SEQUENCE, "block", "lag")
    return check(named, POSE_DIFFERENCES, "pose differences")


def relative_differences(first: NDArray[np.float64], second: NDArray[np.float64], lag: int) -> NDArray[np.float64]:
    """Rotation vectors (rad) and translations (m) of E of (truths.poses), (n - lag, 6) float64; NaN where unknown."""
    moved = [np.linalg.solve(_known(poses[:-lag]), _known(poses[lag:])) for poses in (first, second)]
    difference = np.linalg.solve(*moved)
    rotation = Rotation.from_matrix(difference[:, :3, :3]).as_rotvec()
    found = np.concatenate([rotation, difference[:, :3, 3]], axis=1)
    ends = (first[:-lag], first[lag:], second[:-lag], second[lag:])
    found[np.any([np.isnan(poses).any(axis=(1, 2)) for poses in ends], axis=0)] = np.nan
    return found


def _known(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Poses with the identity where there is none."""
    return np.where(np.isnan(poses), np.eye(4), poses)


def _of_lag(first: NDArray[np.float64], second: NDArray[np.float64], lag: int) -> pl.DataFrame:
    difference = relative_differences(first, second, lag)
    known = np.flatnonzero(~np.isnan(difference).any(axis=1))
    squares = np.square(difference[known]).reshape(-1, 2, 3).mean(axis=2)
    block = known * BLOCKS // len(difference)
    sums = {name: np.bincount(block, squares[:, place], BLOCKS) for place, name in enumerate(_SQUARES)}
    table = pl.DataFrame({"block": np.arange(BLOCKS), "lag": [lag] * BLOCKS, "n": np.bincount(block, minlength=BLOCKS)})
    kinds = {name: kind for name, kind in POSE_DIFFERENCES.items() if name not in SEQUENCE}
    return (
        table.with_columns(**sums)
        .filter(pl.col("n") > 0)
        .select(pl.col(name).cast(kind) for name, kind in kinds.items())
    )
