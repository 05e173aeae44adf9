"""Messages of bags: images and depth maps, cameras, transforms, and which topics hold them."""

import re
import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign_files import MOST_PIXELS
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import invert
from tracknoise.rosbag_files import TRANSFORMS, Bag, Topic
from tracknoise.sequences.camera_files import CameraFile, checked_camera
from tracknoise.sequences.images import NO_DEPTH, DeepImageError, Levels, decode_image, scaled
from tracknoise.sequences.poses import checked_poses, quaternion_poses
from tracknoise.sequences.scenes import with_option
from tracknoise.text import counted

_TO_GRAY = {
    "rgb8": cv2.COLOR_RGB2GRAY,
    "bgr8": cv2.COLOR_BGR2GRAY,
    "8uc3": cv2.COLOR_BGR2GRAY,
    "rgba8": cv2.COLOR_RGBA2GRAY,
    "bgra8": cv2.COLOR_BGRA2GRAY,
    "8uc4": cv2.COLOR_BGRA2GRAY,
}
_BAYER = {
    "bayer_rggb": cv2.COLOR_BayerRGGB2GRAY,
    "bayer_bggr": cv2.COLOR_BayerBGGR2GRAY,
    "bayer_gbrg": cv2.COLOR_BayerGBRG2GRAY,
    "bayer_grbg": cv2.COLOR_BayerGRBG2GRAY,
}
"""Mosaics by the beginning of their encodings, which 8 or 16 follows: colours of the first two rows and columns."""
_CHANNELS = {"rgb8": 3, "bgr8": 3, "8uc3": 3, "rgba8": 4, "bgra8": 4, "8uc4": 4}
_GRAY = ("mono8", "8uc1")
_GRAY16 = ("mono16", "16uc1")
_LUMA = {"yuv422": 1, "uyvy": 1, "yuv422_yuy2": 0, "yuyv": 0}
"""Encodings with two bytes for each pixel, and which of them is the brightness."""
_DEPTH32 = "32fc1"
_KNOWN = "mono8, mono16, rgb8, bgr8, rgba8, bgra8, bayer_*8, bayer_*16 or yuv422"
_COMPRESSED_DEPTH = struct.Struct("<iff")
"""Header of a compressed depth map: a format, and the quantisation of inverse depth."""


def gray_image(place: str, message: Any, levels: Levels | None) -> NDArray[np.uint8]:
    """The image of an Image or CompressedImage message in 8-bit grayscale. `levels`: None if the images have 8 bits."""
    if hasattr(message, "format"):
        return _compressed_gray(place, message, levels)
    encoding = message.encoding.lower()
    if encoding in _GRAY16:
        return _scaled(place, _pixels16(place, message), levels)
    if (mosaic := _mosaic_of(encoding)) is not None:
        wide = encoding.endswith("16")
        return _gray_mosaic(place, _pixels16(place, message) if wide else _raw(place, message, 1), mosaic, levels)
    pixels = _raw(place, message, _bytes_per_pixel(place, encoding))
    if encoding in _TO_GRAY:
        gray: NDArray[np.uint8] = cv2.cvtColor(np.ascontiguousarray(pixels), _TO_GRAY[encoding]).astype(np.uint8)
        return gray
    return np.ascontiguousarray(pixels[..., _LUMA[encoding]] if encoding in _LUMA else pixels)


def _mosaic_of(encoding: str) -> int | None:
    """OpenCV's conversion of a mosaic to gray; None of an encoding that is none."""
    return _BAYER.get(encoding.removesuffix("16")) or _BAYER.get(encoding.removesuffix("8"))


def _gray_mosaic(
    place: str, pixels: NDArray[np.uint8] | NDArray[np.uint16], mosaic: int, levels: Levels | None
) -> NDArray[np.uint8]:
    """A mosaic of colours in 8-bit grayscale."""
    gray = np.asarray(cv2.cvtColor(pixels, mosaic))
    return gray.astype(np.uint8) if gray.dtype == np.uint8 else _scaled(place, gray.astype(np.uint16), levels)


def depth_map(place: str, message: Any, metres_per_unit: float) -> DepthMap:
    """The depth map of an Image message (16UC1, mono16 or 32FC1), or of a CompressedImage message in PNG."""
    depth_m = _depths(place, message, metres_per_unit)
    return DepthMap(depth_m, np.isfinite(depth_m) & (depth_m > 0.0))


def _depths(place: str, message: Any, metres_per_unit: float) -> NDArray[np.floating]:
    """(height, width) float: metres, not positive or not finite where there is none."""
    if hasattr(message, "format"):
        return _compressed_depth(place, message, metres_per_unit)
    encoding = message.encoding.lower()
    if encoding in _GRAY16:
        return _metres(_pixels16(place, message), metres_per_unit)
    if encoding != _DEPTH32:
        raise DataError(place, f"depth with the encoding {message.encoding!r}", "16UC1, mono16 or 32FC1")
    order = ">" if message.is_bigendian else "<"
    return _raw(place, message, 4).view(f"{order}f4").reshape(message.height, message.width).astype(np.float32)


def _metres(units: NDArray[np.uint16], metres_per_unit: float) -> NDArray[np.float64]:
    return np.where(np.isin(units, NO_DEPTH), 0.0, units * metres_per_unit)


def _raw(place: str, message: Any, bytes_per_pixel: int) -> NDArray[np.uint8]:
    """(height, width) or (height, width, bytes) uint8: rows without their padding."""
    height, width, step = message.height, message.width, message.step
    if not 0 < height * width <= MOST_PIXELS:
        raise DataError(place, f"an image of {width}x{height}", f"1 to {MOST_PIXELS} pixels")
    if step < width * bytes_per_pixel or len(message.data) < height * step:
        found = f"{counted(len(message.data), 'byte')} in rows of {step} for an image of {width}x{height}"
        raise DataError(
            place, found, f"{counted(height, 'row')} of at least {counted(width * bytes_per_pixel, 'byte')}"
        )
    rows = np.asarray(message.data, np.uint8)[: height * step].reshape(height, step)
    pixels = np.ascontiguousarray(rows[:, : width * bytes_per_pixel])
    return pixels if bytes_per_pixel == 1 else pixels.reshape(height, width, bytes_per_pixel)


def _bytes_per_pixel(place: str, encoding: str) -> int:
    if encoding not in (*_GRAY, *_TO_GRAY, *_LUMA):
        raise DataError(place, f"an image with the encoding {encoding!r}", _KNOWN)
    return 2 if encoding in _LUMA else _CHANNELS.get(encoding, 1)


def _pixels16(place: str, message: Any) -> NDArray[np.uint16]:
    order = ">" if message.is_bigendian else "<"
    pixels = _raw(place, message, 2).view(f"{order}u2").reshape(message.height, message.width)
    return pixels.astype(np.uint16)


def _scaled(place: str, pixels: NDArray[np.uint16], levels: Levels | None) -> NDArray[np.uint8]:
    """16-bit values between two levels as 0 to 255."""
    if levels is None:
        raise DeepImageError(place, "16-bit images and no image_levels", "image_levels = [darkest, brightest]")
    return scaled(pixels, levels)


def _compressed_gray(place: str, message: Any, levels: Levels | None) -> NDArray[np.uint8]:
    """What the content of the file says about its bits counts: not every driver states them in the format.

    The format begins with the encoding of what was compressed: a mosaic stays one where the file has one channel.
    """
    mosaic = _mosaic_of(message.format.lower().partition(";")[0].strip())
    if mosaic is not None:
        stored = decode_image(place, bytes(message.data), cv2.IMREAD_UNCHANGED)
        if stored.ndim == 2:
            return _gray_mosaic(place, stored, mosaic, levels)
    pixels = decode_image(place, bytes(message.data), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH)
    return pixels if pixels.dtype == np.uint8 else _scaled(place, pixels, levels)


def _compressed_depth(place: str, message: Any, metres_per_unit: float) -> NDArray[np.floating]:
    """Depth in a PNG image, after a header if the transport was ``compressedDepth``."""
    written, data = message.format.lower(), bytes(message.data)
    with_header = "compresseddepth" in written
    if "rvl" in written:
        raise DataError(place, f"depth in the format {message.format!r}", "compressedDepth in PNG")
    units = decode_image(place, data[_COMPRESSED_DEPTH.size :] if with_header else data, cv2.IMREAD_UNCHANGED)
    if units.dtype != np.uint16 or units.ndim != 2:
        raise DataError(place, "a compressed depth map that is not a 16-bit image", "16-bit single-channel depth")
    if not (with_header and written.startswith(_DEPTH32)):
        return _metres(units, metres_per_unit)
    _, scale, offset = _COMPRESSED_DEPTH.unpack_from(data)
    with np.errstate(all="ignore"):
        return np.where(units > 0, scale / (units.astype(np.float64) - offset), 0.0)


_RADTAN = ("plumb_bob", "rational_polynomial", "radtan", "brown_conrady")
_EQUIDISTANT = ("equidistant", "fisheye", "kannala_brandt4")
_RADTAN_COUNTS = (4, 5, 8)
_EQUIDISTANT_COUNT = 4
_ROTATION_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """What a CameraInfo message says."""

    # width, height: size of the full image, px
    width: int
    height: int
    model: str  # name of the distortion model
    d: tuple[float, ...]  # distortion coefficients
    # k, r, p: rows of the camera matrix (3x3), of the rectifying rotation (3x3) and of the projection (3x4)
    k: tuple[float, ...]
    r: tuple[float, ...]
    p: tuple[float, ...]
    binning: tuple[int, int]  # pixels that are joined along x and y; 0 means 1
    # first column and row, width and height of the part that is kept; width and height 0 mean all
    roi: tuple[int, int, int, int]


def camera_info(message: Any) -> CameraInfo:
    """The content of a message of ROS 1 or ROS 2, whose fields are named D, K, R, P or d, k, r, p."""
    matrices = (getattr(message, name, None) for name in "dkrp")
    ros1 = (getattr(message, name, None) for name in "DKRP")
    d, k, r, p = (
        tuple(np.ravel(np.asarray(b if a is None else a)).tolist()) for a, b in zip(matrices, ros1, strict=True)
    )
    roi = message.roi
    return CameraInfo(
        message.width,
        message.height,
        message.distortion_model,
        d,
        k,
        r,
        p,
        (max(message.binning_x, 1), max(message.binning_y, 1)),
        (roi.x_offset, roi.y_offset, roi.width, roi.height),
    )


def camera_of(place: str, info: CameraInfo, *, rectified: bool) -> tuple[CameraFile, tuple[str, ...]]:
    """The camera of the images."""
    fx, fy, cx, cy = _intrinsics(place, info, rectified=rectified)
    (along_x, along_y), (left, top, width, height) = info.binning, info.roi
    size = ((width or info.width) // along_x, (height or info.height) // along_y)
    if min(size) < 1:
        raise DataError(place, f"an image size of {size[0]}x{size[1]}", "a size of at least 1x1")
    scaled = (fx / along_x, fy / along_y, _binned(cx - left, along_x), _binned(cy - top, along_y))
    d = () if rectified else _coefficients(place, info)
    model = "equidistant" if d and info.model.lower() in _EQUIDISTANT else "radtan"
    file = CameraFile(checked_camera(place, model, size, scaled, d))
    return file, (*file.notes, *_notes(place, info, rectified=rectified))


def place_beside(
    place: str, first: CameraInfo, second: CameraInfo, *, rectified: tuple[bool, bool]
) -> NDArray[np.float64] | None:
    """(4, 4) float64: the pose of the second camera of a pair in the first, metres; None where P states no distance.

    P has minus the focal length times the position in the frame of the rectified first camera; R turns the frame of raw
    images into that of rectified ones, which both cameras share.
    """
    offset_m = _offset_m(second) - _offset_m(first)
    if not (np.isfinite(offset_m).all() and offset_m.any()):
        return None
    rectifying = np.stack([np.eye(4)] * 2)
    for pose, info, is_rectified in zip(rectifying, (first, second), rectified, strict=True):
        pose[:3, :3] = np.eye(3) if is_rectified or not any(info.r) else np.array(info.r).reshape(3, 3)
    (first_pose, second_pose), _ = checked_poses(rectifying, [f"{place}: R"] * 2)
    second_pose[:3, 3] = offset_m
    return np.asarray(invert(first_pose) @ second_pose)


def _offset_m(info: CameraInfo) -> NDArray[np.float64]:
    """(3,) float64: position of a camera in the frame of the first of a rectified pair, metres; NaN without P."""
    fx, fy = info.p[0], info.p[5]
    return np.array([-info.p[3] / fx, -info.p[7] / fy, 0.0]) if fx and fy else np.full(3, np.nan)


def _intrinsics(place: str, info: CameraInfo, *, rectified: bool) -> tuple[float, float, float, float]:
    """Focal lengths and principal point fx, fy, cx, cy of the full image."""
    name, columns, values = ("P", 4, info.p) if rectified else ("K", 3, info.k)
    matrix = np.array(values).reshape(3, columns)
    fx, fy, cx, cy = matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()
    if not (np.isfinite(matrix).all() and fx > 0 and fy > 0):
        raise DataError(place, f"{name} with the focal lengths {fx:g} and {fy:g}", "focal lengths above 0")
    if matrix[0, 1] != 0.0 or matrix[1, 0] != 0.0:
        raise DataError(place, f"{name} with a skew of {matrix[0, 1]:g}", "a skew of 0")
    return fx, fy, cx, cy


def _binned(centre: float, joined: int) -> float:
    """A position in the image whose pixels are joined; (0, 0) is the centre of the first pixel in both."""
    return (centre + 0.5) / joined - 0.5


def _coefficients(place: str, info: CameraInfo) -> tuple[float, ...]:
    """The distortion coefficients of the model; none of a lens without distortion."""
    if not np.isfinite(info.d).all():
        raise DataError(place, "distortion with NaN or infinity", "finite coefficients")
    model, expected = info.model.lower(), f"{', '.join((*_RADTAN[:2], _EQUIDISTANT[0]))} or no distortion"
    if not any(info.d) and model not in _EQUIDISTANT:
        return ()
    if model not in (*_RADTAN, *_EQUIDISTANT):
        raise DataError(place, f"distortion model {info.model!r}", expected)
    counts = (_EQUIDISTANT_COUNT,) if model in _EQUIDISTANT else _RADTAN_COUNTS
    used = info.d[: max(counts)] if not any(info.d[max(counts) :]) else info.d
    if len(used) not in counts:
        found = f"{counted(len(info.d), 'coefficient')} of the model {info.model!r}"
        raise DataError(place, found, f"{' or '.join(map(str, counts))} coefficients")
    return used


def _notes(place: str, info: CameraInfo, *, rectified: bool) -> tuple[str, ...]:
    if not rectified:
        return ()
    turned = np.abs(np.array(info.r) - np.eye(3).ravel()).max() > _ROTATION_TOLERANCE and any(info.r)
    frame = ", and the frame of the images is taken as that of the rectified camera" if turned else ""
    used = f"{place}: the name of the image topic says that the images are rectified, so P is used and not K{frame}"
    baseline_m = -info.p[3] / info.p[0]
    beside = (
        f"{place}: by P, this is the second camera of a pair, {baseline_m:.4g} m beside the first; the frame of the "
        "images is taken as its own, not as that of the first camera"
    )
    return (used, *((beside,) if baseline_m else ()))


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
_DEPTH_NAME = re.compile(r"(?:^|[/_])depths?(?:[/_]|image|map|$)", re.IGNORECASE)
"""A word of the name of a topic."""
UNNAMED_DEPTH = ("mono16", "png")
"""Beginnings of encodings and formats that images of 16 bits and depth maps have alike."""
_TRANSPORTS = ("compressed", "compressedDepth")
_STATIC = "tf_static"
_SHOWN = 20


@dataclass(frozen=True, slots=True)
class Wanted:
    """Topics that the user names; None for those that are to be found. A depth topic of "" means no depth."""

    # image, depth, camera_info, pose: names of topics
    image: str | None = None
    depth: str | None = None
    camera_info: str | None = None
    pose: str | None = None
    # second, second_info: of the images and intrinsics of a second camera; None for no second camera
    second: str | None = None
    second_info: str | None = None
    # whether intrinsics, those of the second camera, and poses come from somewhere else
    intrinsics_given: bool = False
    second_intrinsics_given: bool = False
    poses_elsewhere: bool = False


@dataclass(frozen=True, slots=True)
class Chosen:
    """The topics that are read."""

    # image, depth, camera_info: of images, depths and intrinsics; None where there are none
    image: Topic
    depth: Topic | None
    camera_info: Topic | None
    depth_info: Topic | None  # of the intrinsics beside the depths; None where there are none
    pose: Topic | None  # of poses; may be one of transforms; None where poses come from somewhere else
    # transforms, static_transforms: all topics of transforms
    transforms: tuple[Topic, ...]
    static_transforms: tuple[Topic, ...]
    # second, second_info: of the images and intrinsics of a second camera; None where there is none
    second: Topic | None
    second_info: Topic | None


def choose_topics(bag: Bag, wanted: Wanted) -> Chosen:
    """Find the topic of each kind: the one that the user names, or the only one."""
    filled = [topic for topic in bag.topics.values() if topic.count]
    moving = tuple(topic for topic in _of_kinds(filled, [TRANSFORMS]) if not topic.name.endswith(_STATIC))
    static = tuple(topic for topic in _of_kinds(filled, [TRANSFORMS]) if topic.name.endswith(_STATIC))
    pictures = _of_kinds(filled, _IMAGE_KINDS)
    deep = {topic.name for topic in pictures if _is_depth(bag, topic)}
    second = None if wanted.second is None else _named(bag, "second_image_topic", wanted.second, _IMAGE_KINDS)
    image = _image(bag, wanted, [topic for topic in pictures if topic.name not in deep])
    depth = _depth(bag, wanted.depth, [topic for topic in pictures if topic.name in deep], image)
    infos = _of_kinds(filled, [CAMERA_INFO])
    if second is not None and second.name == image.name:
        raise DataError(bag.path, f"{second.name} as images of both cameras", "a topic of each")
    of_second = [] if second is None else _beside(second, infos)
    of_first = [info for info in infos if info not in of_second]
    return Chosen(
        image=image,
        depth=depth,
        depth_info=None if depth is None else next(iter(_beside(depth, infos)), None),
        camera_info=None if wanted.intrinsics_given else _camera_info(bag, wanted.camera_info, image, of_first),
        pose=None
        if wanted.poses_elsewhere
        else _only(
            bag, "pose_topic", wanted.pose, [*_of_kinds(filled, POSE_KINDS), *moving], (*POSE_KINDS, TRANSFORMS)
        ),
        transforms=moving,
        static_transforms=static,
        second=second,
        second_info=None
        if second is None or wanted.second_intrinsics_given
        else _camera_info(bag, wanted.second_info, second, of_second, "second_"),
    )


def listing(topics: Iterable[Topic]) -> str:
    """Topics with their types and counts in one line."""
    shown = [f"{topic.name} ({topic.kind or 'several types'}, {topic.count})" for topic in topics]
    more = f" and {len(shown) - _SHOWN} more" if len(shown) > _SHOWN else ""
    return ", ".join(shown[:_SHOWN]) + more if shown else "no topics"


def _of_kinds(topics: Iterable[Topic], kinds: Iterable[str]) -> list[Topic]:
    return [topic for topic in topics if topic.kind in kinds]


def _is_depth(bag: Bag, topic: Topic) -> bool:
    """Whether the first message of a topic of images is a depth map: by its encoding, or of 16 bits by the name."""
    written = _encoding(bag, topic)
    if "compresseddepth" in written or written.startswith(_DEPTH_ENCODINGS):
        return True
    if not (written.startswith(UNNAMED_DEPTH) and _DEPTH_NAME.search(topic.name)):
        return False
    return topic.kind == IMAGE or _has_16_bits(bag, topic)


def _encoding(bag: Bag, topic: Topic) -> str:
    """Encoding of the first message of a topic, or the format of its file, in small letters."""
    _, first = next(bag.messages(topic.name))
    return str(first.encoding if topic.kind == IMAGE else first.format).lower()


def _has_16_bits(bag: Bag, topic: Topic) -> bool:
    """Whether the first file of a topic of CompressedImage is a map of 16 bits; not one that is damaged."""
    _, first = next(bag.messages(topic.name))
    try:
        pixels = decode_image(f"{bag.path} {topic.name}", bytes(first.data), cv2.IMREAD_UNCHANGED)
    except DataError:
        return False
    return pixels.dtype == np.uint16 and pixels.ndim == 2


def _image(bag: Bag, wanted: Wanted, images: list[Topic]) -> Topic:
    """The only one that is no depth. Of several, those of 16 bits may be depth: the message says how to state it."""
    candidates = [topic for topic in images if topic.name not in (wanted.depth, wanted.second)]
    wide = [topic for topic in candidates if _encoding(bag, topic).startswith(UNNAMED_DEPTH[0])]
    if wanted.image is not None or len(candidates) < 2 or not wide or wanted.depth is not None:
        return _only(bag, "image_topic", wanted.image, candidates, _IMAGE_KINDS)
    narrow = [topic for topic in candidates if topic not in wide]
    image_option = with_option("image_topic", (narrow or wide)[0].name)
    depth_option = with_option("depth_topic", wide[0].name)
    raise DataError(
        bag.path,
        listing(candidates),
        f"one topic of images; choose it with {image_option}; if {wide[0].name} is depth, {depth_option}",
    )


def _depth(bag: Bag, name: str | None, deep: list[Topic], image: Topic) -> Topic | None:
    """In the frame of the images, or the only one."""
    depths = [topic for topic in deep if topic.name != image.name]
    if name == "" or (name is None and not depths):
        return None
    aligned = [topic for topic in depths if _frame(bag, topic) == _frame(bag, image)]
    return _only(bag, "depth_topic", name, aligned or depths, _IMAGE_KINDS)


def _frame(bag: Bag, topic: Topic) -> str:
    """Frame that the first message of a topic names."""
    _, first = next(bag.messages(topic.name))
    return str(first.header.frame_id)


def _camera_info(bag: Bag, name: str | None, image: Topic, infos: list[Topic], of: str = "") -> Topic:
    """Beside the images, as ROS has it, or the only one. `of`: with what names of options begin."""
    siblings = _beside(image, infos)
    if name is None and not infos:
        beside = f" beside {image.name}" if of else ""
        needed = f"one topic of {CAMERA_INFO}{beside}, or {with_option(f'{of}camera_file', 'FILE')}"
        raise DataError(bag.path, listing(bag.topics.values()), needed)
    return _only(bag, f"{of}camera_info_topic", name, siblings or infos, [CAMERA_INFO])


def _beside(topic: Topic, infos: list[Topic]) -> list[Topic]:
    """The intrinsics beside a topic of images, as ROS or a recording of librealsense has it; empty where none are."""
    parts = topic.name.split("/")
    if parts[-2:] == ["image", "data"]:
        beside = "/".join([*parts[:-2], "info", "camera_info"])
    else:
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
            needed += "; second_image_topic names that of a second camera" if option == "image_topic" else ""
        raise DataError(bag.path, found, needed)
    return fitting[0]


def _named(bag: Bag, option: str, name: str, kinds: Iterable[str]) -> Topic:
    topic = bag.topics.get(name)
    if topic is None or topic.kind not in kinds or not topic.count:
        found = f"no messages of {name}" if topic is None or not topic.count else f"{listing([topic])}"
        raise DataError(bag.path, f"{option} {name!r}: {found}", f"one of {listing(bag.topics.values())}")
    return topic


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """The transform of a child frame to its parent frame over time."""

    topic: str  # where it comes from
    # parent, child: names of the frames; the child's is "" where the messages do not have it
    parent: str
    child: str
    # stamped_ns, received_ns: (n,) int64, nanoseconds: in the messages' headers, and when they were received
    stamped_ns: NDArray[np.int64]
    received_ns: NDArray[np.int64]
    parent_from_child: NDArray[np.float64]  # (n, 4, 4) float64
    is_static: bool  # whether it holds at all times
    left_out: int  # how many messages held no pose


@dataclass(frozen=True, slots=True)
class _Sample:
    parent: str
    child: str
    stamped_ns: int
    values: tuple[float, ...]  # x y z qx qy qz qw


def pose_link(bag: Bag, topic: Topic) -> Link:
    """The poses of a topic."""
    links = transform_links(bag, topic, moving=True)
    if len(links) != 1:
        pairs = ", ".join(f"{link.child or '(no name)'} in {link.parent}" for link in links)
        raise DataError(f"{bag.path} {topic.name}", f"poses of several frames: {pairs}", "poses of one frame")
    return links[0]


def transform_links(bag: Bag, topic: Topic, *, moving: bool) -> list[Link]:
    """The transforms of a topic of tf or of poses. One of tf that never changes is static, whatever its topic."""
    samples: dict[tuple[str, str], list[tuple[int, _Sample]]] = {}
    for position, message in bag.messages(topic.name):
        for sample in _samples(topic.kind, message):
            samples.setdefault((sample.parent, sample.child), []).append((position.received_ns, sample))
    place = f"{bag.path} {topic.name}"
    constant = topic.kind == TRANSFORMS
    return [_link(place, topic.name, of_pair, moving=moving, constant=constant) for of_pair in samples.values()]


def _link(place: str, topic: str, samples: list[tuple[int, _Sample]], *, moving: bool, constant: bool) -> Link:
    values = np.array([sample.values for _, sample in samples])
    usable = np.isfinite(values).all(axis=1) & values[:, 3:].any(axis=1)
    places = [f"{place} message {index}" for index in np.flatnonzero(usable)]
    poses = quaternion_poses(values[usable, :3], values[usable, 3:], places)
    never_changes = constant and len(poses) > 0 and not np.ptp(poses, axis=0).any()
    kept = slice(None) if moving else slice(-1, None)
    return Link(
        topic,
        samples[0][1].parent,
        samples[0][1].child,
        np.array([sample.stamped_ns for _, sample in samples])[usable][kept],
        np.array([received_ns for received_ns, _ in samples])[usable][kept],
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
