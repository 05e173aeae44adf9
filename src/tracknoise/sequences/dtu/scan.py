"""The scan of a scene."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.printable import counted_of
from tracknoise.sequences.dtu.layout import KEY_POSITION, POSITIONS
from tracknoise.sequences.dtu.matlab import numbers, read_mat
from tracknoise.sequences.sequence import Scan

_PARTS = ("pts3D_near", "pts3D_far")


def read_scan(path: Path) -> tuple[Scan, tuple[str, ...]]:
    """Read ``pts3D_near`` and ``pts3D_far``: each column is a point, its first three rows are x, y, z in metres.

    Returns
    -------
    scan
        Of both together; its key frame is the index of position 25.
    notes
        A sentence if points with NaN or infinity are ignored.

    Raises
    ------
    DataError
        If the file is missing or damaged, one of the two arrays is missing or malformed, or no point is finite.
    """
    variables = read_mat(path, list(_PARTS))
    with np.errstate(invalid="ignore"):  # a signalling NaN becomes a quiet one
        points = np.concatenate([_points(path, name, numbers(path, variables, name)) for name in _PARTS])
    finite = np.isfinite(points).all(axis=1)
    if not finite.any():
        raise DataError(path, "a scan without points", f"columns of x, y, z in {' and '.join(_PARTS)}")
    broken = len(points) - int(np.count_nonzero(finite))
    said = ("is not finite and is ignored", "are not finite and are ignored")
    ignored = counted_of(broken, len(points), "scan point", *said)
    notes = (f"{path.name}: {ignored}",) if broken else ()
    return Scan(points[finite], POSITIONS.index(KEY_POSITION)), notes


def _points(path: Path, name: str, columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) float64."""
    if not columns.size:
        return np.empty((0, 3))
    if columns.ndim != 2 or columns.shape[0] < 3:
        found = f"{name} of shape {'x'.join(map(str, columns.shape))}"
        raise DataError(path, found, "a column a point, with at least the rows x, y, z")
    return np.ascontiguousarray(columns[:3].T)
