"""One bag: its topics, and its messages in order or one at a time.

Messages are decoded with the definitions of the standard messages that come with the library. Those that are stored in
a bag are not used, so that nothing which a file defines is executed, and bags without definitions can be read.
"""

import os
import threading
import weakref
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tracknoise.foreign.parsing import damage_reported
from tracknoise.sequences.rosbag.compressed import plain_files, plain_message
from tracknoise.sequences.rosbag.layout import ROS1_SUFFIX, bag_size
from tracknoise.sequences.rosbag.mcap import ROS1, ROS2, McapConnection, McapReader, is_of_other_program

TRANSFORMS = "tf2_msgs/msg/TFMessage"
_OLD_TRANSFORMS = "tf/msg/tfMessage"
_OPEN_BAGS = 4


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
        File or folder of the bag.

    Raises
    ------
    DataError
        If it is missing or damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
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
        """All messages of a topic, in the order in which they were received.

        Raises
        ------
        DataError
            If one is damaged.
        """
        yield from self._between(topic, None, None)

    def message(self, topic: str, position: Position) -> Any:
        """One message. Several threads can call this.

        Raises
        ------
        DataError
            If it is damaged or missing.
        """
        with self._lock, _damage(f"{self.path} {topic}"):
            found = self._between(topic, position.received_ns, position.received_ns + 1)
            return next(message for at, message in found if at == position)

    def _between(self, topic: str, start_ns: int | None, stop_ns: int | None) -> Iterator[tuple[Position, Any]]:
        kind, previous = self.topics[topic].kind, Position(-1, 0)
        with _damage(f"{self.path} {topic}"):
            connections = [one for one in self._reader.connections if one.topic == topic]
            for one, received_ns, data in self._reader.messages(connections, start=start_ns, stop=stop_ns):
                nth = previous.nth + 1 if received_ns == previous.received_ns else 0
                previous = Position(received_ns, nth)
                encoding = one.encoding if isinstance(one, McapConnection) else self._encoding
                content = plain_message(data) if encoding == ROS2 else data
                yield previous, _decoder(encoding)(content, kind)


@dataclass(frozen=True, slots=True)
class BagFile:
    """A bag that is opened when it is first needed, once in each process. It can be sent to another process.

    Parameters
    ----------
    path
        File or folder of the bag.
    changed_ns
        When the file or folder was last changed, nanoseconds.
    """

    path: Path
    changed_ns: int

    @classmethod
    def at(cls, path: Path) -> "BagFile":
        """The bag as it is now."""
        return cls(path, path.stat().st_mtime_ns)

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
def _decoder(encoding: str) -> Any:
    """What decodes the bytes of a message, given its type."""
    if encoding not in (ROS1, ROS2):
        raise ValueError(f"messages encoded as {encoding!r}, neither as {ROS1!r} nor as {ROS2!r}")
    if encoding == ROS2:
        return get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
    return store.deserialize_ros1


def _kind(kind: str | None) -> str:
    return TRANSFORMS if kind == _OLD_TRANSFORMS else kind or ""


def _damage(place: str | Path) -> AbstractContextManager[None]:
    return damage_reported(place, "a damaged or unsupported bag", "a bag that can be read", with_reason=True)
