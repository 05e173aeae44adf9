"""The camera that a CameraInfo message describes."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tracknoise.exceptions import DataError
from tracknoise.printable import counted
from tracknoise.sequences.camera_files import CameraFile
from tracknoise.sequences.camera_files.camera_file import checked_camera

_RADTAN = ("plumb_bob", "rational_polynomial", "radtan", "brown_conrady")
_EQUIDISTANT = ("equidistant", "fisheye", "kannala_brandt4")
_RADTAN_COUNTS = (4, 5, 8)
_EQUIDISTANT_COUNT = 4
_ROTATION_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """What a CameraInfo message says.

    Parameters
    ----------
    width, height
        Size of the full image, px.
    model
        Name of the distortion model.
    d
        Distortion coefficients.
    k, r, p
        Rows of the camera matrix (3x3), of the rectifying rotation (3x3) and of the projection (3x4).
    binning
        Pixels that are joined along x and y; 0 means 1.
    roi
        First column and row, width and height of the part that is kept; width and height 0 mean all.
    """

    width: int
    height: int
    model: str
    d: tuple[float, ...]
    k: tuple[float, ...]
    r: tuple[float, ...]
    p: tuple[float, ...]
    binning: tuple[int, int]
    roi: tuple[int, int, int, int]


def camera_info(message: Any) -> CameraInfo:
    """The content of a message of ROS 1 or ROS 2, whose fields are named D, K, R, P or d, k, r, p."""
    matrices = (getattr(message, name, None) for name in "dkrp")
    ros1 = (getattr(message, name, None) for name in "DKRP")
    d, k, r, p = (
        tuple(np.ravel(np.asarray(b if a is None else a)).tolist()) for a, b in zip(matrices, ros1, strict=True)
    )
    roi = message.roi
    return CameraInfo(
        message.width,
        message.height,
        message.distortion_model,
        d,
        k,
        r,
        p,
        (max(message.binning_x, 1), max(message.binning_y, 1)),
        (roi.x_offset, roi.y_offset, roi.width, roi.height),
    )


def camera_of(place: str, info: CameraInfo, *, rectified: bool) -> tuple[CameraFile, tuple[str, ...]]:
    """The camera of the images.

    Parameters
    ----------
    place
        Bag and topic, for errors.
    info
        What the message says.
    rectified
        Whether the images are rectified: they have the intrinsics of the projection P, and no distortion.

    Returns
    -------
    camera : CameraFile
    notes : tuple of str
        What was assumed.

    Raises
    ------
    DataError
        If the message is not filled in, or the distortion model is unknown.
    """
    fx, fy, cx, cy = _intrinsics(place, info, rectified=rectified)
    (along_x, along_y), (left, top, width, height) = info.binning, info.roi
    size = ((width or info.width) // along_x, (height or info.height) // along_y)
    if min(size) < 1:
        raise DataError(place, f"an image size of {size[0]}x{size[1]}", "a size of at least 1x1")
    scaled = (fx / along_x, fy / along_y, _binned(cx - left, along_x), _binned(cy - top, along_y))
    d = () if rectified else _coefficients(place, info)
    model = "equidistant" if d and info.model.lower() in _EQUIDISTANT else "radtan"
    file = CameraFile(checked_camera(place, model, size, scaled, d))
    return file, (*file.notes, *_notes(place, info, rectified=rectified))


def _intrinsics(place: str, info: CameraInfo, *, rectified: bool) -> tuple[float, float, float, float]:
    """Focal lengths and principal point fx, fy, cx, cy of the full image."""
    name, columns, values = ("P", 4, info.p) if rectified else ("K", 3, info.k)
    matrix = np.array(values).reshape(3, columns)
    fx, fy, cx, cy = matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()
    if not (np.isfinite(matrix).all() and fx > 0 and fy > 0):
        raise DataError(place, f"{name} with the focal lengths {fx:g} and {fy:g}", "focal lengths above 0")
    if matrix[0, 1] != 0.0 or matrix[1, 0] != 0.0:
        raise DataError(place, f"{name} with a skew of {matrix[0, 1]:g}", "a skew of 0")
    return fx, fy, cx, cy


def _binned(centre: float, joined: int) -> float:
    """A position in the image whose pixels are joined; (0, 0) is the centre of the first pixel in both."""
    return (centre + 0.5) / joined - 0.5


def _coefficients(place: str, info: CameraInfo) -> tuple[float, ...]:
    """The distortion coefficients of the model; none of a lens without distortion."""
    if not np.isfinite(info.d).all():
        raise DataError(place, "distortion with NaN or infinity", "finite coefficients")
    model, expected = info.model.lower(), f"{', '.join((*_RADTAN[:2], _EQUIDISTANT[0]))} or no distortion"
    if not any(info.d) and model not in _EQUIDISTANT:
        return ()
    if model not in (*_RADTAN, *_EQUIDISTANT):
        raise DataError(place, f"distortion model {info.model!r}", expected)
    counts = (_EQUIDISTANT_COUNT,) if model in _EQUIDISTANT else _RADTAN_COUNTS
    used = info.d[: max(counts)] if not any(info.d[max(counts) :]) else info.d
    if len(used) not in counts:
        found = f"{counted(len(info.d), 'coefficient')} of the model {info.model!r}"
        raise DataError(place, found, f"{' or '.join(map(str, counts))} coefficients")
    return used


def _notes(place: str, info: CameraInfo, *, rectified: bool) -> tuple[str, ...]:
    if not rectified:
        return ()
    turned = np.abs(np.array(info.r) - np.eye(3).ravel()).max() > _ROTATION_TOLERANCE and any(info.r)
    frame = ", and the frame of the images is taken as that of the rectified camera" if turned else ""
    used = f"{place}: the name of the image topic says that the images are rectified, so P is used and not K{frame}"
    baseline_m = -info.p[3] / info.p[0]
    beside = (
        f"{place}: by P, this is the second camera of a pair, {baseline_m:.4g} m beside the first; the frame of the "
        "images is taken as its own, not as that of the first camera"
    )
    return (used, *((beside,) if baseline_m else ()))
