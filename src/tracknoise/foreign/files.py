"""Contents of foreign files. Only regular files of bounded size are read: no folders, pipes or devices."""

import errno
import os
import stat
from pathlib import Path

from tracknoise.exceptions import DataError, first_line
from tracknoise.foreign.opened import read_noted

MIB = 1 << 20
MOST_BYTES = 512 * MIB
"""Largest binary file that is read as a whole, bytes."""
MOST_TEXT_BYTES = 64 * MIB
"""Largest text file, bytes."""


def read_bytes(path: Path, expected: str, *, most: int = MOST_BYTES, readable: str | None = None) -> bytes:
    """Read a regular file.

    Parameters
    ----------
    path
        The file.
    expected
        What it should be, for the error.
    most
        Largest size, bytes.
    readable
        As `expected`, for a file that is there and cannot be read.

    Raises
    ------
    DataError
        If it is missing, unreadable, larger, or not a regular file.
    """
    require_regular(path, expected, most=most, readable=readable)
    try:
        return read_noted(path)
    except OSError as error:
        raise DataError(path, f"unreadable ({error.strerror})", readable or expected) from error


def require_regular(path: Path, expected: str, *, most: int = MOST_BYTES, readable: str | None = None) -> int:
    """Check that a file is regular and not too large, without opening it: opening a pipe would wait for a writer.

    Returns
    -------
    int
        Its size, bytes.

    Raises
    ------
    DataError
        As `read_bytes`.
    """
    try:
        status = path.stat()
    except (FileNotFoundError, ValueError) as error:  # ValueError: a null character in its name
        raise DataError(path, "no such file", expected) from error
    except OSError as error:
        raise DataError(path, f"unreadable ({error.strerror})", readable or expected) from error
    if not stat.S_ISREG(status.st_mode):
        found = os.strerror(errno.EISDIR) if stat.S_ISDIR(status.st_mode) else "not a regular file"
        raise DataError(path, f"unreadable ({found})", readable or expected)
    if status.st_size > most:
        raise DataError(path, f"a file of {status.st_size} bytes", f"{expected} of at most {most} bytes")
    return status.st_size


def read_text(path: Path, expected: str, *, most: int = MOST_TEXT_BYTES) -> str:
    """Read a regular file of UTF-8 text, with or without a byte order mark.

    Raises
    ------
    DataError
        As `read_bytes`, and if it is not UTF-8.
    """
    readable = f"text of {expected}"
    try:
        return read_bytes(path, expected, most=most, readable=readable).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise DataError(path, f"not UTF-8 in line {line}", readable) from error


def read_any_text(path: Path, expected: str) -> str:
    """Read a regular file of text, with a replacement character for each byte that is not UTF-8.

    Raises
    ------
    DataError
        As `read_bytes`.
    """
    return read_bytes(path, expected, most=MOST_TEXT_BYTES).decode(errors="replace")


def is_regular_file(path: Path) -> bool:
    """Whether there is a regular file of this name; names that no file can have are allowed."""
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except (OSError, ValueError):
        return False


def is_folder(path: Path) -> bool:
    """Whether there is a folder of this name; names that no folder can have are allowed."""
    try:
        return stat.S_ISDIR(path.stat().st_mode)
    except (OSError, ValueError):
        return False


def absolute(folder: Path, path: Path) -> Path:
    """A path that starts from a folder, with all links resolved.

    Raises
    ------
    DataError
        If it contains a null character, is too long, or its links lead in a circle.
    """
    try:
        return (folder / path).resolve()
    except (OSError, ValueError, RuntimeError) as error:
        raise DataError(str(path), f"no usable path ({first_line(error)})", "the path of a file or folder") from error
