"""Writes MCAP files as other programs than ROS 2 do, from the messages of a bag. Knows nothing of the reader."""

import struct
from collections.abc import Iterable
from pathlib import Path

import lz4.frame
from backports import zstd
from rosbags.highlevel import AnyReader

MAGIC = b"\x89MCAP0\r\n"
COMPRESS = {"": bytes, "lz4": lz4.frame.compress, "zstd": zstd.compress}


def text(written: str) -> bytes:
    return struct.pack("<I", len(written.encode())) + written.encode()


def record(kind: int, body: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(body)) + body


def write_mcap(
    path: Path, bag: Path, *, compression: str | None, chunks: int = 2, profile: str = "", encoding: str | None = None
) -> None:
    """Messages go to the chunks in turn, so that the times of chunks overlap; without a compression there are none.

    There is no summary. The encoding is by default that of the bag.
    """
    with AnyReader([bag]) as reader:
        ros1 = bag.suffix == ".bag"
        coded = encoding or ("ros1" if ros1 else "cdr")
        names = {one.topic: one.msgtype.replace("/msg/", "/") if ros1 else one.msgtype for one in reader.connections}
        messages = [(one.topic, received_ns, bytes(data)) for one, received_ns, data in reader.messages()]
    numbers = {topic: number for number, topic in enumerate(names, start=1)}
    kinds = b"".join(
        record(3, struct.pack("<H", numbers[topic]) + text(name) + text("ros1msg" if ros1 else "ros2msg") + text(""))
        + record(4, struct.pack("<HH", numbers[topic], numbers[topic]) + text(topic) + text(coded) + text(""))
        for topic, name in names.items()
    )
    written = [
        (received_ns, record(5, struct.pack("<HIQQ", numbers[topic], index, received_ns, received_ns) + data))
        for index, (topic, received_ns, data) in enumerate(messages)
    ]
    if compression is None:
        data = kinds + b"".join(body for _, body in written)
    else:
        data = kinds + b"".join(_chunk(kinds, written[first::chunks], compression) for first in range(chunks))
    end = record(15, bytes(4)) + record(2, bytes(20)) + MAGIC
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(MAGIC + record(1, text(profile) + text("recorder 1.0")) + data + end)


def _chunk(kinds: bytes, messages: Iterable[tuple[int, bytes]], compression: str) -> bytes:
    times, bodies = zip(*messages, strict=True)
    content = kinds + b"".join(bodies)
    packed = COMPRESS[compression](content)
    head = struct.pack("<QQQI", min(times), max(times), len(content), 0) + text(compression)
    return record(6, head + struct.pack("<Q", len(packed)) + packed)
