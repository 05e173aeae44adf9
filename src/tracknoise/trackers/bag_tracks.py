"""Tracks in bags of ROS 1 and ROS 2: topics on which front ends publish the features of each image.

- VINS-Mono and its descendants: ``sensor_msgs/PointCloud`` with the channels id, u, v, or id, camera, u, v and more.
  Channels with names may have any order, and say what was seen: see `tracknoise.trackers.track_columns`.
- MSCKF-VIO: ``CameraMeasurement``, whose positions are normalised.
- OAK cameras: ``TrackedFeatures``.
- DL-VINS: ``FeatureObservations``.

Of several cameras the first counts, unless another is chosen. A message has the time of its image. Definitions of
messages are those of these packages; see `tracknoise.rosbag_files` for why those in bags are not used.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.parsing_child import LostError, call_in_child
from tracknoise.rosbag_files import Bag, bag_size
from tracknoise.trackers.imported_rows import Rows, whole_numbers
from tracknoise.trackers.track_columns import Selection, has_meaning, known_name, meant, unused_notes

_DEFINITIONS: Mapping[str, str] = {
    "msckf_vio/msg/FeatureMeasurement": "uint64 id\nfloat64 u0\nfloat64 v0\nfloat64 u1\nfloat64 v1",
    "msckf_vio/msg/CameraMeasurement": "std_msgs/Header header\nmsckf_vio/FeatureMeasurement[] features",
    "depthai_ros_msgs/msg/TrackedFeature": (
        "std_msgs/Header header\ngeometry_msgs/Point position\nuint32 id\nuint32 age\nfloat32 harris_score\n"
        "float32 tracking_error"
    ),
    "depthai_ros_msgs/msg/TrackedFeatures": "std_msgs/Header header\ndepthai_ros_msgs/TrackedFeature[] features",
    "dl_vins/msg/FeatureObservations": (
        "std_msgs/Header header\nuint32[] feature_ids\nuint32 num_features\n"
        "float64[] points_left_x\nfloat64[] points_left_y\nfloat64[] points_right_x\nfloat64[] points_right_y\n"
        "float64[] pixel_left_x\nfloat64[] pixel_left_y\nfloat64[] pixel_right_x\nfloat64[] pixel_right_y\n"
        "float64[] velocities_x\nfloat64[] velocities_y"
    ),
}
_NS = 10**9
_WITH_CAMERA = 6
"""A cloud with so many channels or more has the number of the camera in the second."""


@dataclass(frozen=True, slots=True)
class _Seen:
    """Features of one image."""

    track: NDArray[np.floating | np.unsignedinteger]  # (n,): their numbers, of one type in all messages of a topic
    uv: NDArray[np.float64]  # (n, 2): positions
    response: NDArray[np.float32]  # (n,): of the detector; NaN where it is unknown
    quality: Mapping[str, NDArray[np.float32]]  # (n,): by name, the same names in all messages of a topic
    more: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)  # (n,): what else the message names
    several: bool = False  # whether another camera saw features too


def _plain(track: Any, *positions: Any) -> _Seen:
    """Features of which nothing but positions is known. Raises ValueError if there is not one for each."""
    lengths = [len(track), *map(len, positions)]
    if len(set(lengths)) > 1:
        raise ValueError(f"{lengths[0]} numbers of features, and {lengths[1]} and {lengths[2]} coordinates")
    uv = np.column_stack([np.asarray(coordinate, dtype=np.float64) for coordinate in positions])
    return _Seen(track, uv, np.full(len(uv), np.nan, dtype=np.float32), {})


def _of_cloud(message: Any, camera: int | str | None) -> _Seen:
    channels = {channel.name.strip(): np.asarray(channel.values) for channel in message.channels}
    named = {known_name(name): values for name, values in channels.items()}
    if {"track", "u_px", "v_px"} <= named.keys():
        seen = _plain(named.pop("track"), named.pop("u_px"), named.pop("v_px"))
        more = {name: values.astype(np.float64) for name, values in named.items() if len(values) == len(seen.uv)}
        return replace(seen, more=more)
    values = [channel.values for channel in message.channels]
    if len(values) < 3:
        raise ValueError(f"a cloud of {len(values)} channels, which are not id, u and v")
    if len(values) < _WITH_CAMERA:
        return _plain(*(values[:3] if camera in (None, 0) else ((), (), ())))
    mine = np.asarray(values[1]) == (0 if camera is None else camera)
    track, u, v = (np.asarray(values[place])[mine] for place in (0, 2, 3))
    return replace(_plain(track, u, v), several=not mine.all())


def _of_msckf(message: Any, camera: int | str | None) -> _Seen:
    features = message.features
    track = np.array([feature.id for feature in features], dtype=np.uint64)
    names = ("u1", "v1") if camera == 1 else ("u0", "v0")
    return replace(_plain(track, *([getattr(feature, name) for feature in features] for name in names)), several=True)


def _of_oak(message: Any, camera: int | str | None) -> _Seen:
    features = message.features
    track = np.array([feature.id for feature in features], dtype=np.uint32)
    seen = _plain(track, *([getattr(feature.position, name) for feature in features] for name in "xy"))
    scores, errors = (
        np.array([getattr(feature, name) for feature in features], dtype=np.float32)
        for name in ("harris_score", "tracking_error")
    )
    return _Seen(seen.track, seen.uv, scores, {"tracking_error": errors})


def _of_dl_vins(message: Any, camera: int | str | None) -> _Seen:
    if camera == 1:
        return replace(_plain(message.feature_ids, message.pixel_right_x, message.pixel_right_y), several=True)
    seen = _plain(message.feature_ids, message.pixel_left_x, message.pixel_left_y)
    return replace(seen, several=len(message.pixel_right_x) > 0)


_KINDS: Mapping[str, Callable[[Any, int | str | None], _Seen]] = {
    "sensor_msgs/msg/PointCloud": _of_cloud,
    "msckf_vio/msg/CameraMeasurement": _of_msckf,
    "depthai_ros_msgs/msg/TrackedFeatures": _of_oak,
    "dl_vins/msg/FeatureObservations": _of_dl_vins,
}
_CAMERAS: Mapping[str, tuple[int, ...]] = {
    "msckf_vio/msg/CameraMeasurement": (0, 1),
    "depthai_ros_msgs/msg/TrackedFeatures": (0,),
    "dl_vins/msg/FeatureObservations": (0, 1),
}
"""The cameras of messages whose definition says how many there are."""


def read_bag(path: Path, chosen: Selection) -> Rows:
    """Read the tracks of one topic, in a process of its own, because a damaged bag may take all memory.

    `path`: file or folder of the bag; `chosen`: the topic, None for the only one that has tracks, and the camera.
    """
    try:
        return call_in_child(_read, path, chosen, size=bag_size(path))
    except LostError as error:
        raise DataError(path, f"a damaged bag ({error})", "a bag that can be read") from error


def _read(path: Path, chosen: Selection) -> Rows:
    bag = Bag(path, _DEFINITIONS)
    name = _chosen(bag, chosen.topic)
    kind = bag.topics[name].kind
    cameras = _CAMERAS.get(kind)
    if cameras is not None and chosen.camera not in (None, *cameras):
        raise DataError(f"{path} {name}", f"no camera {chosen.camera}", f"one of {', '.join(map(str, cameras))}")
    read = _KINDS[kind]
    seen: list[_Seen] = []
    times: list[int] = []
    for place, (_, message) in enumerate(bag.messages(name)):
        try:
            seen.append(read(message, chosen.camera))
        except ValueError as error:
            raise DataError(
                f"{path} {name}: message {place + 1}", str(error), "one position for each feature"
            ) from None
        stamp = message.header.stamp
        times.append(int(stamp.sec) * _NS + int(stamp.nanosec))
    counts = [len(features.uv) for features in seen]
    if not sum(counts):
        of_camera = "" if chosen.camera is None else f" of camera {chosen.camera}"
        raise DataError(f"{path} {name}", f"no feature{of_camera}", "at least one")
    uv = np.concatenate([features.uv for features in seen])

    def message_of(row: int) -> str:
        return f"{path} {name}: message {np.searchsorted(np.cumsum(counts), row, side='right') + 1}"

    more = {key for features in seen if len(features.uv) for key in features.more}
    columns = {
        key: np.concatenate([features.more.get(key, np.full(len(features.uv), np.nan)) for features in seen])
        for key in more
    }
    meaning = meant(
        path,
        {key: pl.Series(values) for key, values in sorted(columns.items()) if has_meaning(key)},
        len(uv),
        chosen if more else replace(chosen, camera=None),
        message_of,
    )
    seen_there = meaning.mine if meaning.seen is None else meaning.mine & meaning.seen
    bad = ~np.isfinite(uv).all(axis=1) & seen_there
    if bad.any():
        raise DataError(f"{path} {name}", f"a position {uv[bad][0].tolist()}", "finite numbers")
    if not seen_there.any():
        raise DataError(f"{path} {name}", "no feature that was seen", "at least one")
    unused = (*meaning.unused, *sorted(key for key in columns if not has_meaning(key)))
    left_out = f"features of camera {chosen.camera or 0} are read: camera = ... chooses another"
    rows = Rows(
        path,
        whole_numbers(message_of, np.concatenate([features.track for features in seen]), "id"),
        uv,
        time_ns=np.repeat(np.array(times, dtype=np.int64), counts),
        response=np.concatenate([features.response for features in seen]),
        quality={key: np.concatenate([features.quality[key] for features in seen]) for key in seen[0].quality},
        seen=meaning.seen,
        notes=(
            *meaning.notes,
            *unused_notes(path, unused),
            *((left_out,) if chosen.camera is None and any(features.several for features in seen) else ()),
        ),
    )
    return rows if meaning.mine.all() else rows.where(meaning.mine)


def _chosen(bag: Bag, topic: str | None) -> str:
    """The topic that is asked for, or the only one that has tracks."""
    fitting = [name for name, entry in bag.topics.items() if entry.kind in _KINDS]
    if topic is None and len(fitting) == 1:
        return fitting[0]
    if topic in fitting:
        return topic
    kinds = ", ".join(sorted(kind.replace("/msg/", "/") for kind in _KINDS))
    found = f"topics of tracks {', '.join(fitting)}" if fitting else f"no topic of the types {kinds}"
    if topic is None:
        raise DataError(bag.path, found, "one, or topic = ... among the options" if fitting else "one of these")
    raise DataError(bag.path, f"no topic of tracks {topic}; {found}", "the name of one of these")
