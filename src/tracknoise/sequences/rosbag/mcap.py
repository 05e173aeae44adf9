"""Files in MCAP that were not written by ROS 2: converted bags of ROS 1, and recordings of other programs.

The library's reader takes files with the profile ``ros2`` only, whose messages are all of ROS 2. The package `mcap`
(1.6) reads files without a summary from their beginning for every message (47 ms instead of 1 ms in 60 MB), does not
compare what a chunk becomes with the size that it states, and brings a second library for zstd.
"""

import os
import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from rosbags.rosbag2.storage_mcap import decompress

from tracknoise.printable import counted

_MAGIC = b"\x89MCAP0\r\n"
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
        if file.read(len(_MAGIC)) != _MAGIC:
            return False
        file.seek(_RECORD.size, os.SEEK_CUR)
        return file.read(len(_PROFILE)) != _PROFILE


class McapReader:
    """Reads a file with the methods of the readers of `rosbags`.

    Parameters
    ----------
    path
        The file.
    """

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
        """Go through the file once, to find its channels and chunks.

        Raises
        ------
        ValueError
            If it is damaged.
        """
        self._file = self.path.open("rb")
        if self._file.read(len(_MAGIC)) != _MAGIC:
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

        Parameters
        ----------
        connections
            Channels that are read.
        start, stop
            First time, and the time before which messages are read; None for no limit.
        """
        first, end = start or 0, _LONGEST_NS if stop is None else stop
        wanted = {number: channel for number, channel in self._channels.items() if channel in connections}
        waiting: list[tuple[int, McapConnection, bytes]] = []
        for chunk in (chunk for chunk in self._chunks if chunk.start_ns < end and chunk.end_ns >= first):
            waiting.sort(key=lambda message: message[0])
            ready = sum(received_ns < chunk.start_ns for received_ns, _, _ in waiting)
            yield from ((channel, received_ns, data) for received_ns, channel, data in waiting[:ready])
            waiting = [*waiting[ready:], *(one for one in self._messages_of(chunk, wanted) if first <= one[0] < end)]
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
        known = self.topics.setdefault(channel.topic, McapTopic(channel.msgtype))
        if known.msgtype != channel.msgtype:
            known.msgtype = None


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
