"""Numbers in MATLAB files."""

import math
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.child import LostError, call_in_child
from tracknoise.foreign.files import require_regular
from tracknoise.printable import counted

Variable = NDArray[np.generic] | None
"""None for what is no array of real numbers."""

_EXPECTED = "a MATLAB file"
_MAX_BYTES, _MAX_ARRAY_BYTES = 1 << 31, 1 << 29
"""Of a file, and of an array: more than ten times the largest scan of the data set."""
_NUMERIC = {"double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}
_REMARK = b"MATLAB 5.0 MAT-file".ljust(116)


def read_mat(path: Path, names: list[str]) -> dict[str, Variable]:
    """Read those variables of a MATLAB file (version 4 to 7.2) that it has. Those that are not asked for are skipped.

    SciPy reads it in the child process, which it ends at some damaged files. Of objects, function handles, cells and
    structures only the headers are read.

    Raises
    ------
    DataError
        If the file is missing, damaged, or of version 7.3.
    """
    size = require_regular(path, _EXPECTED, most=_MAX_BYTES)
    try:
        return call_in_child(_read, path, names, size=size)
    except LostError as error:
        found = f"a damaged file, or not a MATLAB file ({error})"
        raise DataError(path, found, "a MATLAB file of version 4 to 7.2") from error


def _read(path: Path, names: list[str]) -> dict[str, Variable]:
    from scipy.io import loadmat, whosmat

    try:
        held = [entry for entry in whosmat(str(path), appendmat=False) if entry[0] in names]
    except NotImplementedError as error:
        raise DataError(path, "a MATLAB 7.3 file", "an earlier version (in MATLAB: save with -v7)") from error
    found: dict[str, Variable] = {name: None for name, _, _ in held}
    numeric = found.keys() - {name for name, _, kind in held if kind not in _NUMERIC}
    for name, shape, _ in held:
        if name in numeric and not 0 <= 8 * math.prod(shape) <= _MAX_ARRAY_BYTES:
            raise ValueError(f"{name} is too large")
    read = loadmat(str(path), appendmat=False, variable_names=sorted(numeric)) if numeric else {}
    for name in numeric:
        value = read[name]
        if not isinstance(value, np.ndarray):
            raise ValueError(f"{name} is damaged")
        found[name] = value if value.dtype.kind in "fiu" else None
    return found


def numbers(
    path: Path, variables: Mapping[str, Variable], name: str, *, count: int | None = None
) -> NDArray[np.float64]:
    """One variable as float64, with the shape that it has in MATLAB.

    Parameters
    ----------
    path
        Of the file, for errors.
    variables
        From `read_mat`.
    name
        Which one.
    count
        How many finite numbers it must have; None for any count and any numbers.

    Raises
    ------
    DataError
        If it is missing, or something else.
    """
    expected = "numbers" if count is None else counted(count, "finite number")
    if name not in variables:
        raise DataError(path, f"no {name}", f"{name}: {expected}")
    array = variables[name]
    if array is None:
        raise DataError(path, f"{name} that is not an array of real numbers", f"{name}: {expected}")
    if count is not None and array.size != count:
        raise DataError(path, f"{name} of {counted(array.size, 'number')}", expected)
    if count is not None and not np.isfinite(array).all():
        raise DataError(path, f"NaN or infinity in {name}", expected)
    return array.astype(np.float64)


def write_mat(path: Path, variables: Mapping[str, ArrayLike]) -> None:
    """Write a MATLAB file (version 5) that is the same whenever it is written: without the date.

    Parameters
    ----------
    path
        File to write.
    variables
        Arrays or numbers by name.
    """
    from scipy.io import savemat

    buffer = BytesIO()
    savemat(buffer, dict(variables))  # type: ignore[arg-type]  # the stubs know paths only
    path.write_bytes(_REMARK + buffer.getvalue()[len(_REMARK) :])
