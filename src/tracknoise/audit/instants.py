"""Frames of a sequence, and the other times at which its recording has poses, in the order of time.

The truth interpolates between all poses of a recording, such as those of frames that a run leaves out. (truth.shutter)
"""

from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.pose import from_quaternion

_POSITION, _QUATERNION = ("x_m", "y_m", "z_m"), ("qx", "qy", "qz", "qw")


@dataclass(frozen=True, slots=True, eq=False)
class Instants:
    """n times of a sequence, increasing.

    Attributes
    ----------
    cameras
        Schema `CAMERAS`, n rows; those of other times repeat the frame before them.
    poses : (n, 4, 4) float64
        NaN where there is none.
    place : (frames,) intp
        Where each frame is among them.
    """

    cameras: pl.DataFrame
    poses: NDArray[np.float64]
    place: NDArray[np.intp]


def instants_of(cameras: pl.DataFrame, poses: pl.DataFrame, path: pl.DataFrame | None) -> Instants:
    """Times of a sequence.

    Parameters
    ----------
    cameras, poses
        Schemas `CAMERAS` and `POSES`, one row per frame.
    path
        Schema `PATH`; None where only the poses of frames are known.
    """
    if path is None:
        return Instants(cameras, _matrices(poses), np.arange(cameras.height))
    frames_s, others_s = cameras["time_s"].to_numpy(), path["time_s"].to_numpy()
    before = np.clip(np.searchsorted(frames_s, others_s, side="right") - 1, 0, None)
    order = np.argsort(np.concatenate([frames_s, others_s]))
    repeated = cameras[before].with_columns(path["time_s"])
    matrices = np.concatenate([_matrices(poses), _matrices(path)])
    place = np.argsort(order)[: cameras.height]
    return Instants(pl.concat([cameras, repeated])[order], matrices[order], place)


def _matrices(table: pl.DataFrame) -> NDArray[np.float64]:
    """(n, 4, 4): NaN where a row has no pose."""
    known = table["qw"].is_not_null().to_numpy()
    poses = np.full((table.height, 4, 4), np.nan)
    rows = table.filter(pl.col("qw").is_not_null())
    poses[known] = from_quaternion(rows.select(_POSITION).to_numpy(), rows.select(_QUATERNION).to_numpy())
    return poses
