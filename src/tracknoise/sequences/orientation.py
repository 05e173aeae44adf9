"""Orientations that image files state in EXIF data. Images are used as stored, and files that state another are named.

Cameras, poses and depths of recordings are those of the stored rows: programs that estimate them do not turn images.
"""

import struct
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from tracknoise.exceptions import DataError
from tracknoise.foreign_files import read_head
from tracknoise.text import counted_of

UPRIGHT = 1
"""Orientation of an image whose rows are stored from top to bottom, or that states none."""
_MEANINGS = {
    2: "mirrored",
    3: "turned by 180 degrees",
    4: "mirrored and turned by 180 degrees",
    5: "mirrored and turned by 90 degrees counter-clockwise",
    6: "turned by 90 degrees clockwise",
    7: "mirrored and turned by 90 degrees clockwise",
    8: "turned by 90 degrees counter-clockwise",
}
_MOST_READ = 100
"""Of more files, so many are read, spread evenly."""
EXIF_BYTES = 1 << 16
"""EXIF data lie in so many bytes from the beginning of a file."""
_PNG, _JPEG, _EXIF = b"\x89PNG\r\n\x1a\n", b"\xff\xd8", b"Exif\0\0"
_APP1, _SCAN = 0xE1, 0xDA
_TAG, _ENTRY_BYTES = 0x0112, 12


def orientation_of(data: bytes) -> int:
    """Orientation, 1 to 8, that the beginning of a JPEG or PNG file states; `UPRIGHT` where it states none."""
    try:
        tiff = _of_jpeg(data) if data.startswith(_JPEG) else _of_png(data) if data.startswith(_PNG) else None
        orientation = UPRIGHT if tiff is None else _in_tiff(tiff)
    except struct.error:  # it ends within its EXIF data
        return UPRIGHT
    return orientation if orientation in _MEANINGS else UPRIGHT


def orientation_notes(paths: Iterable[Path]) -> tuple[str, ...]:
    """A sentence if image files state that they were taken turned. Files that cannot be read are left to their use."""
    all_paths = tuple(paths)
    read = all_paths[:: -(-len(all_paths) // _MOST_READ)] if all_paths else ()
    turned = [(path, orientation) for path in read if (orientation := _of_file(path)) != UPRIGHT]
    return turned_notes(turned[0][0], [orientation for _, orientation in turned], len(read)) if turned else ()


def turned_notes(place: str | Path, turned: Iterable[int], n_read: int) -> tuple[str, ...]:
    """A sentence on the orientations of the images that state one; `n_read`: how many were looked at."""
    counts = Counter(turned)
    if not counts:
        return ()
    most = ", ".join(f"{number}, {_MEANINGS[number]}" for number, _ in counts.most_common())
    state = counted_of(counts.total(), n_read, "image", "states", "state")
    return (f"{place}: {state} an EXIF orientation ({most}), which is not applied: images are used as stored",)


def _of_file(path: Path) -> int:
    try:
        return orientation_of(read_head(path, "an image", EXIF_BYTES)) if path.is_file() else UPRIGHT
    except DataError:
        return UPRIGHT


def _of_jpeg(data: bytes) -> bytes | None:
    """The EXIF data of a JPEG file, from their TIFF header on."""
    start = len(_JPEG)
    while start + 4 <= len(data) and data[start] == 0xFF and data[start + 1] != _SCAN:
        (length,) = struct.unpack_from(">H", data, start + 2)
        content = data[start + 4 : start + 2 + length]
        if data[start + 1] == _APP1 and content.startswith(_EXIF):
            return content[len(_EXIF) :]
        start += 2 + length
    return None


def _of_png(data: bytes) -> bytes | None:
    """The EXIF data of a PNG file, from their TIFF header on."""
    start = len(_PNG)
    while start + 8 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, start)
        if kind == b"eXIf":
            return data[start + 8 : start + 8 + length].removeprefix(_EXIF)
        start += 12 + length
    return None


def _in_tiff(tiff: bytes) -> int:
    """The orientation in the first directory of a TIFF header."""
    order = "<" if tiff.startswith(b"II") else ">"
    (first,) = struct.unpack_from(f"{order}I", tiff, 4)
    (count,) = struct.unpack_from(f"{order}H", tiff, first)
    for entry in range(first + 2, first + 2 + count * _ENTRY_BYTES, _ENTRY_BYTES):
        tag, _, _, value = struct.unpack_from(f"{order}HHIH", tiff, entry)
        if tag == _TAG:
            return int(value)
    return UPRIGHT
