"""KITTI's calibration files: one ``key: numbers`` per line. Only the keys that are needed are read.

Chain of frames: imu (x forward, y left, z up) -> velo (the same axes) -> cam0 (x right, y down, z forward) ->
rectified cam0 (R_rect_00) -> rectified cam2, which only a translation t separates from it: P_rect_02 = K (I | t).
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_text
from tracknoise.geometry.camera import Camera
from tracknoise.sequences.kitti.layout import CAM_TO_CAM, IMU_TO_VELO, VELO_TO_CAM
from tracknoise.sequences.poses import checked_poses

Values = dict[str, NDArray[np.float64]]
_SIZE, _RECTIFY, _PROJECT = "S_rect_02", "R_rect_00", "P_rect_02"


def read_camera(day: Path) -> Camera:
    """The rectified camera 2: fx, fy, cx, cy of P_rect_02 and the size S_rect_02.

    Raises
    ------
    DataError
        If the file or a key is missing, or its values cannot be.
    """
    path = day / CAM_TO_CAM
    values = _read(path, {_SIZE: 2, _PROJECT: 12})
    width, height = values[_SIZE].tolist()
    if not (width >= 1 and height >= 1 and width.is_integer() and height.is_integer()):
        raise DataError(path, f"{_SIZE} of {width:g} {height:g}", "the images' width and height, px")
    (fx, _, cx), (_, fy, cy), _ = _projection(path, values)[:, :3].tolist()
    return Camera(int(width), int(height), fx, fy, cx, cy)


def read_camera_from_velodyne(day: Path) -> NDArray[np.float64]:
    """(4, 4) float64: from the Velodyne's frame to the rectified camera 2.

    Raises
    ------
    DataError
        If a file or key is missing, or its values cannot be.
    """
    path = day / CAM_TO_CAM
    values = _read(path, {_RECTIFY: 9, _PROJECT: 12})
    P = _projection(path, values)
    camera_from_rectified0 = np.eye(4)
    camera_from_rectified0[:3, 3] = np.linalg.solve(P[:, :3], P[:, 3])
    rectified0_from_camera0 = _rigid(path, values[_RECTIFY], np.zeros(3))
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
    values = _read(path, {"R": 9, "T": 3})
    return _rigid(path, values["R"], values["T"])


def _rigid(path: Path, rotation: NDArray[np.float64], translation_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """A transform whose rotation, rounded in the file, is made exact."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.reshape(3, 3), translation_m
    poses, _ = checked_poses(pose[None], [path])
    rigid: NDArray[np.float64] = poses[0]
    return rigid


def _projection(path: Path, values: Values) -> NDArray[np.float64]:
    """P_rect_02, (3, 4), after checking that it is that of a camera without skew."""
    P = values[_PROJECT].reshape(3, 4)
    plain = P[0, 1] == P[1, 0] == P[2, 0] == P[2, 1] == 0.0 and P[2, 2] == 1.0
    if not (plain and P[0, 0] > 0.0 and P[1, 1] > 0.0):
        raise DataError(path, f"another {_PROJECT}", "fx 0 cx . 0 fy cy . 0 0 1 . with positive fx, fy")
    return P


def _read(path: Path, counts: dict[str, int]) -> Values:
    """Values of some keys of a file, which must have given counts of numbers."""
    lines = read_text(path, f"a calibration with {', '.join(counts)}").splitlines()
    values: Values = {}
    for number, line in enumerate(lines, start=1):
        key, _, rest = line.partition(":")
        if key.strip() in counts:
            values[key.strip()] = _numbers(f"{path}:{number}", key.strip(), rest.split(), counts[key.strip()])
    for key, count in counts.items():
        if key not in values:
            raise DataError(path, f"no {key}", f"a line of {key} and {count} numbers")
    return values


def _numbers(place: str, key: str, fields: list[str], count: int) -> NDArray[np.float64]:
    if len(fields) != count:
        raise DataError(place, f"{key} of {len(fields)} numbers", f"{count}")
    try:
        numbers = np.array([float(field) for field in fields])
    except ValueError as error:
        raise DataError(place, f"{key} with fields that are not numbers", f"{count} numbers") from error
    if not np.isfinite(numbers).all():
        raise DataError(place, f"NaN or infinity in {key}", "finite numbers")
    return numbers
