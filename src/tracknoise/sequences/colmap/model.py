"""What a reconstruction of COLMAP holds: its cameras and its registered images."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.pose import invert
from tracknoise.sequences.camera_files.camera_file import checked_camera
from tracknoise.sequences.poses import quaternion_poses

CORNER_PX = 0.5
"""COLMAP puts (0, 0) at the corner of the first pixel, and tracknoise at its centre."""

PARAMETERS = {
    "SIMPLE_PINHOLE": 3,
    "PINHOLE": 4,
    "SIMPLE_RADIAL": 4,
    "RADIAL": 5,
    "OPENCV": 8,
    "OPENCV_FISHEYE": 8,
    "FULL_OPENCV": 12,
    "FOV": 5,
    "SIMPLE_RADIAL_FISHEYE": 4,
    "RADIAL_FISHEYE": 5,
    "THIN_PRISM_FISHEYE": 12,
    "RAD_TAN_THIN_PRISM_FISHEYE": 16,
}
"""How many parameters each camera model has, in the order of their numbers in binary files, from 0."""

_ONE_FOCAL_LENGTH = ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE")
_LENSES = {
    "SIMPLE_PINHOLE": ("pinhole", 0),
    "PINHOLE": ("pinhole", 0),
    "SIMPLE_RADIAL": ("radtan", 4),
    "RADIAL": ("radtan", 4),
    "OPENCV": ("radtan", 4),
    "FULL_OPENCV": ("radtan", 8),
    "OPENCV_FISHEYE": ("equidistant", 4),
    "SIMPLE_RADIAL_FISHEYE": ("equidistant", 4),
    "RADIAL_FISHEYE": ("equidistant", 4),
}
"""The lens model of tracknoise, and how many coefficients it has; those that COLMAP's model does not have are 0."""


@dataclass(frozen=True, slots=True)
class ColmapCamera:
    """A camera as it is written.

    Parameters
    ----------
    place
        File, and where in it, for errors.
    model
        Name of the model, one of `PARAMETERS`.
    width, height
        Size of the image, px.
    parameters
        As the model has them.
    """

    place: str
    model: str
    width: int
    height: int
    parameters: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ColmapImage:
    """A registered image as it is written.

    Parameters
    ----------
    place
        File, and where in it, for errors.
    name
        Path of the file below the folder of images.
    camera_id
        Its camera.
    pose
        Quaternion qw, qx, qy, qz and translation of ``camera_from_world``.
    """

    place: str
    name: str
    camera_id: int
    pose: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Reconstruction:
    """A reconstruction.

    Parameters
    ----------
    cameras
        By their numbers.
    images
        Registered images by their names.
    """

    cameras: dict[int, ColmapCamera]
    images: dict[str, ColmapImage]


def reconstruction(path: Path, cameras: dict[int, ColmapCamera], images: list[ColmapImage]) -> Reconstruction:
    """A reconstruction whose images all have a camera, and names of their own that lead to no other folder.

    Raises
    ------
    DataError
        If there is no image, or naming the first that is wrong.
    """
    if not images:
        raise DataError(path, "no registered images", "at least one")
    by_name: dict[str, ColmapImage] = {}
    for image in images:
        if image.camera_id not in cameras:
            raise DataError(image.place, f"camera {image.camera_id}", f"one of {', '.join(map(str, sorted(cameras)))}")
        if image.name in by_name:
            raise DataError(image.place, f"a second image {image.name}", "one of each name")
        if Path(image.name).is_absolute() or ".." in Path(image.name).parts or "\0" in image.name:
            raise DataError(image.place, f"the name {image.name!r}", "the path of a file below the folder of images")
        by_name[image.name] = image
    return Reconstruction(cameras, by_name)


def camera_of(camera: ColmapCamera) -> CameraModel:
    """The camera with (0, 0) at the centre of the first pixel.

    Raises
    ------
    DataError
        If the model is not supported, or a value is impossible.
    """
    if camera.model not in _LENSES:
        raise DataError(camera.place, f"camera model {camera.model}", f"one of {', '.join(_LENSES)}")
    f, fy, *rest = camera.parameters
    if camera.model in _ONE_FOCAL_LENGTH:
        fy, rest = f, [fy, *rest]
    cx, cy, *coefficients = rest
    lens, count = _LENSES[camera.model]
    padded = (*coefficients, *[0.0] * (count - len(coefficients)))
    intrinsics = (f, fy, cx - CORNER_PX, cy - CORNER_PX)
    return checked_camera(camera.place, lens, (camera.width, camera.height), intrinsics, padded)


def poses_of(images: list[ColmapImage]) -> NDArray[np.float64]:
    """(n, 4, 4) float64: world_from_camera of images.

    Raises
    ------
    DataError
        If a pose is not finite, or a quaternion has not the norm 1.
    """
    rows = np.array([image.pose for image in images], np.float64).reshape(-1, 7)
    return invert(quaternion_poses(rows[:, 4:], rows[:, [1, 2, 3, 0]], [image.place for image in images]))
