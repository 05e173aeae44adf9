"""Frames that are messages of a bag: their times, and what reads their images and depths."""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.association import nearest
from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.images import Levels
from tracknoise.sequences.rosbag.bag import BagFile, Position
from tracknoise.sequences.rosbag.links import Link
from tracknoise.sequences.rosbag.pictures import depth_map, gray_image
from tracknoise.sequences.rosbag.scan import Messages


class Clock(StrEnum):
    """Which time of a message counts: that in its header, or when it was received."""

    header = "header"
    received = "received"


@dataclass(frozen=True, slots=True)
class BagImages:
    """Reads the image of a frame from its message.

    Parameters
    ----------
    bag
        Where the messages are.
    topic
        Of the images.
    positions
        One message for each frame.
    levels
        16-bit values that become 0 and 255; None if the images have 8 bits.
    """

    bag: BagFile
    topic: str
    positions: tuple[Position, ...]
    levels: Levels | None

    def __len__(self) -> int:
        return len(self.positions)

    def __call__(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: see `tracknoise.sequences.rosbag.pictures.gray_image`."""
        message = self.bag.message(self.topic, self.positions[index])
        return gray_image(f"{self.bag.path} {self.topic}", message, self.levels)


@dataclass(frozen=True, slots=True)
class BagDepths:
    """Reads the depth of a frame from its message.

    Parameters
    ----------
    bag
        Where the messages are.
    topic
        Of the depth maps.
    positions
        One message for each frame, None for a frame without depth.
    metres_per_unit
        Depth of the integer 1, metres.
    radius_px
        None for dense depth; for sparse depth, the largest distance to the nearest pixel with depth, px.
    """

    bag: BagFile
    topic: str
    positions: tuple[Position | None, ...]
    metres_per_unit: float
    radius_px: float | None

    def __len__(self) -> int:
        return len(self.positions)

    def __call__(self, index: int) -> DepthMap | None:
        """Depth of one frame: see `tracknoise.sequences.rosbag.pictures.depth_map`."""
        position = self.positions[index]
        if position is None:
            return None
        message = self.bag.message(self.topic, position)
        depth = depth_map(f"{self.bag.path} {self.topic}", message, self.metres_per_unit)
        return replace(depth, radius_px=self.radius_px)


def times_ns(messages: Messages | Link, clock: Clock) -> NDArray[np.int64]:
    """(n,) int64, nanoseconds, of messages in the order of the bag."""
    return messages.stamped_ns if clock is Clock.header else messages.received_ns


def in_order(place: str, messages: Messages, clock: Clock) -> tuple[NDArray[np.int64], tuple[Position, ...]]:
    """Times and positions of messages, sorted by time. Of messages with the same time, the first counts.

    Parameters
    ----------
    place
        The bag, for the error.
    messages
        In the order of the bag.
    clock
        Which time counts.

    Returns
    -------
    times_ns : (k,) int64
        Nanoseconds, increasing.
    positions : tuple of k positions

    Raises
    ------
    DataError
        If the headers hold no times.
    """
    times = times_ns(messages, clock)
    if clock is Clock.header and not times.any():
        raise DataError(f"{place} {messages.topic}", "the time 0 in all headers", 'times, or time = "received"')
    ordered, first = np.unique(times, return_index=True)
    return ordered, tuple(messages.positions[index] for index in first.tolist())


def matching(
    times_s: NDArray[np.float64],
    others_s: NDArray[np.float64],
    positions: tuple[Position, ...],
    *,
    max_gap_s: float,
) -> tuple[Position | None, ...]:
    """The message nearest in time to each frame, None where it is farther than `max_gap_s`."""
    indices = nearest(times_s, others_s, max_gap_s=max_gap_s).tolist()
    return tuple(None if index < 0 else positions[index] for index in indices)
