"""The car of simulated drives: how its sensors are mounted, and the calibration files that say so.

Mounted much as on the real car. No transform is the identity, so that a missing or inverted one is noticed.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.camera import Camera
from tracknoise.sequences.kitti.layout import CAM_TO_CAM, IMU_TO_VELO, VELO_TO_CAM

Pose = NDArray[np.float64]


def _mounted(rotation: Rotation, translation_m: tuple[float, float, float]) -> Pose:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.as_matrix(), translation_m
    return pose


_AXES = Rotation.from_matrix([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])  # forward, left, up to a camera's
_VELODYNE_FROM_IMU = _mounted(Rotation.from_rotvec([-0.4, 0.1, 0.8], degrees=True), (-0.81, 0.32, -0.8))
_CAMERA0_FROM_VELODYNE = _mounted(Rotation.from_rotvec([-0.9, 0.3, -0.4], degrees=True) * _AXES, (-0.01, -0.07, -0.27))
_RECTIFIED0_FROM_CAMERA0 = _mounted(Rotation.from_rotvec([0.25, -0.45, -0.55], degrees=True), (0.0, 0.0, 0.0))
_CAMERA_FROM_RECTIFIED0 = _mounted(Rotation.identity(), (0.06, -0.0004, 0.0027))

CAMERA_FROM_VELODYNE: Pose = _CAMERA_FROM_RECTIFIED0 @ _RECTIFIED0_FROM_CAMERA0 @ _CAMERA0_FROM_VELODYNE
"""(4, 4) float64: from the Velodyne's frame to the rectified camera 2."""

CAMERA_FROM_IMU: Pose = CAMERA_FROM_VELODYNE @ _VELODYNE_FROM_IMU
"""(4, 4) float64: from the inertial navigation system's frame to the rectified camera 2."""


def write_calibration(day: Path, camera: Camera) -> None:
    """Write the calibration files of a day on which the rectified camera 2 is the given one.

    Parameters
    ----------
    day
        Folder of the date.
    camera
        Without distortion.
    """
    time = "calib_time: 26-Sep-2011 12:00:00"
    (day / IMU_TO_VELO).write_text(_lines(time, _rigid(_VELODYNE_FROM_IMU)), encoding="utf-8")
    (day / VELO_TO_CAM).write_text(_lines(time, _rigid(_CAMERA0_FROM_VELODYNE)), encoding="utf-8")
    cameras = _camera("00", camera, np.eye(4)) | _camera("02", camera, _CAMERA_FROM_RECTIFIED0)
    (day / CAM_TO_CAM).write_text(_lines(time, {"corner_dist": np.array([0.1])} | cameras), encoding="utf-8")


def _camera(name: str, camera: Camera, rectified_from_rectified0: Pose) -> dict[str, NDArray[np.float64]]:
    """Keys of one camera, whose image is turned by R_rect as that of cam0 is."""
    rectify = _RECTIFIED0_FROM_CAMERA0[:3, :3]
    size = np.array([camera.width, camera.height], np.float64)
    return {
        f"S_{name}": size,
        f"K_{name}": camera.matrix,
        f"D_{name}": np.zeros(5),
        f"R_{name}": np.eye(3),
        f"T_{name}": rectify.T @ rectified_from_rectified0[:3, 3],
        f"S_rect_{name}": size,
        f"R_rect_{name}": rectify,
        f"P_rect_{name}": camera.matrix @ rectified_from_rectified0[:3],
    }


def _rigid(pose: Pose) -> dict[str, NDArray[np.float64]]:
    return {"R": pose[:3, :3], "T": pose[:3, 3]}


def _lines(head: str, values: dict[str, NDArray[np.float64]]) -> str:
    lines = (f"{key}: " + " ".join(f"{number:.16e}" for number in value.ravel()) for key, value in values.items())
    return "\n".join([head, *lines, ""])
