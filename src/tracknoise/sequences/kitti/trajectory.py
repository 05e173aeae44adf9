"""Poses of the camera: from OXTS, or from a file of poses instead."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.pose import invert
from tracknoise.sequences.kitti.calibration import read_camera_from_imu
from tracknoise.sequences.kitti.layout import OXTS, POSES, Drive
from tracknoise.sequences.kitti.oxts import poses_of_records, read_records
from tracknoise.sequences.kitti.values import POSE_COLUMNS, poses_of_rows
from tracknoise.sequences.poses import read_rows, require_poses, surplus_notes

Trajectory = tuple[NDArray[np.float64], tuple[str, ...]]


def read_trajectory(drive: Drive, numbers: range) -> Trajectory:
    """Read the poses of a drive's frames: world_from_camera = world_from_imu camera_from_imu^-1.

    Parameters
    ----------
    drive
        The drive.
    numbers
        Of its frames.

    Returns
    -------
    poses : (n, 4, 4) float64
        world_from_camera of the rectified camera 2. From OXTS, the world frame is east, north, up, with its origin at
        the first position of the inertial navigation system; from a file of poses, it is that file's.
    notes : tuple of str
        What was corrected or assumed.

    Raises
    ------
    DataError
        If there are neither, or they or the calibration are damaged or incomplete.
    """
    if drive.has_oxts:
        world_from_imu = poses_of_records(read_records(map(drive.oxts, numbers)))
        poses: NDArray[np.float64] = world_from_imu @ invert(read_camera_from_imu(drive.day))
        return poses, ()
    if not drive.poses.exists():
        raise DataError(drive.folder, f"neither {OXTS} nor {POSES}", "one of them, for the poses of the camera")
    return _read_poses(drive, len(numbers))


def _read_poses(drive: Drive, images: int) -> Trajectory:
    rows, places = read_rows(drive.poses, POSE_COLUMNS)
    require_poses(drive.poses, poses=len(rows), images=images)
    surplus = surplus_notes(drive.poses, poses=len(rows), images=images)
    poses, notes = poses_of_rows(rows[:images], places)
    return poses, (f"there is no {OXTS}: poses come from {POSES}", *surplus, *notes)
