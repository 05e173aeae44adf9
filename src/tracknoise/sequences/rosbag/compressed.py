"""Bags of ROS 2 that are compressed with zstd: whole files, or each message. What they become is limited in size."""

import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tracknoise.foreign.files import MIB, is_folder, is_regular_file
from tracknoise.sequences.rosbag.layout import COMPRESSED_SUFFIX, METADATA

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

_MAGIC = b"\x28\xb5\x2f\xfd"
"""Begin of what zstd writes. A message that is not compressed begins with a zero."""
_MOST_MESSAGE_BYTES = 1024 * MIB
_MOST_RATIO, _MOST_SLACK = 100, 256 * MIB
"""A file may become this many times larger, and by this many bytes more. Images become 1.5 to 20 times larger."""
_BLOCK = MIB
_MODE = re.compile(r"^(\s*compression_mode:).*$", re.MULTILINE)
_NAMES = re.compile(rf"(\.(?:db3|mcap)){re.escape(COMPRESSED_SUFFIX)}\b")


def plain_message(data: bytes) -> bytes:
    """The content of a message of ROS 2, which may be compressed.

    Raises
    ------
    ValueError
        If it is damaged, or becomes larger than 1 GiB.
    """
    if not data.startswith(_MAGIC):
        return data
    decompressor = zstd.ZstdDecompressor()
    content: bytes = decompressor.decompress(data, max_length=_MOST_MESSAGE_BYTES)
    if not decompressor.eof:
        raise ValueError(f"a compressed message that is cut off, or becomes larger than {_MOST_MESSAGE_BYTES} bytes")
    return content


@contextmanager
def plain_files(path: Path) -> Iterator[Path]:
    """A bag whose files are not compressed: the bag itself, or a copy in a temporary folder.

    Parameters
    ----------
    path
        A file, or a folder with metadata.

    Raises
    ------
    ValueError, OSError
        If a file is damaged, becomes too large, or cannot be written.
    """
    if path.suffix != COMPRESSED_SUFFIX and not _has_compressed_files(path):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="tracknoise-bag-") as temporary:
        yield _copied_folder(path, Path(temporary)) if is_folder(path) else _copied_file(path, Path(temporary))


def _has_compressed_files(path: Path) -> bool:
    metadata = path / METADATA
    if not is_regular_file(metadata):
        return False
    mode = _MODE.search(metadata.read_text(encoding="utf-8"))
    return mode is not None and "file" in mode[0].partition(":")[2].lower()


def _copied_folder(path: Path, to: Path) -> Path:
    """Metadata and files, as if they had never been compressed."""
    text = (path / METADATA).read_text(encoding="utf-8")
    (to / METADATA).write_text(_MODE.sub(r'\1 ""', _NAMES.sub(r"\1", text)), encoding="utf-8")
    for file in sorted(path.iterdir()):
        if file.suffix == COMPRESSED_SUFFIX:
            _copied_file(file, to)
    return to


def _copied_file(file: Path, to: Path) -> Path:
    plain = to / file.stem
    left = _MOST_RATIO * file.stat().st_size + _MOST_SLACK
    with zstd.open(file, "rb") as source, plain.open("wb") as target:
        while block := source.read(_BLOCK):
            left -= len(block)
            if left < 0:
                raise ValueError(f"{file.name} becomes more than {_MOST_RATIO} times larger")
            target.write(block)
    return plain
