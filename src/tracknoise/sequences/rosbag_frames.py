"""One pass through a bag: the frames that it holds, and the poses of the camera at their times."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import PosePath, interpolate_poses, invert, nearest
from tracknoise.parsing_child import LostError, call_in_child
from tracknoise.rosbag_files import TRANSFORMS, Bag, BagFile, Position, Topic, bag_size
from tracknoise.sequences.images import Levels
from tracknoise.sequences.orientation import EXIF_BYTES, UPRIGHT, orientation_of
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.rosbag_messages import (
    COMPRESSED_IMAGE,
    CameraInfo,
    Link,
    Wanted,
    camera_info,
    choose_topics,
    depth_map,
    frame_name,
    gray_image,
    pose_link,
    stamp_ns,
    transform_links,
)
from tracknoise.sequences.scenes import with_option
from tracknoise.sequences.timed_poses import path_through
from tracknoise.text import counted, counted_of
from tracknoise.time_units import TimeUnit

_NO_FRAME = "0"
"""What recordings of librealsense name as the frame of every stream."""


@dataclass(frozen=True, slots=True, eq=False)
class Messages:
    """Where the messages of a topic are, in the order of the bag."""

    topic: str  # its name
    frame: str  # the frame that the first message names
    # stamped_ns, received_ns: (n,) int64, nanoseconds: in their headers, and when they were received
    stamped_ns: NDArray[np.int64]
    received_ns: NDArray[np.int64]
    positions: tuple[Position, ...]  # n positions in the bag
    encoding: str  # of the first message, or the format of its file
    turned: tuple[int, ...] = ()  # orientations that files in them state


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """What a bag holds of a camera."""

    # images, depths: their messages; None where there is no depth
    images: Messages
    depths: Messages | None
    # camera_info, camera_info_topic: the intrinsics; None where they come from somewhere else
    camera_info: CameraInfo | None
    camera_info_topic: str
    pose_topic: str  # where the poses come from; empty where that is not the bag
    pose: Link | None  # the poses of the topic; None where they come from tf
    transforms: tuple[Link, ...]  # the transforms of all tf topics
    second: Messages | None  # images of the second camera; None where there is none
    # second_info, second_info_topic: its intrinsics; None where they come from somewhere else
    second_info: CameraInfo | None
    second_info_topic: str


def scan_bag(path: Path, wanted: Wanted) -> Scan:
    """Go through a bag once, in a process of its own, because a damaged bag may take all memory."""
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
    may_differ = depths is not None and (depths.frame != images.frame or images.frame == _NO_FRAME)
    if info is not None and depths is not None and chosen.depth_info is not None and may_differ:
        _require_aligned(f"{path} {depths.topic}", info, _intrinsics(bag, chosen.depth_info), images.frame)
    is_of_topic = chosen.pose is not None and chosen.pose.kind != TRANSFORMS
    pose = pose_link(bag, chosen.pose) if chosen.pose is not None and is_of_topic else None
    topics = [(chosen.static_transforms, False)] if chosen.pose is not None or chosen.second is not None else []
    topics += [] if chosen.pose is None else [(chosen.transforms, True)]
    links = [link for group, moving in topics for topic in group for link in transform_links(bag, topic, moving=moving)]
    return Scan(
        images=images,
        depths=depths,
        camera_info=info,
        camera_info_topic="" if chosen.camera_info is None else chosen.camera_info.name,
        pose_topic="" if chosen.pose is None else chosen.pose.name,
        pose=pose,
        transforms=tuple(links),
        second=None if chosen.second is None else _messages(bag, chosen.second),
        second_info=None if chosen.second_info is None else _intrinsics(bag, chosen.second_info),
        second_info_topic="" if chosen.second_info is None else chosen.second_info.name,
    )


def _messages(bag: Bag, topic: Topic) -> Messages:
    positions, stamps, turned, frame, encoding = [], [], [], "", ""
    for position, message in bag.messages(topic.name):
        is_file = topic.kind == COMPRESSED_IMAGE
        frame = frame or frame_name(message.header.frame_id)
        encoding = encoding or (message.format if is_file else message.encoding)
        if is_file and (orientation := orientation_of(bytes(message.data[:EXIF_BYTES]))) != UPRIGHT:
            turned.append(orientation)
        positions.append(position)
        stamps.append(stamp_ns(message.header))
    received_ns = np.array([position.received_ns for position in positions], np.int64)
    stamped_ns = np.array(stamps, np.int64)
    return Messages(topic.name, frame, stamped_ns, received_ns, tuple(positions), encoding, tuple(turned))


def _require_aligned(place: str, images: CameraInfo, depths: CameraInfo, frame: str) -> None:
    """Check that depths in no named frame, or another than the images, are not of another camera, as of a RealSense."""
    if (images.width, images.height, images.k) != (depths.width, depths.height, depths.k):
        other, within = ("", "") if frame == _NO_FRAME else (" and another frame", f", in the frame {frame}")
        raise DataError(
            place,
            f"depth of another camera: it has other intrinsics{other} than the images",
            f"depth that is aligned with the images{within}, or {with_option('depth_topic', '')}",
        )


def _intrinsics(bag: Bag, topic: Topic) -> CameraInfo:
    """The content of all messages of the topic, which must be the same."""
    contents = {camera_info(message): None for _, message in bag.messages(topic.name)}
    if len(contents) != 1:
        found = f"{len(contents)} different intrinsics"
        raise DataError(f"{bag.path} {topic.name}", found, "the same intrinsics in all messages")
    return next(iter(contents))


_Stamped = TypeVar("_Stamped", Messages, Link)


def in_unit(scan: Scan, unit: TimeUnit) -> Scan:
    """What a bag holds, where the seconds of the times in headers are numbers of another unit."""

    def stamped(part: _Stamped) -> _Stamped:
        return replace(part, stamped_ns=part.stamped_ns // unit.per_second)

    return replace(
        scan,
        images=stamped(scan.images),
        depths=None if scan.depths is None else stamped(scan.depths),
        pose=None if scan.pose is None else stamped(scan.pose),
        transforms=tuple(map(stamped, scan.transforms)),
        second=None if scan.second is None else stamped(scan.second),
    )


class Clock(StrEnum):
    """Which time of a message counts: that in its header, or when it was received."""

    header = "header"
    received = "received"


@dataclass(frozen=True, slots=True)
class BagImages:
    """Reads the image of a frame from its message."""

    bag: BagFile  # where the messages are
    topic: str  # of the images
    positions: tuple[Position, ...]  # one message for each frame
    levels: Levels | None  # 16-bit values that become 0 and 255; None if the images have 8 bits

    def __len__(self) -> int:
        return len(self.positions)

    def __call__(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: see `tracknoise.sequences.rosbag_messages.gray_image`."""
        message = self.bag.message(self.topic, self.positions[index])
        return gray_image(f"{self.bag.path} {self.topic}", message, self.levels)


@dataclass(frozen=True, slots=True)
class BagDepths:
    """Reads the depth of a frame from its message."""

    bag: BagFile  # where the messages are
    topic: str  # of the depth maps
    positions: tuple[Position | None, ...]  # one message for each frame, None for a frame without depth
    metres_per_unit: float  # depth of the integer 1, metres
    # None for dense depth; for sparse depth, the largest distance to the nearest pixel with depth, px
    radius_px: float | None

    def __len__(self) -> int:
        return len(self.positions)

    def __call__(self, index: int) -> DepthMap | None:
        """Depth of one frame: see `tracknoise.sequences.rosbag_messages.depth_map`."""
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

    Returns times_ns (k,). `times_ns`: increasing.
    """
    times = times_ns(messages, clock)
    if clock is Clock.header and not times.any():
        raise DataError(f"{place} {messages.topic}", "the time 0 in all headers", 'times, or time = "received"')
    ordered, first = np.unique(times, return_index=True)
    if len(times) > 2 * len(ordered):
        repeat = counted_of(len(times) - len(ordered), len(times), "message", "repeats", "repeat")
        other = Clock.received if clock is Clock.header else Clock.header
        raise DataError(f"{place} {messages.topic}", f"{repeat} the time of another one", f'times, or time = "{other}"')
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


_SHOWN = 12


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a chain of frames: a transform, or its inverse.

    Parameters
    ----------
    link
        The transform.
    upward
        Whether the step goes from the child frame to its parent.
    """

    link: Link
    upward: bool


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """Transforms between frames. A frame that has several parents is an error only where a chain leads through it."""

    place: str | Path  # the bag, for errors
    by_child: dict[str, Link]  # one transform by the name of its child frame
    several: dict[str, set[str]]  # all parents of the frames that have more than one

    @classmethod
    def of(cls, place: str | Path, links: Iterable[Link]) -> "Tree":
        """From all transforms. Of those with the same two frames, one that changes precedes a static one."""
        by_child: dict[str, Link] = {}
        parents: dict[str, set[str]] = {}
        for link in sorted(links, key=lambda link: not link.is_static):
            by_child[link.child] = link
            parents.setdefault(link.child, set()).add(link.parent)
        return cls(place, by_child, {child: above for child, above in parents.items() if len(above) > 1})

    def root_of(self, frame: str) -> str:
        """The frame at the root of the tree that a frame is in."""
        root = self._above(frame)[-1]
        self._require_one_parent(root)
        return root

    def chain(self, target: str, source: str) -> list[Step]:
        """The steps from a source frame to a target frame, in this order."""
        above_source, above_target = self._above(source), self._above(target)
        common = next((frame for frame in above_source if frame in above_target), None)
        if common is None:
            self._require_one_parent(above_source[-1], above_target[-1])
            found = f"no chain of transforms from {source or '(no name)'} to {target or '(no name)'}"
            raise DataError(
                self.place,
                found,
                f"connected frames among {self.names()}, or {with_option('body_from_camera', '[16 NUMBERS]')}",
            )
        up = above_source[: above_source.index(common)]
        down = above_target[: above_target.index(common)][::-1]
        return [Step(self.by_child[frame], True) for frame in up] + [
            Step(self.by_child[frame], False) for frame in down
        ]

    def connects(self, *frames: str) -> bool:
        """Whether a chain leads from one frame to the other."""
        return bool(set.intersection(*({*self._above(frame)} for frame in frames)))

    def names(self) -> str:
        """Names of all frames in one line."""
        frames = sorted({*self.by_child, *(link.parent for link in self.by_child.values())})
        return ", ".join(frames[:_SHOWN]) + (" and others" if len(frames) > _SHOWN else "") if frames else "no frames"

    def _above(self, frame: str) -> list[str]:
        """A frame, its parent, the parent of this one and so on, up to the root or to a frame with several parents."""
        frames = [frame]
        while frames[-1] in self.by_child and frames[-1] not in self.several:
            parent = self.by_child[frames[-1]].parent
            if parent in frames:
                raise DataError(self.place, f"transforms in a circle: {', '.join(frames)}", "a tree of frames")
            frames.append(parent)
        return frames

    def _require_one_parent(self, *frames: str) -> None:
        for frame in frames:
            if frame in self.several:
                parents = " and in ".join(sorted(self.several[frame]))
                raise DataError(self.place, f"frame {frame} in {parents}", "one parent frame")


def poses_along(
    steps: list[Step], times_of: Callable[[Link], NDArray[np.float64]], at_s: NDArray[np.float64], *, max_gap_s: float
) -> NDArray[np.float64]:
    """Transforms of the source frame of a chain to its target frame: each is interpolated, then they are combined.

    Shapes: at_s (n,); returns (n, 4, 4). ``target_from_source``. NaN where a transform is not known.
    """
    poses = np.broadcast_to(np.eye(4), (len(at_s), 4, 4))
    for step in steps:
        parent_from_child = _at(step.link, times_of(step.link), at_s, max_gap_s)
        poses = (parent_from_child if step.upward else invert(parent_from_child)) @ poses
    target_from_source = poses.copy()
    target_from_source[~np.isfinite(target_from_source).all(axis=(1, 2))] = np.nan
    return target_from_source


def _at(link: Link, times_s: NDArray[np.float64], at_s: NDArray[np.float64], max_gap_s: float) -> NDArray[np.float64]:
    """(n, 4, 4) float64: the parent from the child at each time. Of samples with the same time, the last holds."""
    if link.is_static:
        constant = link.parent_from_child[-1] if len(times_s) else np.full((4, 4), np.nan)
        return np.broadcast_to(constant, (len(at_s), 4, 4))
    backward, last = np.unique(times_s[::-1], return_index=True)
    poses = link.parent_from_child[::-1][last]
    return interpolate_poses(backward, poses, at_s, max_gap_s=max_gap_s)


_BODY = "(body)"
_OPTICAL = "optical"
_FEWEST_POSES = 2


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """Which frames a trajectory connects, and how; None for what is to be found.

    Parameters
    ----------
    world, camera
        Names of the frames between which poses are wanted.
    body
        Name of the frame whose pose is measured.
    body_from_camera
        (4, 4) float64; None where tf has it.
    """

    world: str | None = None
    camera: str | None = None
    body: str | None = None
    body_from_camera: NDArray[np.float64] | None = None


def camera_poses(
    path: Path, scan: Scan, frames: Frames, at_ns: NDArray[np.int64], *, clock: Clock, max_gap_s: float
) -> tuple[NDArray[np.float64], PosePath, tuple[str, ...]]:
    """Poses of the camera at given times, and between them.

    Shapes: at_ns (n,); returns world_from_camera (n, 4, 4). `world_from_camera`: NaN where the pose is not known.
    """

    def seconds(link: Link) -> NDArray[np.float64]:
        times: NDArray[np.float64] = (times_ns(link, clock) - at_ns[0]) / 1e9
        return times

    steps, notes = _steps(path, scan, frames)
    at_s: NDArray[np.float64] = (at_ns - at_ns[0]) / 1e9
    poses = poses_along(steps, seconds, at_s, max_gap_s=max_gap_s)
    _require_some(path, steps, [seconds(step.link) for step in steps], at_s, int(np.count_nonzero(has_pose(poses))))
    recorded_s = np.unique(np.concatenate([seconds(step.link) for step in steps if not step.link.is_static]))
    recorded = poses_along(steps, seconds, recorded_s, max_gap_s=max_gap_s)
    if frames.body_from_camera is not None:
        poses, recorded = poses @ frames.body_from_camera, recorded @ frames.body_from_camera
    along = path_through(at_s, poses, PosePath(recorded_s, recorded), max_gap_s=max_gap_s)
    return poses, along, (*notes, *_left_out(steps))


def static_place(path: Path, scan: Scan, first: str, second: str) -> NDArray[np.float64] | None:
    """(4, 4) float64: pose of one frame in another by transforms that do not change; None where they are not connected.

    Nor of one frame: drivers may give both cameras of a pair that of the first.
    """
    tree = Tree.of(path, [link for link in scan.transforms if link.is_static])
    if first == second or not tree.connects(first, second):
        return None
    poses = poses_along(
        tree.chain(first, second), lambda link: np.zeros(len(link.stamped_ns)), np.zeros(1), max_gap_s=0.0
    )
    return None if np.isnan(poses).any() else np.asarray(poses[0])


def _steps(path: Path, scan: Scan, frames: Frames) -> tuple[list[Step], tuple[str, ...]]:
    """The chain from the camera, or from the body where its camera is given, to the world."""
    camera = frames.camera or scan.images.frame
    body = frames.body or ("" if scan.pose is None else scan.pose.child)
    given = frames.body_from_camera is not None
    if not camera and not given and (body or scan.pose is None):
        raise DataError(
            f"{path} {scan.images.topic}",
            "no frame in the headers",
            f"a frame, or {with_option('camera_frame', 'NAME')}",
        )
    if scan.pose is None:
        if given and not body:
            raise DataError(
                path,
                f"body_from_camera, poses from {scan.pose_topic} and no pose_frame",
                with_option("pose_frame", "NAME"),
            )
        steps = _of_tf(path, scan, frames.world, body if given else camera)
    else:
        measured = body or (_BODY if given else camera)
        steps = _of_topic(path, scan, scan.pose, frames.world, measured, measured if given else camera)
    return steps, tuple(_notes(scan, steps, camera=camera, body=body, given=given))


def _of_tf(path: Path, scan: Scan, world: str | None, source: str) -> list[Step]:
    """The chain through tf alone, of which something must move."""
    tree = Tree.of(path, scan.transforms)
    steps = tree.chain(world or tree.root_of(source), source)
    if not steps:
        raise DataError(f"{path} {scan.pose_topic}", f"no transform of {source}", f"one of {tree.names()}")
    if all(step.link.is_static for step in steps):
        found = f"no transform between {source} and {world or steps[-1].link.parent} that changes"
        raise DataError(
            f"{path} {scan.pose_topic}",
            found,
            f"a camera that moves; choose pose_topic, or {with_option('world_frame', 'NAME')}",
        )
    return steps


def _of_topic(path: Path, scan: Scan, pose: Link, world: str | None, measured: str, source: str) -> list[Step]:
    """The chain through tf to the frame whose pose is measured, through this pose, and through tf to the world."""
    tree = Tree.of(path, scan.transforms)
    before, after = tree.chain(measured, source), tree.chain(world or pose.parent, pose.parent)
    return [*before, Step(replace(pose, child=measured), True), *after]


def _notes(scan: Scan, steps: list[Step], *, camera: str, body: str, given: bool) -> Iterator[str]:
    stated = "; the pose of the camera in the body is given" if given else ""
    ends = [_near_end(steps[0]), *(_far_end(step) for step in steps)]
    yield f"poses are those of {scan.pose_topic}, interpolated: {' from '.join(reversed(ends))}{stated}"
    if scan.pose is not None and not body and not given:
        yield (
            f"the messages of {scan.pose_topic} do not name the frame whose pose they hold; "
            "it is taken as that of the camera"
        )
    if _OPTICAL not in camera.lower() and not given:
        yield (
            f"the axes of the frame {camera or '(no name)'} are taken as those of a camera (x right, y down, "
            "z forward), although its name does not contain 'optical'"
        )


def _near_end(step: Step) -> str:
    return (step.link.child if step.upward else step.link.parent) or "(no name)"


def _far_end(step: Step) -> str:
    return (step.link.parent if step.upward else step.link.child) or "(no name)"


def _left_out(steps: list[Step]) -> Iterator[str]:
    for link in (step.link for step in steps):
        if link.left_out:
            count = counted(link.left_out, "message")
            yield f"{count} of {link.topic} without a pose (NaN, or a quaternion of zeros)"


def _require_some(
    path: Path, steps: list[Step], times_s: list[NDArray[np.float64]], at_s: NDArray[np.float64], posed: int
) -> None:
    """Check that enough images have a pose; the error says when the images and the transforms are."""
    if posed >= min(_FEWEST_POSES, len(at_s)):
        return
    moving = [(step.link, times) for step, times in zip(steps, times_s, strict=True) if not step.link.is_static]
    link, times = next(((link, times) for link, times in moving if not len(times)), moving[0])
    when = f"from {times.min():.3f} s to {times.max():.3f} s" if len(times) else "without a pose"
    found = f"poses for {posed} of {len(at_s)} images; the images are from 0 s to {at_s[-1]:.3f} s, {link.child} {when}"
    raise DataError(
        f"{path} {link.topic}", found, f"poses at the times of images, or {with_option('max_pose_gap_s', 'SECONDS')}"
    )
