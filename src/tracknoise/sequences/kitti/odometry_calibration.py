"""Calibration, times and poses of the KITTI odometry benchmark.

All cameras are rectified: P_k = K (I | t_k), so X_k = X_0 + t_k. Poses are those of camera 0.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.printable import counted
from tracknoise.sequences.kitti.values import (
    POSE_COLUMNS,
    camera_from_reference,
    poses_of_rows,
    projection,
    read_values,
    rigid,
)
from tracknoise.sequences.poses import read_rows, require_poses, surplus_notes

_VELODYNE_KEY = "Tr"


def read_projection(path: Path, camera: int) -> NDArray[np.float64]:
    """Read the projection matrix of a camera, (3, 4) float64.

    Raises
    ------
    DataError
        If the file or its key is missing, or it is no projection of a rectified camera.
    """
    key = f"P{camera}"
    return projection(path, read_values(path, {key: 12}), key)


def read_camera_from_velodyne(path: Path, camera: int) -> NDArray[np.float64]:
    """Read the transform from the Velodyne's frame to that of a camera, (4, 4) float64.

    Raises
    ------
    DataError
        If the file or a key is missing, or holds no rigid transform.
    """
    rows = read_values(path, {_VELODYNE_KEY: 12})[_VELODYNE_KEY].reshape(3, 4)
    reference_from_velodyne = rigid(path, rows[:, :3], rows[:, 3])
    chain: NDArray[np.float64] = camera_from_reference(read_projection(path, camera)) @ reference_from_velodyne
    return chain


def read_reference_poses(path: Path, numbers: range) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Read the poses of camera 0. Row i belongs to image i; there may be more rows than images.

    Returns
    -------
    poses : (n, 4, 4) float64
        world_from_camera of camera 0, of the numbered frames.
    notes : tuple of str
        What was corrected, and how many rows have no image.

    Raises
    ------
    DataError
        If the file is missing or damaged, or a frame has no row.
    """
    rows, places = read_rows(path, POSE_COLUMNS)
    require_poses(path, poses=len(rows), images=numbers.stop)
    poses, notes = poses_of_rows(rows[numbers.start : numbers.stop], places[numbers.start : numbers.stop])
    return poses, (*surplus_notes(path, poses=len(rows), images=numbers.stop), *notes)


def read_times(path: Path, numbers: range) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
    """Read the times of images. Row i belongs to image i.

    Returns
    -------
    timestamps_s : (n,) float64 or None
        Seconds after the first of the numbered frames; None where the file is missing or its times do not increase.
    notes : tuple of str
        A sentence in these cases.

    Raises
    ------
    DataError
        If the file is damaged, or a frame has no row.
    """
    if not path.exists():
        return None, (f"{path}: no such file, so times are unknown",)
    rows, _ = read_rows(path, "time")
    if len(rows) < numbers.stop:
        raise DataError(path, counted(len(rows), "time"), f"at least {numbers.stop}, one for each image")
    times_s = rows[numbers.start : numbers.stop, 0]
    if not (np.isfinite(times_s).all() and np.all(np.diff(times_s) > 0.0)):
        return None, (f"{path}: the times do not increase, so they are not used",)
    return times_s - times_s[0], ()
