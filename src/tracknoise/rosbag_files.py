"""Files of bags of ROS 1 and ROS 2: where they lie, their compression, and their messages in order or one at a time.

The bags below a folder are ROS 1 files, folders of ROS 2 bags, and single files of ROS 2. Bags of ROS 2 may be
compressed with zstd: whole files, or each message. What they become is limited in size.

Files in MCAP that were not written by ROS 2 are converted bags of ROS 1, and recordings of other programs. The
library's reader takes files with the profile ``ros2`` only, whose messages are all of ROS 2. The package `mcap` (1.6)
reads files without a summary from their beginning for every message (47 ms instead of 1 ms in 60 MB), does not compare
what a chunk becomes with the size that it states, and brings a second library for zstd.

A bag has topics, and its messages in order or one at a time. Messages are decoded with the definitions of the standard
messages that come with the library. Those that are stored in a bag are not used, so that nothing which a file defines
is executed, and bags without definitions can be read.
"""

import glob
import os
import re
import struct
import sys
import threading
import weakref
from collections.abc import Collection, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.rosbag2.storage_mcap import decompress
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tracknoise.exceptions import DataError
from tracknoise.foreign_files import MIB, damage_reported, is_folder, is_regular_file, require_regular
from tracknoise.guarded_folder import guarded_folder
from tracknoise.text import counted

ROS1_SUFFIX = ".bag"
COMPRESSED_SUFFIX = ".zstd"
"""Of files of ROS 2 that are compressed as a whole, after their own."""
_PLAIN_SUFFIXES = (".db3", ".mcap")
_ROS2_SUFFIXES = (*_PLAIN_SUFFIXES, *(suffix + COMPRESSED_SUFFIX for suffix in _PLAIN_SUFFIXES))
_SUFFIXES = (ROS1_SUFFIX, *_ROS2_SUFFIXES)
METADATA = "metadata.yaml"
_BAG = "a ROS 1 bag (.bag) or a ROS 2 bag (.db3, .mcap, these with .zstd, or a folder with metadata.yaml)"
_MOST_BYTES, _MOST_METADATA_BYTES = 1 << 50, 64 * MIB


def find_bags(root: Path) -> dict[str, Path]:
    """Find all bags below a folder. Links are followed; each folder is visited once.

    Returns: file or folder of each bag by its path below the root, with ``/``, sorted; its own name if the root is the
    bag.
    """
    if (is_regular_file(root) and root.name.endswith(_SUFFIXES)) or _is_ros2_folder(root):
        return {root.resolve().name: root}
    bags: dict[str, Path] = {}
    visited: set[str] = set()
    if not is_folder(root):
        raise DataError(
            root, "not a directory" if is_regular_file(root) else "no such directory", "a data set's folder"
        )
    for name, below, files in os.walk(root, followlinks=True):
        real, folder = os.path.realpath(name), Path(name)
        bags_here = [] if real in visited else _bags_in(folder, files)
        bags |= {path.relative_to(root).as_posix(): path for path in bags_here}
        if real in visited or bags_here == [folder]:
            below.clear()
        visited.add(real)
    if not bags:
        raise DataError(root, "no bag", _BAG)
    return dict(sorted(bags.items()))


def bag_size(path: Path) -> int:
    """Size of all files of a bag, bytes."""
    if not is_folder(path):
        return require_regular(path, _BAG, most=_MOST_BYTES)
    files = (file for file in path.iterdir() if file.name.endswith(_ROS2_SUFFIXES))
    metadata = require_regular(path / METADATA, "the metadata of a ROS 2 bag", most=_MOST_METADATA_BYTES)
    return metadata + sum(require_regular(file, _BAG, most=_MOST_BYTES) for file in files)


def _bags_in(folder: Path, files: list[str]) -> list[Path]:
    if METADATA in files and _is_ros2_folder(folder):
        return [folder]
    return [folder / name for name in files if name.endswith(_SUFFIXES) and not name.startswith(".")]


def _is_ros2_folder(folder: Path) -> bool:
    """Whether a folder holds metadata of a ROS 2 bag, and not a file of that name from something else."""
    path = folder / METADATA
    if not is_regular_file(path):
        return False
    with path.open("rb") as file:
        return b"rosbag2_bagfile_information" in file.read(4096)


if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

_COMPRESSED_MAGIC = b"\x28\xb5\x2f\xfd"
"""Begin of what zstd writes. A message that is not compressed begins with a zero."""
_MOST_MESSAGE_BYTES = 1024 * MIB
_MOST_RATIO, _MOST_SLACK = 100, 256 * MIB
"""A file may become this many times larger, and by this many bytes more. Images become 1.5 to 20 times larger."""
_BLOCK = MIB
_MODE = re.compile(r"^(\s*compression_mode:).*$", re.MULTILINE)
_NAMES = re.compile(rf"(\.(?:db3|mcap)){re.escape(COMPRESSED_SUFFIX)}\b")


def plain_message(data: bytes) -> bytes:
    """The content of a message of ROS 2, which may be compressed."""
    if not data.startswith(_COMPRESSED_MAGIC):
        return data
    decompressor = zstd.ZstdDecompressor()
    content: bytes = decompressor.decompress(data, max_length=_MOST_MESSAGE_BYTES)
    if not decompressor.eof:
        raise ValueError(f"a compressed message that is cut off, or becomes larger than {_MOST_MESSAGE_BYTES} bytes")
    return content


@contextmanager
def plain_files(path: Path) -> Iterator[Path]:
    """A bag whose files are not compressed: the bag itself, or a copy in a temporary folder."""
    if path.suffix != COMPRESSED_SUFFIX and not _has_compressed_files(path):
        yield path
        return
    with guarded_folder("tracknoise-bag-") as temporary:
        yield _copied_folder(path, temporary.path) if is_folder(path) else _copied_file(path, temporary.path)


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


_MCAP_MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 3, 4, 5, 6
_DATA_END, _FOOTER = 15, 2
_PROFILE = struct.pack("<I", 4) + b"ros2"
ROS1, ROS2 = "ros1", "cdr"
"""Encodings of messages."""
_RECORD = struct.Struct("<BQ")
_CHUNK_START = struct.Struct("<QQQI")
_MESSAGE_START = struct.Struct("<HIQQ")
_TWO_NUMBERS = struct.Struct("<HH")
_LONGEST_NS = 2**63 - 1


class McapConnection(NamedTuple):
    """A channel.

    Attributes
    ----------
    topic
        Its name.
    msgtype
        Type of its messages as in ROS 2, such as ``sensor_msgs/msg/Image``.
    encoding
        How they are encoded: ``cdr`` or ``ros1``, or in a way that cannot be read.
    """

    topic: str
    msgtype: str
    encoding: str


@dataclass(slots=True)
class McapTopic:
    """Type of the messages of a topic, None if they have several, and their number."""

    msgtype: str | None
    msgcount: int = 0


class _Chunk(NamedTuple):
    """Where a chunk starts in the file, and the times of its messages; of messages without a chunk, all times."""

    at: int
    start_ns: int
    end_ns: int


def is_of_other_program(path: Path) -> bool:
    """Whether a file is in MCAP and states another profile than that of ROS 2, or none."""
    with path.open("rb") as file:
        if file.read(len(_MCAP_MAGIC)) != _MCAP_MAGIC:
            return False
        file.seek(_RECORD.size, os.SEEK_CUR)
        return file.read(len(_PROFILE)) != _PROFILE


class McapReader:
    """Reads a file with the methods of the readers of `rosbags`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[str, McapTopic] = {}
        self._file: BinaryIO
        self._types: dict[int, str] = {}
        self._channels: dict[int, McapConnection] = {}
        self._chunks: list[_Chunk] = []

    @property
    def connections(self) -> list[McapConnection]:
        """All channels."""
        return list(self._channels.values())

    def open(self) -> None:
        """Go through the file once, to find its channels and chunks."""
        self._file = self.path.open("rb")
        if self._file.read(len(_MCAP_MAGIC)) != _MCAP_MAGIC:
            raise ValueError("the file does not begin as MCAP does")
        for at, kind, body in _records(self._file):
            if kind == _CHUNK:
                start_ns, end_ns, _, _ = _CHUNK_START.unpack_from(body)
                self._chunks.append(_Chunk(at, start_ns, end_ns))
                for _, inner, record in _records(BytesIO(_content(body))):
                    self._register(inner, record)
            else:
                self._register(kind, body)
                if kind == _MESSAGE:
                    received_ns = _MESSAGE_START.unpack_from(body)[2]
                    self._chunks.append(_Chunk(at, received_ns, received_ns))
        self._chunks.sort(key=lambda chunk: chunk.start_ns)

    def close(self) -> None:
        """Close the file."""
        if hasattr(self, "_file"):
            self._file.close()

    def messages(
        self, connections: Collection[McapConnection], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[McapConnection, int, bytes]]:
        """Channel, time of receipt in nanoseconds and content of messages, in the order of these times.

        `start, stop`: None for no limit.
        """
        first, end = start or 0, _LONGEST_NS if stop is None else stop
        wanted = {number: channel for number, channel in self._channels.items() if channel in connections}
        waiting: list[tuple[int, McapConnection, bytes]] = []
        for chunk in (chunk for chunk in self._chunks if chunk.start_ns < end and chunk.end_ns >= first):
            waiting.sort(key=lambda message: message[0])
            ready = sum(received_ns < chunk.start_ns for received_ns, _, _ in waiting)
            yield from ((channel, received_ns, data) for received_ns, channel, data in waiting[:ready])
            waiting = [*waiting[ready:], *(new for new in self._messages_of(chunk, wanted) if first <= new[0] < end)]
        waiting.sort(key=lambda message: message[0])
        yield from ((channel, received_ns, data) for received_ns, channel, data in waiting)

    def _messages_of(
        self, chunk: _Chunk, wanted: dict[int, McapConnection]
    ) -> Iterator[tuple[int, McapConnection, bytes]]:
        self._file.seek(chunk.at)
        _, kind, body = next(_records(self._file))
        inner = [(0, kind, body)] if kind == _MESSAGE else _records(BytesIO(_content(body)))
        for _, kind_inside, record in inner:
            if kind_inside == _MESSAGE:
                number, _, received_ns, _ = _MESSAGE_START.unpack_from(record)
                if number in wanted:
                    yield received_ns, wanted[number], record[_MESSAGE_START.size :]

    def _register(self, kind: int, body: bytes) -> None:
        """Remember a type or a channel, or count a message."""
        if kind == _SCHEMA:
            self._types[int.from_bytes(body[:2], "little")] = _ros2_name(_text(body, 2)[0])
        elif kind == _CHANNEL:
            number, schema = _TWO_NUMBERS.unpack_from(body)
            topic, after = _text(body, _TWO_NUMBERS.size)
            self._add(number, McapConnection(topic, self._types.get(schema, ""), _text(body, after)[0]))
        elif kind == _MESSAGE:
            number = _MESSAGE_START.unpack_from(body)[0]
            self.topics[self._channels[number].topic].msgcount += 1

    def _add(self, number: int, channel: McapConnection) -> None:
        self._channels[number] = channel
        topic = self.topics.setdefault(channel.topic, McapTopic(channel.msgtype))
        if topic.msgtype != channel.msgtype:
            topic.msgtype = None


def _records(file: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
    """Place, kind and content of each record up to the end of the data."""
    start = file.tell()
    length = file.seek(0, os.SEEK_END)
    file.seek(start)
    while head := file.read(_RECORD.size):
        at = file.tell() - len(head)
        kind, size = _RECORD.unpack(head)
        if kind in (_DATA_END, _FOOTER):
            return
        if size > length - file.tell():
            raise ValueError(f"a record of {counted(size, 'byte')} at {at}, where {length - file.tell()} are left")
        yield at, kind, file.read(size)


def _content(chunk: bytes) -> bytes:
    """The records of a chunk."""
    _, _, size, checksum = _CHUNK_START.unpack_from(chunk)
    compression, after = _text(chunk, _CHUNK_START.size)
    content: bytes = decompress(chunk[after + 8 :], compression, size, checksum)
    return content


def _text(body: bytes, at: int) -> tuple[str, int]:
    """A text that begins with its length, and where it ends."""
    (length,) = struct.unpack_from("<I", body, at)
    return body[at + 4 : at + 4 + length].decode(), at + 4 + length


def _ros2_name(written: str) -> str:
    """Types of ROS 1 have no ``msg`` between package and name."""
    return written if written.count("/") != 1 else written.replace("/", "/msg/")


TRANSFORMS = "tf2_msgs/msg/TFMessage"
_OLD_TRANSFORMS = "tf/msg/tfMessage"
_OPEN_BAGS = 4
NO_DEFINITIONS: Mapping[str, str] = {}


class Position(NamedTuple):
    """Where a message of a topic is.

    Attributes
    ----------
    received_ns
        When it was received, nanoseconds.
    nth
        Its index among the messages of the topic that were received in the same nanosecond.
    """

    received_ns: int
    nth: int


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic.

    Parameters
    ----------
    name
        Its name.
    kind
        Type of its messages as in ROS 2, such as ``sensor_msgs/msg/Image``; "" if they have several types.
    count
        How many messages it has.
    """

    name: str
    kind: str
    count: int


class Bag:
    """An open bag. Damage is reported with the bag's name, and with the topic where it is known.

    Parameters
    ----------
    path
        File or folder.
    definitions
        Of messages that are not standard: text as in their ``.msg`` file, by type.
    """

    def __init__(self, path: Path, definitions: Mapping[str, str] = NO_DEFINITIONS) -> None:
        self.path = path
        self._definitions = tuple(definitions.items())
        bag_size(path)
        with _damage(path), ExitStack() as opened:
            self._reader: Any = _opened_reader(opened.enter_context(plain_files(path)), opened)
            weakref.finalize(self, opened.pop_all().close)
        with _damage(path):
            topics = self._reader.topics.items()
            listed = [Topic(name, _kind(info.msgtype), info.msgcount) for name, info in topics]
        self.topics = {topic.name: topic for topic in listed}
        self._encoding = ROS1 if path.suffix == ROS1_SUFFIX else ROS2
        self._lock = threading.Lock()

    def messages(self, topic: str) -> Iterator[tuple[Position, Any]]:
        """All messages of a topic, in the order in which they were received."""
        yield from self._between(topic, None, None)

    def message(self, topic: str, position: Position) -> Any:
        """One message. Several threads can call this."""
        with self._lock, _damage(f"{self.path} {topic}"):
            messages = self._between(topic, position.received_ns, position.received_ns + 1)
            return next(message for at, message in messages if at == position)

    def _between(self, topic: str, start_ns: int | None, stop_ns: int | None) -> Iterator[tuple[Position, Any]]:
        kind, previous = self.topics[topic].kind, Position(-1, 0)
        with _damage(f"{self.path} {topic}"):
            connections = [connection for connection in self._reader.connections if connection.topic == topic]
            for connection, received_ns, data in self._reader.messages(connections, start=start_ns, stop=stop_ns):
                nth = previous.nth + 1 if received_ns == previous.received_ns else 0
                previous = Position(received_ns, nth)
                encoding = connection.encoding if isinstance(connection, McapConnection) else self._encoding
                content = plain_message(data) if encoding == ROS2 else data
                yield previous, _decoder(encoding, self._definitions)(content, kind)


@dataclass(frozen=True, slots=True)
class BagFile:
    """A bag that is opened when it is first needed, once in each process. It can be sent to another process.

    Parameters
    ----------
    path
        File or folder of the bag.
    version
        Name, size and time of the last change, nanoseconds, of each of its files.
    """

    path: Path
    version: tuple[tuple[str, int, int], ...]

    @classmethod
    def at(cls, path: Path) -> "BagFile":
        """The bag as it is now."""
        files = path.iterdir() if is_folder(path) else path.parent.glob(f"{glob.escape(path.name)}*")
        states = [(file.name, file.stat()) for file in sorted(files) if is_regular_file(file)]
        return cls(path, tuple((name, state.st_size, state.st_mtime_ns) for name, state in states))

    def message(self, topic: str, position: Position) -> Any:
        """One message: see `Bag.message`."""
        return _opened(self, os.getpid()).message(topic, position)


@lru_cache(maxsize=_OPEN_BAGS)
def _opened(file: BagFile, process: int) -> Bag:
    """The open bag. A process that was forked opens its own, because a file has one reading position."""
    return Bag(file.path)


def _opened_reader(path: Path, opened: ExitStack) -> Ros1Reader | Ros2Reader | McapReader:
    """The reader of a bag, which `opened` closes. It leaves messages as they are: `plain_message` limits their size."""
    reader = _reader(path)
    reader.open()
    opened.callback(reader.close)
    if isinstance(reader, Ros2Reader) and reader.compression_mode == "message":
        reader.storage.metadata = reader.storage.metadata._replace(compression_mode=None)
    return reader


def _reader(path: Path) -> Ros1Reader | Ros2Reader | McapReader:
    if path.suffix == ROS1_SUFFIX:
        return Ros1Reader(path)
    return McapReader(path) if path.is_file() and is_of_other_program(path) else Ros2Reader(path)


@lru_cache
def _decoder(encoding: str, definitions: tuple[tuple[str, str], ...]) -> Any:
    """What decodes the bytes of a message, given its type."""
    if encoding not in (ROS1, ROS2):
        raise ValueError(f"messages encoded as {encoding!r}, neither as {ROS1!r} nor as {ROS2!r}")
    store = get_typestore(Stores.ROS2_HUMBLE if encoding == ROS2 else Stores.ROS1_NOETIC)
    for kind, text in definitions:
        store.register(get_types_from_msg(text, kind))
    if encoding == ROS2:
        return store.deserialize_cdr
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
    return store.deserialize_ros1


def _kind(kind: str | None) -> str:
    return TRANSFORMS if kind == _OLD_TRANSFORMS else kind or ""


def _damage(place: str | Path) -> AbstractContextManager[None]:
    return damage_reported(place, "a damaged or unsupported bag", "a bag that can be read", with_reason=True)
