"""Depth in NumPy files. Their sizes are read from headers first, so that a small file cannot become a huge array."""

from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_bytes
from tracknoise.foreign.parsing import damage_reported
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.printable import counted
from tracknoise.sequences.images import depth_map, enlarged_map, require_size

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
    header = _header(path)
    if header.dtype not in _METRES:
        raise DataError(path, f"{header.dtype} numbers", "float32 or float64 depth in metres")
    require_size(path, header.shape, camera)
    return depth_map(path, _array(path, header), camera, farthest_m)


def read_enlarged_depth_npy(path: Path, camera: CameraModel, *, metres_per_unit: float) -> DepthMap:
    """Read depth from a NumPy file of numbers of any type, (height, width) or (height, width, 1).

    A smaller map of the same proportions is enlarged: see `tracknoise.sequences.images.enlarged_map`.

    Parameters
    ----------
    path
        The file.
    camera
        Of the images.
    metres_per_unit
        Depth of the number 1, metres.

    Raises
    ------
    DataError
        If the file is missing, truncated, no NumPy array, or of another type, size or other proportions.
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
    """(width, height) of the array of a NumPy file, from its header.

    Raises
    ------
    DataError
        If the file is missing, no NumPy array, or has fewer than two dimensions.
    """
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
