"""Text files with one row of numbers per observation."""

from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, one_line
from tracknoise.foreign.files import MIB, require_regular
from tracknoise.printable import counted

_MOST_BYTES = 4096 * MIB
_LONGEST_LINE = 1 << 16
_LARGEST_WHOLE = 2.0**62


def read_numbers(path: Path, separator: str | None, names: tuple[str, ...]) -> tuple[NDArray[np.float64], list[int]]:
    """The first numbers of each line, without empty lines and comments that start with ``#``.

    Parameters
    ----------
    path
        The file.
    separator
        Between numbers; None for white space.
    names
        Of the columns that are read, for errors.

    Returns
    -------
    rows : (n, columns) float64
        Finite.
    lines : (n,)
        The line of each row.

    Raises
    ------
    DataError
        If the file is missing or too large, has no row, or a line has too few columns or something that is no finite
        number. The error names the line.
    """
    require_regular(path, "a file of tracks", most=_MOST_BYTES)
    values, lines = array("d"), []
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            for line, text in _lines(path, file):
                values.extend(_numbers(f"{path}:{line}", text.split(separator, len(names)), names))
                lines.append(line)
    except OSError as error:
        raise DataError(path, f"unreadable ({error.strerror})", "a file of tracks") from error
    if not lines:
        raise DataError(path, "no track", "at least one row")
    return np.array(values).reshape(-1, len(names)), lines


def whole_numbers(path: Path, lines: list[int], values: NDArray[np.float64], name: str) -> NDArray[np.int64]:
    """A column of whole numbers.

    Raises
    ------
    DataError
        Naming the line of the first number that is none.
    """
    bad = np.flatnonzero((values != np.rint(values)) | (np.abs(values) > _LARGEST_WHOLE))
    if len(bad):
        raise DataError(f"{path}:{lines[bad[0]]}", f"{name} {float(values[bad[0]])!r}", "a whole number")
    whole: NDArray[np.int64] = values.astype(np.int64)
    return whole


def _lines(path: Path, file: TextIO) -> Iterator[tuple[int, str]]:
    """Lines that are neither empty nor comments, with their numbers. A long line is not read as a whole at first."""
    number = 0
    while text := file.readline(_LONGEST_LINE):
        number += 1
        if len(text) == _LONGEST_LINE:
            raise DataError(f"{path}:{number}", f"a line of {_LONGEST_LINE} characters or more", "a shorter line")
        text = text.strip()
        if text and not text.startswith("#"):
            yield number, text


def _numbers(place: str, cells: list[str], names: tuple[str, ...]) -> list[float]:
    if len(cells) < len(names):
        raise DataError(place, counted(len(cells), "column"), f"at least {len(names)}: {', '.join(names)}")
    return [_number(place, cell, name) for cell, name in zip(cells, names, strict=False)]


def _number(place: str, cell: str, name: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise DataError(place, f"{name} {one_line(cell)!r}", "a finite number")
    return value
