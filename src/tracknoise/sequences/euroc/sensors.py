"""Where cameras and sensors of poses are on the body."""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.pose import invert
from tracknoise.sequences.camera_files import CameraFile, read_camera_file, read_yaml
from tracknoise.sequences.poses import checked_poses

_EXTRINSICS = "T_BS"
_NAME = re.compile(r"cam[0-9]+")


def read_camera(path: Path, camera: str) -> CameraFile:
    """Read the intrinsics of a camera, and its place on the body.

    Raises
    ------
    DataError
        If the file is missing or damaged, or does not state the camera's place.
    """
    read = read_camera_file(path, camera=camera if names_cameras(path) else None)
    if read.body_from_camera is None:
        raise DataError(path, f"no place of {camera} on the body", f"{_EXTRINSICS} or T_cam_imu")
    return read


def read_sensor_from_body(path: Path) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Read where a sensor of poses is on the body.

    Returns
    -------
    sensor_from_body : (4, 4) float64
        The inverse of T_BS; the identity where there is no file, or it does not state it.
    notes : tuple of str
        A sentence in these cases.

    Raises
    ------
    DataError
        If the file is damaged.
    """
    values = read_yaml(path) if path.exists() else {}
    if _EXTRINSICS not in values:
        return np.eye(4), (f"there is no {_EXTRINSICS} in {path}, so the poses are taken as those of the body",)
    poses, _ = checked_poses(_matrix(path, values[_EXTRINSICS])[None], [path])
    sensor_from_body: NDArray[np.float64] = invert(poses[0])
    return sensor_from_body, ()


def names_cameras(path: Path) -> bool:
    """Whether a file holds several cameras by name, as Kalibr's do; a ``sensor.yaml`` holds one without a name."""
    return path.suffix in (".yaml", ".yml") and any(map(_NAME.fullmatch, read_yaml(path)))


def _matrix(path: Path, values: Any) -> NDArray[np.float64]:
    """The 16 numbers of a matrix, below the key ``data``."""
    data = values.get("data") if isinstance(values, dict) else values
    if not (isinstance(data, list) and len(data) == 16 and all(type(value) in (int, float) for value in data)):
        raise DataError(path, f"no matrix {_EXTRINSICS}", f"{_EXTRINSICS} with data of 16 numbers")
    return np.array(data, dtype=np.float64).reshape(4, 4)
