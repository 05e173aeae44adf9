"""Files that somebody else wrote: bounds that hold before a file is read or decoded, and errors in one line.

Only regular files are read: no folders, pipes or devices.
"""

import errno
import json
import math
import os
import re
import stat
import struct
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET
from xml.parsers.expat import ErrorString

from tracknoise.exceptions import DataError, TracknoiseError, first_line
from tracknoise.opened_files import read_head_unnoted, read_noted

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


def read_head(path: Path, expected: str, count: int) -> bytes:
    """Read the first bytes of a regular file, which does not count as read: no number may depend on them.

    Raises
    ------
    DataError
        As `read_bytes`.
    """
    require_regular(path, expected)
    try:
        return read_head_unnoted(path, count)
    except OSError as error:
        raise DataError(path, f"unreadable ({error.strerror})", expected) from error


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
        reason = os.strerror(errno.EISDIR) if stat.S_ISDIR(status.st_mode) else "not a regular file"
        raise DataError(path, f"unreadable ({reason})", readable or expected)
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


def is_there(path: Path) -> bool:
    """Whether there is anything of this name: a file, a folder, or a link to nothing."""
    return os.path.lexists(path)


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


@contextmanager
def damage_reported(place: str | Path, found: str, expected: str, *, with_reason: bool = False) -> Iterator[None]:
    """Turn all exceptions of a parser into one that names the file.

    Parsers raise exceptions of many types for damaged files, and new versions raise others. Therefore the block must
    contain only the call of the parser. Lack of memory is no damage and passes.

    Parameters
    ----------
    place
        The file.
    found, expected
        For the error.
    with_reason
        Add the first line of what the parser said to `found`.

    Raises
    ------
    DataError
        If the block raised another exception.
    """
    try:
        yield
    except (TracknoiseError, MemoryError):
        raise
    except Exception as error:
        raise DataError(place, f"{found} ({first_line(error)})" if with_reason else found, expected) from error


def read_json_object(path: Path, expected: str) -> dict[str, Any]:
    """Read a JSON file whose top level is an object.

    Parameters
    ----------
    path
        The file.
    expected
        What it should hold, for the error of a file that is missing.

    Raises
    ------
    DataError
        If the file is missing, unreadable, or no JSON object; the message names the line. Also if it has a key twice in
        an object, with different values.
    """

    def with_each_key_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        last = dict(pairs)
        twice = next((key for key, value in pairs if value is not last[key] and value != last[key]), None)
        if twice is not None:
            raise DataError(path, f"{twice} twice, with different values", "each key once")
        return last

    try:
        entries = json.loads(read_text(path, expected), object_pairs_hook=with_each_key_once)
    except json.JSONDecodeError as error:
        raise DataError(f"{path}:{error.lineno}", f"no JSON ({error.msg})", "a JSON object") from error
    except (ValueError, RecursionError) as error:  # a number of thousands of digits, or thousands of brackets
        raise DataError(path, "unreadable file", "a JSON object") from error
    if not isinstance(entries, dict):
        raise DataError(path, "JSON, but no object", "a JSON object")
    return entries


def is_number(field: str) -> bool:
    """Whether a field is a decimal number. Python also accepts underscores between digits; here they are refused."""
    try:
        float(field)
    except ValueError:
        return False
    return "_" not in field and field.isascii()


def number_in(field: str) -> float:
    """The decimal number of a field, blanks around it aside; NaN where it is none."""
    return float(field) if is_number(field.strip(" \t\r\n")) else math.nan


Element = ET.Element
_MOST_LEVELS = 32


def read_xml(path: Path) -> Element:
    """Root element of an XML file.

    Raises
    ------
    DataError
        If the file is missing, malformed (the message names the line), nested too deep, or in an encoding that cannot
        be read.
    """
    content = read_bytes(path, "an XML file", most=MOST_TEXT_BYTES)
    try:
        root = ET.fromstring(content)
    except ET.ParseError as error:
        what = ErrorString(error.code)
        raise DataError(f"{path}:{error.position[0]}", f"malformed XML ({what})", "well-formed XML") from error
    except (LookupError, ValueError) as error:  # expat supports few encodings, and only single-byte ones of Python
        raise DataError(path, f"an encoding that cannot be read ({error})", "well-formed XML in UTF-8") from error
    level = [root]
    for _ in range(_MOST_LEVELS):
        level = [child for element in level for child in element]
    if level:
        raise DataError(path, f"elements nested more than {_MOST_LEVELS} deep", "fewer levels")
    return root


_DIGITS = re.compile(r"(\d+)")
_LONGEST_NUMBER = 19


def natural_order(names: Iterable[str]) -> list[str]:
    """Names in the order in which people number them: ``image2`` before ``image10``."""
    return sorted(names, key=lambda name: ([_part(part) for part in _DIGITS.split(name)], name))


def _part(text: str) -> tuple[int, int, str]:
    """A number or a text, in a form in which both can be compared."""
    return (0, int(text), "") if text.isascii() and text.isdigit() and len(text) < _LONGEST_NUMBER else (1, 0, text)


KINDS = "PNG, JPEG or BMP image"
MOST_PIXELS = 1 << 26
"""Largest image, px: 8192x8192."""
_MOST_DECODED = 1 << 32
"""Most pixels that the scans of a progressive JPEG may go through, all together."""

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_PNG_SIZE = struct.Struct(">4x4sII")
_JPEG_SIGNATURE = b"\xff\xd8\xff"
_JPEG_SCAN, _JPEG_END = b"\xff\xda", b"\xff\xd9"
_JPEG_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
_JPEG_ALONE = {0x01, *range(0xD0, 0xD9)}
_BMP_SIGNATURE = b"BM"
_BMP_HEADER = struct.Struct("<2sI4xIIiiHHII")
"""Signature, file size, start of the pixels, size of what follows, width, height, planes, bits, compression, bytes."""
_BMP_UNCOMPRESSED = {0, 3, 6}


@dataclass(frozen=True, slots=True)
class _Header:
    width: int
    height: int
    scans: int = 1


def require_whole_image(path: str | Path, data: bytes) -> None:
    """Check that an image file is complete and that its image is not too large, without decoding it.

    Parameters
    ----------
    path
        The file, or another origin, for the error.
    data
        Its content.

    Raises
    ------
    DataError
        If it is no PNG, JPEG or BMP file, is truncated, or has more than `MOST_PIXELS` pixels.
    """
    if not data.startswith((_PNG_SIGNATURE, _JPEG_SIGNATURE, _BMP_SIGNATURE)):
        raise DataError(path, "no image" if data else "an empty file", f"a {KINDS}")
    header = _header(data)
    if header is None:
        raise DataError(path, f"truncated or damaged image of {len(data)} bytes", f"a whole {KINDS}")
    pixels = header.width * header.height
    if pixels > MOST_PIXELS:
        raise DataError(path, f"an image of {header.width}x{header.height}", f"at most {MOST_PIXELS} pixels")
    if pixels * header.scans > _MOST_DECODED:
        found = f"{header.scans} scans of {header.width}x{header.height}"
        raise DataError(path, found, f"at most {_MOST_DECODED // pixels} scans of this size")


def _header(data: bytes) -> _Header | None:
    """What the header says; None if the file is not complete."""
    if data.startswith(_PNG_SIGNATURE):
        return _png(data)
    return _jpeg(data) if data.startswith(_JPEG_SIGNATURE) else _bmp(data)


def _png(data: bytes) -> _Header | None:
    if len(data) < len(_PNG_SIGNATURE) + _PNG_SIZE.size or not _has_whole_chunks(data):
        return None
    kind, width, height = _PNG_SIZE.unpack_from(data, len(_PNG_SIGNATURE))
    return _Header(width, height) if kind == b"IHDR" else None


def _has_whole_chunks(data: bytes) -> bool:
    """Whether a chain of PNG chunks with correct checksums leads to the end chunk."""
    view, start = memoryview(data), len(_PNG_SIGNATURE)
    while start + 12 <= len(data):
        end = start + 8 + int.from_bytes(view[start : start + 4], "big")
        if end + 4 > len(data) or zlib.crc32(view[start + 4 : end]) != int.from_bytes(view[end : end + 4], "big"):
            return False
        if data[start + 4 : start + 8] == b"IEND":
            return True
        start = end + 4
    return False


def _jpeg(data: bytes) -> _Header | None:
    """Size from the frame header.

    Neither marker can occur in coded pixels, so the last scan is closed by a later end marker or cut off.
    """
    if data.rfind(_JPEG_END) <= data.rfind(_JPEG_SCAN):
        return None
    start = 2
    while start + 9 <= len(data) and data[start] == 0xFF:
        marker = data[start + 1]
        if marker in _JPEG_FRAMES:
            height, width = struct.unpack_from(">HH", data, start + 5)
            return _Header(width, height, data.count(_JPEG_SCAN))
        filler = marker == 0xFF
        start += 1 if filler else 2 if marker in _JPEG_ALONE else 2 + int.from_bytes(data[start + 2 : start + 4], "big")
    return None


def _bmp(data: bytes) -> _Header | None:
    """Size of a BMP file that is as long as its header says; the file size that the header states is not reliable."""
    if len(data) < _BMP_HEADER.size:
        return None
    _, _, start, _, width, height, _, bits, compression, stated = _BMP_HEADER.unpack_from(data)
    row = (width * bits + 31) // 32 * 4
    pixels = row * abs(height) if compression in _BMP_UNCOMPRESSED else stated
    return _Header(width, abs(height)) if width > 0 and len(data) >= start + pixels else None
