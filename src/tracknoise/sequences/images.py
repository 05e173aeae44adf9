"""Image and depth files. A file that is not complete is refused.

A decoder accepts half a file: it leaves the missing part black and prints a warning at most. So every file is checked
to be complete before it is decoded, and every image to have the camera's size.
"""

import struct
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import DepthMap

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_JPEG_SIGNATURE = b"\xff\xd8\xff"
_JPEG_SCAN, _JPEG_END = b"\xff\xda", b"\xff\xd9"
_BMP_SIGNATURE = b"BM"
_BMP_HEADER = struct.Struct("<2sI4xIIiiHHII")
"""Signature, file size, start of the pixels, size of what follows, width, height, planes, bits, compression, bytes."""
_BMP_UNCOMPRESSED = {0, 3, 6}
_KINDS = "PNG, JPEG or BMP image"


def image_size(path: Path) -> tuple[int, int]:
    """(width, height) of an image file, px.

    Raises
    ------
    DataError
        If the file is missing, truncated or no image.
    """
    height, width = _decode(path, cv2.IMREAD_GRAYSCALE).shape
    return width, height


def read_gray(path: Path, camera: CameraModel) -> NDArray[np.uint8]:
    """Read a PNG, JPEG or BMP file in 8-bit grayscale, exactly as ``cv2.imread(path, cv2.IMREAD_GRAYSCALE)`` gives it.

    Parameters
    ----------
    path
        The file; of a JPEG in colour, the result is the luma plane.
    camera
        Whose size the image must have.

    Returns
    -------
    (height, width) uint8

    Raises
    ------
    DataError
        If the file is missing, truncated, no image, or of another size than the camera's.
    """
    image: NDArray[np.uint8] = _decode(path, cv2.IMREAD_GRAYSCALE)
    _require_size(path, image, camera)
    return image


def read_depth_npy(path: Path, camera: CameraModel, *, farthest_m: float = np.inf) -> DepthMap:
    """Read depth in metres from a NumPy file of float32 or float64.

    Parameters
    ----------
    path
        The file.
    camera
        Whose size the depth map must have.
    farthest_m
        Depth beyond this is invalid (sky), metres; so are zero, negative, infinite and NaN depths.

    Raises
    ------
    DataError
        If the file is missing, truncated, no NumPy array, or of another type or size.
    """
    try:
        with path.open("rb") as file:
            depth = np.lib.format.read_array(file, allow_pickle=False)
    except FileNotFoundError as error:
        raise DataError(path, "no such file", "a depth map") from error
    except (OSError, ValueError, EOFError) as error:
        raise DataError(path, "damaged or truncated file", "a NumPy array of float32 depth") from error
    if depth.dtype not in (np.float32, np.float64):
        raise DataError(path, f"{depth.dtype} numbers", "float32 or float64 depth in metres")
    return _depth_map(path, depth, camera, farthest_m)


def read_depth_png16(
    path: Path, camera: CameraModel, *, metres_per_unit: float, invalid: tuple[int, ...] = (0,)
) -> DepthMap:
    """Read depth from a PNG file of 16-bit integers.

    Parameters
    ----------
    path
        The file.
    camera
        Whose size the depth map must have.
    metres_per_unit
        Depth of the integer 1, metres.
    invalid
        Integers that mean no depth.

    Raises
    ------
    DataError
        If the file is missing, truncated, no 16-bit single-channel PNG, or of another size.
    """
    units = _decode(path, cv2.IMREAD_UNCHANGED)
    if units.ndim != 2 or units.dtype != np.uint16:
        raise DataError(path, _layout(units), "16-bit single-channel depth")
    depth = np.where(np.isin(units, invalid), 0.0, units * metres_per_unit)
    return _depth_map(path, depth, camera)


def read_depth_png_float32(path: Path, camera: CameraModel, *, farthest_m: float = np.inf) -> DepthMap:
    """Read depth in metres from an 8-bit PNG file whose four channels are the bytes of a little-endian float32.

    The first byte is the channel that OpenCV gives first (blue), as TartanAir v2 writes it.

    Parameters
    ----------
    path
        The file.
    camera
        Whose size the depth map must have.
    farthest_m
        Depth beyond this is invalid (sky), metres; so are zero, negative, infinite and NaN depths.

    Raises
    ------
    DataError
        If the file is missing, truncated, no 8-bit four-channel PNG, or of another size.
    """
    channels = _decode(path, cv2.IMREAD_UNCHANGED)
    if channels.dtype != np.uint8 or channels.ndim != 3 or channels.shape[2] != 4:
        raise DataError(path, _layout(channels), "8-bit four-channel depth")
    depth = np.ascontiguousarray(channels).view("<f4")[..., 0].astype(np.float32)
    return _depth_map(path, depth, camera, farthest_m)


def _decode(path: Path, flags: int) -> NDArray[Any]:
    """Decode a whole image file."""
    data = _whole_file(path)
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        image = None
    if image is None:
        raise DataError(path, "an image that cannot be decoded", f"a {_KINDS}")
    return image


def _whole_file(path: Path) -> bytes:
    """The bytes of an image file, after checking that nothing is missing at its end."""
    try:
        data = path.read_bytes()
    except FileNotFoundError as error:
        raise DataError(path, "no such file", "an image") from error
    except OSError as error:
        raise DataError(path, f"unreadable ({error.strerror})", "an image") from error
    if data.startswith(_PNG_SIGNATURE):
        whole = _is_whole_png(data)
    elif data.startswith(_JPEG_SIGNATURE):
        # Neither marker can occur in coded pixels, so the last scan is closed by a later end marker or cut off.
        whole = data.rfind(_JPEG_END) > data.rfind(_JPEG_SCAN)
    elif data.startswith(_BMP_SIGNATURE):
        whole = _is_whole_bmp(data)
    else:
        raise DataError(path, "no image" if data else "an empty file", f"a {_KINDS}")
    if not whole:
        raise DataError(path, f"truncated or damaged image of {len(data)} bytes", f"a whole {_KINDS}")
    return data


def _is_whole_png(data: bytes) -> bool:
    """Whether a chain of PNG chunks with correct checksums leads to the end chunk."""
    view, start = memoryview(data), len(_PNG_SIGNATURE)
    while start + 12 <= len(data):
        end = start + 8 + int.from_bytes(view[start : start + 4], "big")
        if end + 4 > len(data) or zlib.crc32(view[start + 4 : end]) != int.from_bytes(view[end : end + 4], "big"):
            return False
        if data[start + 4 : start + 8] == b"IEND":
            return True
        start = end + 4
    return False


def _is_whole_bmp(data: bytes) -> bool:
    """Whether a BMP file is as long as its header says; the file size that the header states is not reliable."""
    if len(data) < _BMP_HEADER.size:
        return False
    _, _, start, _, width, height, _, bits, compression, stated = _BMP_HEADER.unpack_from(data)
    row = (width * bits + 31) // 32 * 4
    pixels = row * abs(height) if compression in _BMP_UNCOMPRESSED else stated
    return bool(width > 0 and len(data) >= start + pixels)


def _depth_map(path: Path, depth: NDArray[np.floating], camera: CameraModel, farthest_m: float = np.inf) -> DepthMap:
    _require_size(path, depth, camera)
    return DepthMap(depth, np.isfinite(depth) & (depth > 0) & (depth <= farthest_m))


def _require_size(path: Path, array: NDArray[Any], camera: CameraModel) -> None:
    if array.shape != (camera.height, camera.width):
        found = "x".join(str(length) for length in array.shape[1::-1] + array.shape[2:])
        raise DataError(path, f"size {found}", f"the camera's {camera.width}x{camera.height}")


def _layout(array: NDArray[Any]) -> str:
    channels = array.shape[2] if array.ndim == 3 else 1
    return f"{array.dtype.itemsize * 8}-bit image of {channels} channel{'s' if channels > 1 else ''}"


def encode_png(image: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """Encode a grayscale image, (height, width) of 8 or 16 bits, as the bytes of a PNG file."""
    done, encoded = cv2.imencode(".png", image)
    assert done, "such an image can always be encoded"
    return encoded.tobytes()
