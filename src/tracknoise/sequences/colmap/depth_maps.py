"""Dense depth maps of COLMAP: ``width&height&channels&`` in text, then float32 depths row by row."""

import re
from pathlib import Path

import numpy as np

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_bytes
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.printable import counted

_HEADER = re.compile(rb"(\d{1,9})&(\d{1,9})&(\d{1,9})&")
_EXPECTED = "a depth map of COLMAP"


def read_depth_map(path: Path, camera: CameraModel) -> DepthMap:
    """Read a depth map. Depths are in the unit of the reconstruction; those that are not positive are invalid.

    Parameters
    ----------
    path
        The file.
    camera
        Whose size the depth map must have.

    Raises
    ------
    DataError
        If the file is missing, damaged or of another size.
    """
    content = read_bytes(path, _EXPECTED)
    header = _HEADER.match(content)
    if header is None:
        raise DataError(path, "no header", f"{_EXPECTED}: width&height&channels&")
    width, height, channels = map(int, header.groups())
    if (width, height, channels) != (camera.width, camera.height, 1):
        expected = f"the camera's {camera.width}x{camera.height} and one channel"
        raise DataError(path, f"size {width}x{height} and {counted(channels, 'channel')}", expected)
    if len(content) - header.end() != 4 * width * height:
        raise DataError(path, f"{counted(len(content) - header.end(), 'byte')} of depths", f"{4 * width * height}")
    depth = np.frombuffer(content, "<f4", offset=header.end()).reshape(height, width).astype(np.float32)
    return DepthMap(depth, np.isfinite(depth) & (depth > 0.0))
