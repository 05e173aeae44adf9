"""Cameras as OpenCV's FileStorage and ROS's camera_info describe them: a 3x3 matrix and a list of coefficients."""

import numpy as np

from tracknoise.exceptions import DataError
from tracknoise.sequences.camera_files.camera_file import CameraFile, checked_camera
from tracknoise.sequences.camera_files.entries import Entries
from tracknoise.sequences.camera_files.lens_names import coefficients_at, lens_at
from tracknoise.sequences.camera_files.readout import shutter_at

_MATRIX = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "k", "M")
_DISTORTION = (
    "distortion_coefficients",
    "Distortion_Coefficients",
    "distCoeffs",
    "dist_coeffs",
    "distortion_coeffs",
    "distortion",
    "D",
    "d",
)
_WIDTH, _HEIGHT = ("image_width", "image_Width", "width"), ("image_height", "image_Height", "height")
_SIZE = ("image_size", "imageSize", "image_Size", "resolution", "size")
_MODEL, _FISHEYE = "distortion_model", "fisheye_model"
_MOST_SKEW = 1e-3
"""Largest skew that is rounding, relative to the focal length."""


def has_matrix(entries: Entries, camera: str | None) -> bool:
    """Whether there is a camera matrix: that of the file's only camera, or of the one named, such as ``1``."""
    return entries.name(*_numbered(_MATRIX, camera)) is not None


def read_matrices(entries: Entries, camera: str | None, size: tuple[int, int] | None) -> CameraFile:
    """The camera of a file that `has_matrix`; where OpenCV calibrated a pair, the one named, by default ``1``.

    Parameters
    ----------
    entries
        Of the file.
    camera
        ``1`` or ``2`` of a pair, otherwise None.
    size
        Width and height of the images where the file does not say, px.

    Raises
    ------
    DataError
        If something is missing or impossible, or the model of the lens is not supported.
    """
    name = entries.required(*_numbered(_MATRIX, camera))
    matrix = entries.matrix(name, 3, 3)
    (fx, skew, cx), (below, fy, cy), last = matrix
    if fx <= 0.0 or fy <= 0.0 or abs(skew) > _MOST_SKEW * fx or below or not np.array_equal(last, (0.0, 0.0, 1.0)):
        raise entries.error(name, "fx 0 cx, 0 fy cy, 0 0 1 with focal lengths above 0")
    model = _model(entries)
    distortion = entries.name(*_numbered(_DISTORTION, camera))
    coefficients = coefficients_at(entries, distortion, model)
    known = checked_camera(entries.place, model, _size(entries, size), (fx, fy, cx, cy), coefficients)
    return CameraFile(known, shutter=shutter_at(entries))


def _numbered(names: tuple[str, ...], camera: str | None) -> tuple[str, ...]:
    """Names of the keys of one camera: without a number where none is asked for, otherwise with it."""
    ending = "1" if camera is None else camera
    numbered = tuple(f"{name}{between}{ending}" for name in names for between in ("", "_"))
    return (*names, *numbered) if camera is None else numbered


def _model(entries: Entries) -> str:
    if entries.name(_MODEL):
        return lens_at(entries, _MODEL)
    return "equidistant" if entries.name(_FISHEYE) and entries.number(_FISHEYE) else "radtan"


def _size(entries: Entries, size: tuple[int, int] | None) -> tuple[int, int]:
    width, height, both = entries.name(*_WIDTH), entries.name(*_HEIGHT), entries.name(*_SIZE)
    if width is not None and height is not None:
        wide, high = (entries.number(name, whole=True, positive=True) for name in (width, height))
        return int(wide), int(high)
    if both is not None:
        return entries.size(both)
    if size is None:
        raise DataError(entries.place, "no size of the image", "image_width and image_height")
    return size
