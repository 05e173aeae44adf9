"""Numbers in MATLAB files."""

import stat
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.io import savemat

from tracknoise.exceptions import DataError
from tracknoise.printable import counted
from tracknoise.sequences.dtu.mat_file import (
    MatFileError,
    UnsupportedMatFileError,
    Variable,
    parse_mat,
)

_MAX_BYTES = 1 << 31
_REMARK = b"MATLAB 5.0 MAT-file".ljust(116)


def read_mat(path: Path, names: list[str]) -> dict[str, Variable]:
    """Read those variables of a MATLAB file (version 4 to 7.2) that it has.

    Raises
    ------
    DataError
        If the file is missing, damaged, or of version 7.3.
    """
    try:
        return parse_mat(_content(path), names)
    except FileNotFoundError as error:
        raise DataError(path, "no such file", "a MATLAB file") from error
    except OSError as error:
        raise DataError(path, f"unreadable ({error.strerror})", "a MATLAB file") from error
    except UnsupportedMatFileError as error:
        raise DataError(path, "a MATLAB 7.3 file", "an earlier version (in MATLAB: save with -v7)") from error
    except MatFileError as error:
        found = f"a damaged file, or not a MATLAB file ({error})"
        raise DataError(path, found, "a MATLAB file of version 4 to 7.2") from error


def _content(path: Path) -> bytes:
    status = path.stat()
    if stat.S_ISFIFO(status.st_mode) or stat.S_ISCHR(status.st_mode) or status.st_size > _MAX_BYTES:
        raise DataError(path, "not a regular file of at most 2 GiB", "a MATLAB file")
    return path.read_bytes()


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
    value = variables.get(name)
    expected = "numbers" if count is None else counted(count, "finite number")
    if value is None:
        raise DataError(path, f"no {name}", f"{name}: {expected}")
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
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
    buffer = BytesIO()
    savemat(buffer, dict(variables))  # type: ignore[arg-type]  # the stubs know paths only
    path.write_bytes(_REMARK + buffer.getvalue()[len(_REMARK) :])
