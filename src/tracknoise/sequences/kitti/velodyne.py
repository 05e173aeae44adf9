"""Velodyne scans: float32 x, y, z (metres, forward, left, up) and reflectance of each point."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import MIB, read_bytes
from tracknoise.printable import counted

SCAN_SUFFIX = ".bin"
_POINT_BYTES = 16
_MOST_BYTES = 64 * MIB  # a turn of the scanner has about 2 MiB


def read_scan(path: Path) -> NDArray[np.float64]:
    """Read the points of a scan.

    Returns
    -------
    (n, 3) float64
        Metres, the Velodyne's frame.

    Raises
    ------
    DataError
        If the file is missing, empty or truncated, or has points that are not numbers.
    """
    data = read_bytes(path, "a Velodyne scan", most=_MOST_BYTES)
    if not data or len(data) % _POINT_BYTES:
        raise DataError(
            path, counted(len(data), "byte"), f"a multiple of {_POINT_BYTES} (float32 x y z reflectance), not 0"
        )
    points = np.frombuffer(data, "<f4").reshape(-1, 4)[:, :3]
    if not np.isfinite(points).all():
        raise DataError(path, "NaN or infinity among the points", "finite x y z")
    return points.astype(np.float64)


def write_scan(path: Path, points: NDArray[np.float64]) -> None:
    """Write the points of a scan, (n, 3) float64, metres; their reflectance is 0."""
    path.write_bytes(np.pad(points, ((0, 0), (0, 1))).astype("<f4").tobytes())
