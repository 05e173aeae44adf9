"""Sizes of images from the headers of their files, so that a small file cannot become a huge image."""

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

from tracknoise.exceptions import DataError

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
