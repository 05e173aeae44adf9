"""Images and depth maps in messages."""

import struct
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.image_header import MOST_PIXELS
from tracknoise.geometry.depth import DepthMap
from tracknoise.printable import counted
from tracknoise.sequences.images import NO_DEPTH, Levels, decode_image, scaled

_TO_GRAY = {
    "rgb8": cv2.COLOR_RGB2GRAY,
    "bgr8": cv2.COLOR_BGR2GRAY,
    "8uc3": cv2.COLOR_BGR2GRAY,
    "rgba8": cv2.COLOR_RGBA2GRAY,
    "bgra8": cv2.COLOR_BGRA2GRAY,
    "8uc4": cv2.COLOR_BGRA2GRAY,
    "bayer_rggb8": cv2.COLOR_BayerRGGB2GRAY,
    "bayer_bggr8": cv2.COLOR_BayerBGGR2GRAY,
    "bayer_gbrg8": cv2.COLOR_BayerGBRG2GRAY,
    "bayer_grbg8": cv2.COLOR_BayerGRBG2GRAY,
}
_CHANNELS = {"rgb8": 3, "bgr8": 3, "8uc3": 3, "rgba8": 4, "bgra8": 4, "8uc4": 4}
_GRAY = ("mono8", "8uc1")
_GRAY16 = ("mono16", "16uc1")
_LUMA = {"yuv422": 1, "uyvy": 1, "yuv422_yuy2": 0, "yuyv": 0}
"""Encodings with two bytes for each pixel, and which of them is the brightness."""
_DEPTH32 = "32fc1"
_KNOWN = "mono8, mono16, rgb8, bgr8, rgba8, bgra8, bayer_*8 or yuv422"
_COMPRESSED_DEPTH = struct.Struct("<iff")
"""Header of a compressed depth map: a format, and the quantisation of inverse depth."""


def gray_image(place: str, message: Any, levels: Levels | None) -> NDArray[np.uint8]:
    """The image of an Image or CompressedImage message in 8-bit grayscale.

    Parameters
    ----------
    place
        Bag and topic, for errors.
    message
        The message.
    levels
        16-bit values that become 0 and 255; None if the images have 8 bits.

    Returns
    -------
    (height, width) uint8

    Raises
    ------
    DataError
        If it is damaged, has an unknown encoding, or has 16 bits and there are no levels.
    """
    if hasattr(message, "format"):
        return _compressed_gray(place, message, levels)
    encoding = message.encoding.lower()
    if encoding in _GRAY16:
        return _scaled(place, _pixels16(place, message), levels)
    pixels = _raw(place, message, _bytes_per_pixel(place, encoding))
    if encoding in _TO_GRAY:
        gray: NDArray[np.uint8] = cv2.cvtColor(np.ascontiguousarray(pixels), _TO_GRAY[encoding]).astype(np.uint8)
        return gray
    return np.ascontiguousarray(pixels[..., _LUMA[encoding]] if encoding in _LUMA else pixels)


def depth_map(place: str, message: Any, metres_per_unit: float) -> DepthMap:
    """The depth map of an Image message (16UC1 or 32FC1), or of a CompressedImage message in PNG.

    Parameters
    ----------
    place
        Bag and topic, for errors.
    message
        The message.
    metres_per_unit
        Depth of the integer 1, metres; floating-point depths are in metres.

    Raises
    ------
    DataError
        If it is damaged or has another encoding.
    """
    depth_m = _depths(place, message, metres_per_unit)
    return DepthMap(depth_m, np.isfinite(depth_m) & (depth_m > 0.0))


def _depths(place: str, message: Any, metres_per_unit: float) -> NDArray[np.floating]:
    """(height, width) float: metres, not positive or not finite where there is none."""
    if hasattr(message, "format"):
        return _compressed_depth(place, message, metres_per_unit)
    encoding = message.encoding.lower()
    if encoding in _GRAY16:
        return _metres(_pixels16(place, message), metres_per_unit)
    if encoding != _DEPTH32:
        raise DataError(place, f"depth with the encoding {message.encoding!r}", "16UC1 or 32FC1")
    order = ">" if message.is_bigendian else "<"
    return _raw(place, message, 4).view(f"{order}f4").reshape(message.height, message.width).astype(np.float32)


def _metres(units: NDArray[np.uint16], metres_per_unit: float) -> NDArray[np.float64]:
    return np.where(np.isin(units, NO_DEPTH), 0.0, units * metres_per_unit)


def _raw(place: str, message: Any, bytes_per_pixel: int) -> NDArray[np.uint8]:
    """(height, width) or (height, width, bytes) uint8: rows without their padding."""
    height, width, step = message.height, message.width, message.step
    if not 0 < height * width <= MOST_PIXELS:
        raise DataError(place, f"an image of {width}x{height}", f"1 to {MOST_PIXELS} pixels")
    if step < width * bytes_per_pixel or len(message.data) < height * step:
        found = f"{counted(len(message.data), 'byte')} in rows of {step} for an image of {width}x{height}"
        raise DataError(
            place, found, f"{counted(height, 'row')} of at least {counted(width * bytes_per_pixel, 'byte')}"
        )
    rows = np.asarray(message.data, np.uint8)[: height * step].reshape(height, step)
    pixels = np.ascontiguousarray(rows[:, : width * bytes_per_pixel])
    return pixels if bytes_per_pixel == 1 else pixels.reshape(height, width, bytes_per_pixel)


def _bytes_per_pixel(place: str, encoding: str) -> int:
    if encoding not in (*_GRAY, *_TO_GRAY, *_LUMA):
        raise DataError(place, f"an image with the encoding {encoding!r}", _KNOWN)
    return 2 if encoding in _LUMA else _CHANNELS.get(encoding, 1)


def _pixels16(place: str, message: Any) -> NDArray[np.uint16]:
    order = ">" if message.is_bigendian else "<"
    pixels = _raw(place, message, 2).view(f"{order}u2").reshape(message.height, message.width)
    return pixels.astype(np.uint16)


def _scaled(place: str, pixels: NDArray[np.uint16], levels: Levels | None) -> NDArray[np.uint8]:
    """16-bit values between two levels as 0 to 255."""
    if levels is None:
        raise DataError(place, "16-bit images and no image_levels", "image_levels = [darkest, brightest]")
    return scaled(pixels, levels)


def _compressed_gray(place: str, message: Any, levels: Levels | None) -> NDArray[np.uint8]:
    """What the content of the file says about its bits counts: not every driver states them in the format."""
    pixels = decode_image(place, bytes(message.data), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH)
    return pixels if pixels.dtype == np.uint8 else _scaled(place, pixels, levels)


def _compressed_depth(place: str, message: Any, metres_per_unit: float) -> NDArray[np.floating]:
    """Depth in a PNG image, after a header if the transport was ``compressedDepth``."""
    written, data = message.format.lower(), bytes(message.data)
    with_header = "compresseddepth" in written
    if "rvl" in written:
        raise DataError(place, f"depth in the format {message.format!r}", "compressedDepth in PNG")
    units = decode_image(place, data[_COMPRESSED_DEPTH.size :] if with_header else data, cv2.IMREAD_UNCHANGED)
    if units.dtype != np.uint16 or units.ndim != 2:
        raise DataError(place, "a compressed depth map that is not a 16-bit image", "16-bit single-channel depth")
    if not (with_header and written.startswith(_DEPTH32)):
        return _metres(units, metres_per_unit)
    _, scale, offset = _COMPRESSED_DEPTH.unpack_from(data)
    with np.errstate(all="ignore"):
        return np.where(units > 0, scale / (units.astype(np.float64) - offset), 0.0)
