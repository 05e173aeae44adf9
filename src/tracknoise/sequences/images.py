"""Image and depth files, and depth in NumPy files. A file that is not complete is refused.

A decoder accepts half a file: it leaves the missing part black and prints a warning at most. So every file is checked
to be complete before it is decoded, and every image to have the camera's size. Sizes are read from headers first, so
that a small file cannot become a huge array.
"""

from collections.abc import Iterable
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import require
from tracknoise.exceptions import DataError
from tracknoise.foreign_files import KINDS, damage_reported, read_bytes, require_whole_image
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.depth import LEAST_DEPTH_M, DepthMap, enlarged
from tracknoise.text import counted

Levels = tuple[float, float]
"""Values of a 16-bit image that become 0 and 255."""

_MOST_LEVEL = 65535
ALL_LEVELS: Levels = (0.0, _MOST_LEVEL)
NO_DEPTH = (0, _MOST_LEVEL)
"""16-bit integers that are no depth: nothing was measured, or more than can be written."""


def image_size(path: Path) -> tuple[int, int]:
    """(width, height) of an image file, px, as `read_gray` reads it.

    Raises
    ------
    DataError
        If the file is missing, truncated or no image.
    """
    height, width = _decode(path, cv2.IMREAD_GRAYSCALE).shape
    return width, height


def first_readable(paths: Iterable[Path]) -> Path:
    """The first image file that can be read, or the first of all if none can: damage matters in frames that are used.

    `paths`: at least one.
    """
    first, *rest = paths
    return next((path for path in (first, *rest) if is_readable(path)), first)


def read_gray(path: Path, camera: CameraModel, *, levels: Levels | None = None) -> NDArray[np.uint8]:
    """Read a PNG, JPEG or BMP file in 8-bit grayscale, as ``cv2.imread`` gives it with ``cv2.IMREAD_GRAYSCALE``.

    Unlike there, rows are those of the file (`tracknoise.sequences.orientation`), and an image of 16 bits is not
    divided by 256, since most such images use a part of the range: see `scaled`.

    Parameters
    ----------
    path
        The file; of a JPEG in colour, the result is the luma plane.
    camera
        Whose size the image must have.
    levels
        Values of an image of 16 bits that become 0 and 255; without them, it is refused.

    Returns
    -------
    (height, width) uint8

    Raises
    ------
    DataError
        If the file is missing, truncated, no image, of another size than the camera's, or of 16 bits without levels.
    """
    image = _decode(path, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH)
    require_size(path, image.shape, camera)
    if image.dtype == np.uint8:
        return image
    if levels is None:
        raise DeepImageError(path, f"a {_layout(image)}", "8 bits, or image_levels = [low, high] of folder or euroc")
    return scaled(image, levels)


class DeepImageError(DataError):
    """An image has 16 bits, and no levels are stated."""


def likely_levels(images: Iterable[NDArray[np.uint8]]) -> tuple[int, int]:
    """Levels of a sensor of 10, 12, 14 or 16 bits, by images that were read with `ALL_LEVELS`: the fewest bits."""
    largest = max(int(image.max()) for image in images)
    bits = next((bits for bits in (10, 12, 14) if largest <= round(255.0 * (2**bits - 1) / _MOST_LEVEL)), 16)
    return 0, 2**bits - 1


def level_notes(levels: Levels | None) -> tuple[str, ...]:
    """How images of 16 bits are read."""
    if levels is None:
        return ()
    black, white = levels
    return (f"16-bit images are scaled: {black:g} becomes 0 and {white:g} becomes 255",)


def scaled(image: NDArray[np.uint16], levels: Levels) -> NDArray[np.uint8]:
    """Scale an image of 16 bits linearly to 8 bits, rounded; values outside of the levels are clipped."""
    black, white = levels
    grey = (image.astype(np.float64) - black) * (255.0 / (white - black))
    return np.clip(np.rint(grey), 0.0, 255.0).astype(np.uint8)


def require_levels(levels: Levels | None) -> None:
    """Raise ValueError unless the option `image_levels` is not given, or two values of 16 bits, the lower first."""
    if levels is not None:
        black, white = levels
        expected = f"[low, high] with 0 <= low < high <= {_MOST_LEVEL}"
        require(0 <= black < white <= _MOST_LEVEL, "image_levels", [*levels], expected)


def read_depth_png16(path: Path, camera: CameraModel, *, metres_per_unit: float) -> DepthMap:
    """Read depth from a PNG file of 16-bit integers. 0 and 65535, the largest that can be written, are no depth.

    `camera`: whose size the depth map must have; `metres_per_unit`: depth of the integer 1, metres.
    """
    return depth_map(path, _metres(path, metres_per_unit), camera)


def read_enlarged_depth_png16(path: Path, camera: CameraModel, *, metres_per_unit: float) -> DepthMap:
    """As `read_depth_png16`; a smaller map of the same proportions is `tracknoise.geometry.depth.enlarged`.

    Depth sensors of phones have fewer pixels than their cameras, and their maps show the same as the images.
    """
    return enlarged_map(path, _metres(path, metres_per_unit), camera)


def enlarged_map(path: Path, depth_m: NDArray[np.floating], camera: CameraModel) -> DepthMap:
    """The map (height, width) of a file.

    A smaller one of the same proportions is `tracknoise.geometry.depth.enlarged`.
    """
    height, width = depth_m.shape[:2]
    if width >= camera.width or width * camera.height != height * camera.width:
        return depth_map(path, depth_m, camera)
    small = DepthMap(depth_m, np.isfinite(depth_m) & (depth_m >= LEAST_DEPTH_M))
    return enlarged(small, camera)


def _metres(path: Path, metres_per_unit: float) -> NDArray[np.float64]:
    """(height, width) float64 of a 16-bit PNG file; 0 where there is no depth."""
    units = _decode(path, cv2.IMREAD_UNCHANGED)
    if units.ndim != 2 or units.dtype != np.uint16:
        raise DataError(path, _layout(units), "16-bit single-channel depth")
    with np.errstate(over="ignore", invalid="ignore"):
        return np.where(np.isin(units, NO_DEPTH), 0.0, units * metres_per_unit)


def read_depth_png_float32(path: Path, camera: CameraModel, *, farthest_m: float = np.inf) -> DepthMap:
    """Read depth in metres from an 8-bit PNG file whose four channels are the bytes of a little-endian float32.

    The first byte is the channel that OpenCV gives first (blue), as TartanAir v2 writes it. `farthest_m`: so are zero,
    negative, infinite and NaN depths.
    """
    channels = _decode(path, cv2.IMREAD_UNCHANGED)
    if channels.dtype != np.uint8 or channels.ndim != 3 or channels.shape[2] != 4:
        raise DataError(path, _layout(channels), "8-bit four-channel depth")
    depth = np.ascontiguousarray(channels).view("<f4")[..., 0].astype(np.float32)
    return depth_map(path, depth, camera, farthest_m)


def is_readable(path: Path) -> bool:
    """Whether a file holds an image that can be decoded."""
    try:
        image_size(path)
    except DataError:
        return False
    return True


def decode_image(place: str | Path, data: bytes, flags: int) -> NDArray[Any]:
    """Decode the content of a PNG, JPEG or BMP file that is complete, as stored: no orientation of EXIF is applied."""
    require_whole_image(place, data)
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error:
        image = None
    if image is None:
        raise DataError(place, "an image that cannot be decoded", f"a {KINDS}")
    return image


def _decode(path: Path, flags: int) -> NDArray[Any]:
    """Decode a whole image file."""
    return decode_image(path, read_bytes(path, "an image"), flags)


def depth_map(path: Path, depth: NDArray[np.floating], camera: CameraModel, farthest_m: float = np.inf) -> DepthMap:
    """The map (height, width), metres, of a file; depth below `LEAST_DEPTH_M` or beyond `farthest_m` is invalid."""
    require_size(path, depth.shape, camera)
    return DepthMap(depth, np.isfinite(depth) & (depth >= LEAST_DEPTH_M) & (depth <= farthest_m))


def require_size(path: Path, shape: tuple[int, ...], camera: CameraModel) -> None:
    """Raise DataError unless an array of this shape has the size of the camera's images."""
    if shape != (camera.height, camera.width):
        size = "x".join(str(length) for length in shape[1::-1] + shape[2:])
        raise DataError(path, f"size {size}", f"the camera's {camera.width}x{camera.height}")


def _layout(array: NDArray[Any]) -> str:
    channels = array.shape[2] if array.ndim == 3 else 1
    return f"{array.dtype.itemsize * 8}-bit image of {counted(channels, 'channel')}"


def content_hash(image: NDArray[np.uint8]) -> str | None:
    """Hexadecimal SHA-256 of the size and the pixels of an image; None for an empty one, or one of one gray value."""
    if image.size == 0 or image.min() == image.max():
        return None
    return sha256(str(image.shape).encode() + image.tobytes()).hexdigest()


def reduced(image: NDArray[np.uint8], widest_px: int) -> NDArray[np.uint8]:
    """A grayscale image, (height, width) of 8 bits, that is at most so wide, of the same aspect ratio."""
    height, width = image.shape
    if width <= widest_px:
        return image
    size = widest_px, max(1, round(height * widest_px / width))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def encode_webp(image: NDArray[np.uint8], *, quality: int) -> bytes:
    """Encode a grayscale image, (height, width) of 8 bits, as the bytes of a WebP file; quality is from 1 to 100."""
    done, encoded = cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, quality])
    assert done, "such an image can always be encoded"
    return encoded.tobytes()


def encode_jpeg(image: NDArray[np.uint8], *, quality: int) -> bytes:
    """Encode a grayscale image, (height, width) of 8 bits, as the bytes of a JPEG file; quality is from 1 to 100."""
    done, encoded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    assert done, "such an image can always be encoded"
    return encoded.tobytes()


def encode_png(image: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """Encode a grayscale image, (height, width) of 8 or 16 bits, as the bytes of a PNG file."""
    done, encoded = cv2.imencode(".png", image)
    assert done, "such an image can always be encoded"
    return encoded.tobytes()


_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
_DAMAGED, _EXPECTED = "damaged or truncated file", "a NumPy array of float32 depth"
_METRES = (np.float32, np.float64)
_NUMBERS = "fiu"
"""Kinds of numbers that may be depths in units."""


class _Header(NamedTuple):
    """Header of a NumPy file, and the rest of the file."""

    shape: tuple[int, ...]
    by_columns: bool
    dtype: np.dtype[Any]
    rest: BytesIO


def read_depth_npy(path: Path, camera: CameraModel, *, farthest_m: float = np.inf) -> DepthMap:
    """Read depth in metres from a NumPy file of float32 or float64.

    `farthest_m`: so are zero, negative, infinite and NaN depths.
    """
    header = _header(path)
    if header.dtype not in _METRES:
        raise DataError(path, f"{header.dtype} numbers", "float32 or float64 depth in metres")
    require_size(path, header.shape, camera)
    return depth_map(path, _array(path, header), camera, farthest_m)


def read_enlarged_depth_npy(path: Path, camera: CameraModel, *, metres_per_unit: float) -> DepthMap:
    """Read depth from a NumPy file of numbers of any type, (height, width) or (height, width, 1).

    A smaller map of the same proportions is enlarged: see `tracknoise.sequences.images.enlarged_map`. Units:
    metres_per_unit in m.
    """
    header = _header(path)
    if header.dtype.kind not in _NUMBERS:
        raise DataError(path, f"{header.dtype} values", "depth in numbers")
    height, width, *channels = header.shape if len(header.shape) > 1 else (0, 0)
    if channels not in ([], [1]) or not (0 < height <= camera.height and 0 < width <= camera.width):
        require_size(path, header.shape, camera)
    depth = _array(path, header).reshape(height, width)
    plain = depth if depth.dtype in _METRES else depth.astype(np.float64)
    return enlarged_map(path, plain * metres_per_unit, camera)


def numpy_size(path: Path) -> tuple[int, int]:
    """(width, height) of the array of a NumPy file, from its header."""
    shape = _header(path).shape
    if len(shape) < 2:
        raise DataError(path, f"an array of {counted(len(shape), 'dimension')}", _EXPECTED)
    return shape[1], shape[0]


def _header(path: Path) -> _Header:
    file = BytesIO(read_bytes(path, "a depth map"))
    with damage_reported(path, _DAMAGED, _EXPECTED):
        shape, by_columns, dtype = _HEADERS[np.lib.format.read_magic(file)](file)
        if dtype.hasobject:
            raise ValueError("Python objects")
    return _Header(shape, by_columns, dtype, file)


def _array(path: Path, header: _Header) -> NDArray[Any]:
    """The numbers of a file whose size has been checked."""
    data = header.rest.read(int(np.prod(header.shape)) * header.dtype.itemsize)
    with damage_reported(path, _DAMAGED, _EXPECTED):
        return np.frombuffer(data, header.dtype).reshape(header.shape, order="F" if header.by_columns else "C")
