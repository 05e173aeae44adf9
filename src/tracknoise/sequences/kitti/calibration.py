"""The calibration of KITTI raw data.

Chain of frames: imu (x forward, y left, z up) -> velo (the same axes) -> cam0 (x right, y down, z forward) ->
rectified cam0 (R_rect_00) -> rectified cam2, which only a translation t separates from it: P_rect_02 = K (I | t).
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.camera import Camera
from tracknoise.sequences.kitti.layout import CAM_TO_CAM, IMU_TO_VELO, VELO_TO_CAM
from tracknoise.sequences.kitti.values import camera_from_reference, projection, read_values, rigid

_SIZE, _RECTIFY, _PROJECT = "S_rect_02", "R_rect_00", "P_rect_02"


def read_camera(day: Path) -> Camera:
    """The rectified camera 2: fx, fy, cx, cy of P_rect_02 and the size S_rect_02.

    Raises
    ------
    DataError
        If the file or a key is missing, or its values cannot be.
    """
    path = day / CAM_TO_CAM
    values = read_values(path, {_SIZE: 2, _PROJECT: 12})
    width, height = values[_SIZE].tolist()
    if not (width >= 1 and height >= 1 and width.is_integer() and height.is_integer()):
        raise DataError(path, f"{_SIZE} of {width:g} {height:g}", "the images' width and height, px")
    (fx, _, cx), (_, fy, cy), _ = projection(path, values, _PROJECT)[:, :3].tolist()
    return Camera(int(width), int(height), fx, fy, cx, cy)


def read_camera_from_velodyne(day: Path) -> NDArray[np.float64]:
    """(4, 4) float64: from the Velodyne's frame to the rectified camera 2.

    Raises
    ------
    DataError
        If a file or key is missing, or its values cannot be.
    """
    path = day / CAM_TO_CAM
    values = read_values(path, {_RECTIFY: 9, _PROJECT: 12})
    camera_from_rectified0 = camera_from_reference(projection(path, values, _PROJECT))
    rectified0_from_camera0 = rigid(path, values[_RECTIFY], np.zeros(3))
    chain: NDArray[np.float64] = camera_from_rectified0 @ rectified0_from_camera0 @ _read_rigid(day / VELO_TO_CAM)
    return chain


def read_camera_from_imu(day: Path) -> NDArray[np.float64]:
    """(4, 4) float64: from the inertial navigation system's frame to the rectified camera 2.

    Raises
    ------
    DataError
        If a file or key is missing, or its values cannot be.
    """
    chain: NDArray[np.float64] = read_camera_from_velodyne(day) @ _read_rigid(day / IMU_TO_VELO)
    return chain


def _read_rigid(path: Path) -> NDArray[np.float64]:
    values = read_values(path, {"R": 9, "T": 3})
    return rigid(path, values["R"], values["T"])
