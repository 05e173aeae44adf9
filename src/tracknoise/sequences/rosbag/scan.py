"""One pass through a bag: when and where its images and depths are, its intrinsics and its transforms."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.child import LostError, call_in_child
from tracknoise.sequences.option_text import with_option
from tracknoise.sequences.rosbag.bag import TRANSFORMS, Bag, Position, Topic
from tracknoise.sequences.rosbag.calibration import CameraInfo, camera_info
from tracknoise.sequences.rosbag.layout import bag_size
from tracknoise.sequences.rosbag.links import Link, frame_name, pose_link, stamp_ns, transform_links
from tracknoise.sequences.rosbag.topics import Wanted, choose_topics


@dataclass(frozen=True, slots=True, eq=False)
class Messages:
    """Where the messages of a topic are, in the order of the bag.

    Parameters
    ----------
    topic
        Its name.
    frame
        The frame that the first message names.
    stamped_ns, received_ns
        (n,) int64, nanoseconds: in their headers, and when they were received.
    positions
        n positions in the bag.
    """

    topic: str
    frame: str
    stamped_ns: NDArray[np.int64]
    received_ns: NDArray[np.int64]
    positions: tuple[Position, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """What a bag holds of a camera.

    Parameters
    ----------
    images, depths
        Their messages; None where there is no depth.
    camera_info, camera_info_topic
        The intrinsics; None where they come from somewhere else.
    pose_topic
        Where the poses come from.
    pose
        The poses of the topic; None where they come from tf.
    transforms
        The transforms of all tf topics.
    """

    images: Messages
    depths: Messages | None
    camera_info: CameraInfo | None
    camera_info_topic: str
    pose_topic: str
    pose: Link | None
    transforms: tuple[Link, ...]


def scan_bag(path: Path, wanted: Wanted) -> Scan:
    """Go through a bag once, in a process of its own, because a damaged bag may take all memory.

    Parameters
    ----------
    path
        File or folder of the bag.
    wanted
        The topics that the user names.

    Raises
    ------
    DataError
        If the bag is damaged, or a topic is missing or cannot be chosen.
    """
    try:
        return call_in_child(_scan, path, wanted, size=bag_size(path))
    except LostError as error:
        raise DataError(path, f"a damaged bag ({error})", "a bag that can be read") from error


def _scan(path: Path, wanted: Wanted) -> Scan:
    bag = Bag(path)
    chosen = choose_topics(bag, wanted)
    info = None if chosen.camera_info is None else _intrinsics(bag, chosen.camera_info)
    images = _messages(bag, chosen.image)
    depths = None if chosen.depth is None else _messages(bag, chosen.depth)
    if info is not None and depths is not None and chosen.depth_info is not None and depths.frame != images.frame:
        _require_aligned(f"{path} {depths.topic}", info, _intrinsics(bag, chosen.depth_info), images.frame)
    pose = None if chosen.pose.kind == TRANSFORMS else pose_link(bag, chosen.pose)
    moving = [link for topic in chosen.transforms for link in transform_links(bag, topic, moving=True)]
    static = [link for topic in chosen.static_transforms for link in transform_links(bag, topic, moving=False)]
    return Scan(
        images=images,
        depths=depths,
        camera_info=info,
        camera_info_topic="" if chosen.camera_info is None else chosen.camera_info.name,
        pose_topic=chosen.pose.name,
        pose=pose,
        transforms=(*static, *moving),
    )


def _messages(bag: Bag, topic: Topic) -> Messages:
    positions, stamps, frame = [], [], ""
    for position, message in bag.messages(topic.name):
        frame = frame or frame_name(message.header.frame_id)
        positions.append(position)
        stamps.append(stamp_ns(message.header))
    received_ns = np.array([position.received_ns for position in positions], np.int64)
    return Messages(topic.name, frame, np.array(stamps, np.int64), received_ns, tuple(positions))


def _require_aligned(place: str, images: CameraInfo, depths: CameraInfo, frame: str) -> None:
    """Check that depths in another frame than the images are not those of another camera, as those of a RealSense."""
    if (images.width, images.height, images.k) != (depths.width, depths.height, depths.k):
        raise DataError(
            place,
            "depth of another camera: it has other intrinsics and another frame than the images",
            f"depth that is aligned with the images, in the frame {frame}, or {with_option('depth_topic', '')}",
        )


def _intrinsics(bag: Bag, topic: Topic) -> CameraInfo:
    """The content of all messages of the topic, which must be the same."""
    contents = {camera_info(message): None for _, message in bag.messages(topic.name)}
    if len(contents) != 1:
        found = f"{len(contents)} different intrinsics"
        raise DataError(f"{bag.path} {topic.name}", found, "the same intrinsics in all messages")
    return next(iter(contents))
