"""Which topics of a bag hold the images, the depths, the intrinsics and the poses."""

from collections.abc import Iterable
from dataclasses import dataclass

from tracknoise.exceptions import DataError
from tracknoise.sequences.option_text import with_option
from tracknoise.sequences.rosbag.bag import TRANSFORMS, Bag, Topic

IMAGE, COMPRESSED_IMAGE = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
POSE_KINDS = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
    "nav_msgs/msg/Odometry",
)
_IMAGE_KINDS = (IMAGE, COMPRESSED_IMAGE)
_DEPTH_ENCODINGS = ("16uc1", "32fc1")
_TRANSPORTS = ("compressed", "compressedDepth")
_STATIC = "tf_static"
_SHOWN = 20


@dataclass(frozen=True, slots=True)
class Wanted:
    """Topics that the user names; None for those that are to be found. A depth topic of "" means no depth.

    Parameters
    ----------
    image, depth, camera_info, pose
        Names of topics.
    intrinsics_given
        Whether the intrinsics come from somewhere else.
    """

    image: str | None = None
    depth: str | None = None
    camera_info: str | None = None
    pose: str | None = None
    intrinsics_given: bool = False


@dataclass(frozen=True, slots=True)
class Chosen:
    """The topics that are read.

    Parameters
    ----------
    image, depth, camera_info
        Of images, depths and intrinsics; None where there are none.
    depth_info
        Of the intrinsics beside the depths; None where there are none.
    pose
        Of poses; may be one of transforms.
    transforms, static_transforms
        All topics of transforms.
    """

    image: Topic
    depth: Topic | None
    camera_info: Topic | None
    depth_info: Topic | None
    pose: Topic
    transforms: tuple[Topic, ...]
    static_transforms: tuple[Topic, ...]


def choose_topics(bag: Bag, wanted: Wanted) -> Chosen:
    """Find the topic of each kind: the one that the user names, or the only one.

    Raises
    ------
    DataError
        If there is none, or several, listing all topics with their types and counts.
    """
    filled = [topic for topic in bag.topics.values() if topic.count]
    deep = {topic.name for topic in _of_kinds(filled, _IMAGE_KINDS) if _is_depth(bag, topic)}
    moving = tuple(topic for topic in _of_kinds(filled, [TRANSFORMS]) if not topic.name.endswith(_STATIC))
    static = tuple(topic for topic in _of_kinds(filled, [TRANSFORMS]) if topic.name.endswith(_STATIC))
    images, depths = _split(_of_kinds(filled, _IMAGE_KINDS), deep)
    image = _only(bag, "image_topic", wanted.image, images, _IMAGE_KINDS)
    depth = _depth(bag, wanted.depth, depths, image)
    infos = _of_kinds(filled, [CAMERA_INFO])
    return Chosen(
        image=image,
        depth=depth,
        depth_info=None if depth is None else next(iter(_beside(depth, infos)), None),
        camera_info=None if wanted.intrinsics_given else _camera_info(bag, wanted.camera_info, image, infos),
        pose=_only(
            bag, "pose_topic", wanted.pose, [*_of_kinds(filled, POSE_KINDS), *moving], (*POSE_KINDS, TRANSFORMS)
        ),
        transforms=moving,
        static_transforms=static,
    )


def listing(topics: Iterable[Topic]) -> str:
    """Topics with their types and counts in one line."""
    shown = [f"{topic.name} ({topic.kind or 'several types'}, {topic.count})" for topic in topics]
    more = f" and {len(shown) - _SHOWN} more" if len(shown) > _SHOWN else ""
    return ", ".join(shown[:_SHOWN]) + more if shown else "no topics"


def _of_kinds(topics: Iterable[Topic], kinds: Iterable[str]) -> list[Topic]:
    return [topic for topic in topics if topic.kind in kinds]


def _split(topics: list[Topic], deep: set[str]) -> tuple[list[Topic], list[Topic]]:
    return [topic for topic in topics if topic.name not in deep], [topic for topic in topics if topic.name in deep]


def _is_depth(bag: Bag, topic: Topic) -> bool:
    """Whether the first message of a topic of images is a depth map."""
    _, first = next(bag.messages(topic.name))
    written = first.encoding if topic.kind == IMAGE else first.format
    return "compresseddepth" in written.lower() or written.lower().startswith(_DEPTH_ENCODINGS)


def _depth(bag: Bag, name: str | None, depths: list[Topic], image: Topic) -> Topic | None:
    """In the frame of the images, or the only one."""
    if name == "" or (name is None and not depths):
        return None
    aligned = [topic for topic in depths if _frame(bag, topic) == _frame(bag, image)]
    return _only(bag, "depth_topic", name, aligned or depths, _IMAGE_KINDS)


def _frame(bag: Bag, topic: Topic) -> str:
    """Frame that the first message of a topic names."""
    _, first = next(bag.messages(topic.name))
    return str(first.header.frame_id)


def _camera_info(bag: Bag, name: str | None, image: Topic, infos: list[Topic]) -> Topic:
    """Beside the images, as ROS has it, or the only one."""
    siblings = _beside(image, infos)
    if name is None and not infos:
        needed = f"one topic of {CAMERA_INFO}, or {with_option('camera_file', 'FILE')}"
        raise DataError(bag.path, listing(bag.topics.values()), needed)
    return _only(bag, "camera_info_topic", name, siblings or infos, [CAMERA_INFO])


def _beside(topic: Topic, infos: list[Topic]) -> list[Topic]:
    """The intrinsics beside a topic of images; empty where there are none."""
    parts = topic.name.split("/")
    beside = "/".join([*parts[: -2 if parts[-1] in _TRANSPORTS else -1], "camera_info"])
    return [info for info in infos if info.name == beside]


def _only(bag: Bag, option: str, name: str | None, fitting: list[Topic], kinds: Iterable[str]) -> Topic:
    """The topic of that name, or the only fitting one."""
    if name is not None:
        return _named(bag, option, name, kinds)
    if len(fitting) != 1:
        found = listing(fitting or bag.topics.values())
        needed = f"one topic of {' or '.join(kinds)}"
        if fitting:
            needed = f"one topic; choose it with {with_option(option, fitting[0].name)}"
        raise DataError(bag.path, found, needed)
    return fitting[0]


def _named(bag: Bag, option: str, name: str, kinds: Iterable[str]) -> Topic:
    topic = bag.topics.get(name)
    if topic is None or topic.kind not in kinds or not topic.count:
        found = f"no messages of {name}" if topic is None or not topic.count else f"{listing([topic])}"
        raise DataError(bag.path, f"{option} {name!r}: {found}", f"one of {listing(bag.topics.values())}")
    return topic
