"""Transforms between frames in a bag: those of a topic of poses, and those of tf."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.sequences.poses import quaternion_poses
from tracknoise.sequences.rosbag.bag import TRANSFORMS, Bag, Topic


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """The transform of a child frame to its parent frame over time.

    Parameters
    ----------
    topic
        Where it comes from.
    parent, child
        Names of the frames; the child's is "" where the messages do not have it.
    stamped_ns, received_ns
        (n,) int64, nanoseconds: in the messages' headers, and when they were received.
    parent_from_child
        (n, 4, 4) float64.
    is_static
        Whether it holds at all times.
    left_out
        How many messages held no pose.
    """

    topic: str
    parent: str
    child: str
    stamped_ns: NDArray[np.int64]
    received_ns: NDArray[np.int64]
    parent_from_child: NDArray[np.float64]
    is_static: bool
    left_out: int


@dataclass(frozen=True, slots=True)
class _Sample:
    parent: str
    child: str
    stamped_ns: int
    values: tuple[float, ...]  # x y z qx qy qz qw


def pose_link(bag: Bag, topic: Topic) -> Link:
    """The poses of a topic.

    Raises
    ------
    DataError
        If the messages have several frames, or a pose is no rigid transform.
    """
    links = _links(bag, topic, moving=True)
    if len(links) != 1:
        pairs = ", ".join(f"{one.child or '(no name)'} in {one.parent}" for one in links)
        raise DataError(f"{bag.path} {topic.name}", f"poses of several frames: {pairs}", "poses of one frame")
    return links[0]


def transform_links(bag: Bag, topic: Topic, *, moving: bool) -> list[Link]:
    """The transforms of a tf topic. One that never changes is static, whatever its topic.

    Raises
    ------
    DataError
        If a transform is not rigid.
    """
    return _links(bag, topic, moving=moving)


def _links(bag: Bag, topic: Topic, *, moving: bool) -> list[Link]:
    samples: dict[tuple[str, str], list[tuple[int, _Sample]]] = {}
    for position, message in bag.messages(topic.name):
        for sample in _samples(topic.kind, message):
            samples.setdefault((sample.parent, sample.child), []).append((position.received_ns, sample))
    place = f"{bag.path} {topic.name}"
    constant = topic.kind == TRANSFORMS
    return [_link(place, topic.name, found, moving=moving, constant=constant) for found in samples.values()]


def _link(place: str, topic: str, found: list[tuple[int, _Sample]], *, moving: bool, constant: bool) -> Link:
    values = np.array([sample.values for _, sample in found])
    usable = np.isfinite(values).all(axis=1) & values[:, 3:].any(axis=1)
    places = [f"{place} message {index}" for index in np.flatnonzero(usable)]
    poses = quaternion_poses(values[usable, :3], values[usable, 3:], places)
    never_changes = constant and len(poses) > 0 and not np.ptp(poses, axis=0).any()
    kept = slice(None) if moving else slice(-1, None)
    return Link(
        topic,
        found[0][1].parent,
        found[0][1].child,
        np.array([sample.stamped_ns for _, sample in found])[usable][kept],
        np.array([received_ns for received_ns, _ in found])[usable][kept],
        poses[kept],
        is_static=not moving or never_changes,
        left_out=int(np.count_nonzero(~usable)),
    )


def _samples(kind: str, message: Any) -> Iterator[_Sample]:
    if kind == TRANSFORMS:
        for transform in message.transforms:
            yield _of_transform(transform)
    else:
        yield _READ[kind](message)


def _of_transform(message: Any) -> _Sample:
    moved = message.transform
    return _sample(message, message.child_frame_id, moved.translation, moved.rotation)


def _of_pose(message: Any) -> _Sample:
    return _sample(message, "", message.pose.position, message.pose.orientation)


def _of_uncertain_pose(message: Any) -> _Sample:
    return _sample(message, "", message.pose.pose.position, message.pose.pose.orientation)


def _of_odometry(message: Any) -> _Sample:
    pose = message.pose.pose
    return _sample(message, message.child_frame_id, pose.position, pose.orientation)


def _sample(message: Any, child: str, position: Any, rotation: Any) -> _Sample:
    values = (position.x, position.y, position.z, rotation.x, rotation.y, rotation.z, rotation.w)
    return _Sample(frame_name(message.header.frame_id), frame_name(child), stamp_ns(message.header), values)


def stamp_ns(header: Any) -> int:
    """Time of a header, nanoseconds."""
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)


def frame_name(written: str) -> str:
    """Name of a frame. ROS 1 also wrote it with a slash in front."""
    return written.lstrip("/")


_READ: dict[str, Callable[[Any], _Sample]] = {
    "geometry_msgs/msg/PoseStamped": _of_pose,
    "geometry_msgs/msg/PoseWithCovarianceStamped": _of_uncertain_pose,
    "geometry_msgs/msg/TransformStamped": _of_transform,
    "nav_msgs/msg/Odometry": _of_odometry,
}
