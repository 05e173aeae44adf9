"""The two cameras of the Kinect, and how they lie to each other."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.camera import Camera
from tracknoise.geometry.pose import nearest_rigid
from tracknoise.sequences.poses import read_matrix

INTRINSICS = "camera-intrinsics.txt"
COLOUR_FOCAL_PX = 525.0
"""Focal length of the colour camera, px; structure from motion finds 525.1 to 527.7 px, by scene."""

_SIZE = (640, 480)
_DEPTH = Camera(*_SIZE, 585.0, 585.0, 320.0, 240.0)
_SAME_FOCAL = 0.01
"""Largest relative difference from the published focal length at which a file gives the depth camera's."""

_COLOUR_FROM_DEPTH = (
    (0.999965180, 0.0026765126, -0.0079041012, -0.0255589432),
    (-0.0027409311, 0.9999630280, -0.0081504521, 0.000101096),
    (0.0078819942, 0.0081718329, 0.9999355456, 0.0020318322),
    (0.0, 0.0, 0.0, 1.0),
)
"""Calibration of a Kinect of the same type (LIRIS, Lyon), with which the data set is registered elsewhere too."""


class Calibration(StrEnum):
    """How colour, depth and poses belong together."""

    registered = "registered"
    raw = "raw"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Cameras:
    """The cameras of a recording.

    Parameters
    ----------
    colour
        Of the images.
    depth
        Of the depth maps.
    colour_from_depth
        (4, 4) float64, metres: from the frame of the depth camera, whose poses are recorded, to that of the colour
        camera; None where both are one camera.
    notes
        What was assumed, one sentence each.
    """

    colour: Camera
    depth: Camera
    colour_from_depth: NDArray[np.float64] | None
    notes: tuple[str, ...]


def find_cameras(
    folders: list[Path],
    image: Path,
    size: tuple[int, int],
    *,
    calibration: Calibration,
    colour_focal_px: float = COLOUR_FOCAL_PX,
) -> Cameras:
    """The cameras of a recording, from the nearest file of intrinsics or else as published.

    A file with the depth camera's focal length describes the depth camera. Any other file describes one camera of
    colour and depth, and nothing is registered.

    Parameters
    ----------
    folders
        Where the file may be, the nearest first.
    image, size
        An image and its width and height, px.
    calibration
        Whether depth and poses are registered to the colour camera.
    colour_focal_px
        Focal length of the colour camera where it is registered, px.

    Raises
    ------
    DataError
        If the file cannot be used, or there is none for images that are not the Kinect's.
    """
    file = next((folder / INTRINSICS for folder in folders if (folder / INTRINSICS).exists()), None)
    if file is None and size != _SIZE:
        raise DataError(image, f"size {size[0]}x{size[1]} and no {INTRINSICS}", "640x480 or that file")
    given = _DEPTH if file is None else _read_camera(file, size)
    if calibration is Calibration.registered and size == _SIZE and _is_depth_camera(given):
        return _registered(given, colour_focal_px)
    return Cameras(colour=given, depth=given, colour_from_depth=None, notes=_one_camera(folders[0], file, calibration))


def _registered(depth: Camera, focal_px: float) -> Cameras:
    width, height = _SIZE
    colour = Camera(width, height, focal_px, focal_px, (width - 1) / 2, (height - 1) / 2)
    rigid, _ = nearest_rigid(np.array([_COLOUR_FROM_DEPTH]))
    note = (
        f"depth and poses are registered to the colour camera (focal length {focal_px:g} px, principal point in the "
        f"middle of the image) by a published calibration of the depth camera ({depth.fx:g} px) to the colour camera "
        "of a Kinect of the same type"
    )
    return Cameras(colour=colour, depth=depth, colour_from_depth=rigid[0], notes=(note,))


def _one_camera(folder: Path, file: Path | None, calibration: Calibration) -> tuple[str, ...]:
    """What is assumed where colour and depth are one camera."""
    if file is None:
        found = f"{folder}: no {INTRINSICS}, so the depth camera's fx = fy = 585, cx = 320, cy = 240 are assumed"
        return found, "colour and depth are assumed to share one camera"
    unknown = f"{file} does not give the depth camera's 585 px: "
    reason = "" if calibration is Calibration.raw else unknown
    return (f"{reason}colour and depth are assumed to share one camera",)


def _is_depth_camera(camera: Camera) -> bool:
    """Whether both focal lengths are those published for the depth camera."""
    return bool(np.allclose((camera.fx, camera.fy), _DEPTH.fx, rtol=_SAME_FOCAL, atol=0.0))


def _read_camera(path: Path, size: tuple[int, int]) -> Camera:
    matrix = read_matrix(path, size=3)
    fx, fy, cx, cy = matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()
    pinhole = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    if not (np.isfinite(matrix).all() and np.array_equal(matrix, pinhole) and fx > 0 and fy > 0):
        raise DataError(path, "no pinhole camera", "rows fx 0 cx, 0 fy cy and 0 0 1, with fx and fy above 0")
    return Camera(*size, fx, fy, cx, cy)
