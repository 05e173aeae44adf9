"""Cameras in ``transforms.json``: of all frames, or of one."""

import math
from collections.abc import Mapping
from typing import Any

from tracknoise.exceptions import DataError
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.sequences.camera_files.camera_file import checked_camera
from tracknoise.sequences.camera_files.entries import Entries

CORNER_PX = 0.5
"""nerfstudio puts (0, 0) at the corner of the first pixel, and tracknoise at its centre."""

_LENSES = {
    "pinhole": "pinhole",
    "simple_pinhole": "pinhole",
    "perspective": "radtan",
    "simple_radial": "radtan",
    "radial": "radtan",
    "opencv": "radtan",
    "opencv_fisheye": "equidistant",
}
_FISHEYE_FLAG = "is_fisheye"


_KEYS = ("w", "h", "fl_x", "fl_y", "cx", "cy", "k1", "k2", "k3", "k4", "p1", "p2")
_OTHER_KEYS = ("camera_model", "camera_angle_x", "camera_angle_y", _FISHEYE_FLAG)


def intrinsics_in(values: Mapping[str, Any]) -> dict[str, Any]:
    """What an object says about its camera, by key; null says nothing."""
    return {key: values[key] for key in (*_KEYS, *_OTHER_KEYS) if values.get(key) is not None}


def camera_of(entries: Entries, size: tuple[int, int]) -> CameraModel:
    """The camera of a frame.

    Parameters
    ----------
    entries
        What the file says of it.
    size
        Width and height of the image, px, where the file does not say.

    Raises
    ------
    DataError
        If something is missing or impossible, or the camera model is not supported.
    """
    width, height = _size(entries, size)
    fl_x, fl_y = _focal_lengths(entries, width, height)
    cx = entries.number("cx") if entries.name("cx") else width / 2
    cy = entries.number("cy") if entries.name("cy") else height / 2
    lens = _lens(entries)
    intrinsics = (fl_x, fl_y, cx - CORNER_PX, cy - CORNER_PX)
    return checked_camera(entries.place, lens, (width, height), intrinsics, _coefficients(entries, lens))


def _size(entries: Entries, size: tuple[int, int]) -> tuple[int, int]:
    width, height = (
        int(_whole(entries, name)) if entries.name(name) else of_image
        for name, of_image in zip("wh", size, strict=True)
    )
    return width, height


def _whole(entries: Entries, name: str) -> float:
    """A whole number above 0, which may be written as 640.0."""
    number = entries.number(name, positive=True)
    if not number.is_integer():
        raise entries.error(name, "a whole number")
    return number


def _focal_lengths(entries: Entries, width: int, height: int) -> tuple[float, float]:
    """fl_x and fl_y, or those of the angles of view; fl_y is fl_x where nothing is said of it."""
    fl_x = _focal_length(entries, "fl_x", "camera_angle_x", width)
    fl_y = _focal_length(entries, "fl_y", "camera_angle_y", height)
    if fl_x is None and fl_y is None:
        raise DataError(entries.place, "no fl_x and no camera_angle_x", "one of them")
    return fl_x or fl_y or math.nan, fl_y or fl_x or math.nan


def _focal_length(entries: Entries, name: str, angle_name: str, side: int) -> float | None:
    if entries.name(name):
        return entries.number(name, positive=True)
    if not entries.name(angle_name):
        return None
    angle = entries.number(angle_name, positive=True)
    if angle >= math.pi:
        raise entries.error(angle_name, "an angle below pi, in radians")
    return side / (2.0 * math.tan(angle / 2.0))


def _lens(entries: Entries) -> str:
    if entries.values.get(_FISHEYE_FLAG) is True:
        return "equidistant"
    if not entries.name("camera_model"):
        return "radtan"
    lens = _LENSES.get(entries.text("camera_model"))
    if lens is None:
        raise entries.error("camera_model", f"one of {', '.join(_LENSES).upper()}")
    return lens


def _coefficients(entries: Entries, lens: str) -> tuple[float, ...]:
    """Coefficients as the lens model has them; none of a lens without distortion."""
    k1, k2, k3, k4, p1, p2 = (
        entries.number(name) if entries.name(name) else 0.0 for name in ("k1", "k2", "k3", "k4", "p1", "p2")
    )
    if lens == "equidistant":
        return k1, k2, k3, k4
    if lens == "pinhole" or not any((k1, k2, k3, k4, p1, p2)):
        return ()
    if k4:
        raise entries.error("k4", "0, since OpenCV's model has no such coefficient")
    return (k1, k2, p1, p2, k3) if k3 else (k1, k2, p1, p2)
