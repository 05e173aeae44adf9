"""Writes bags with the library `rosbags`: ROS 1, and ROS 2 in both storages. Knows nothing of the reader."""

from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

SECOND_NS = 10**9


class Format(StrEnum):
    ros1 = "bag"
    sqlite = "db3"
    mcap = "mcap"


class BagWriter:
    """Writes messages, which are stamped in nanoseconds, and received 3 ms later unless it is said when."""

    def __init__(self, path: Path, kind: Format, *, compression: str = "") -> None:
        self.path, self.kind = path.with_suffix(".bag") if kind is Format.ros1 else path, kind
        self.ros1 = kind is Format.ros1
        self.store = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.ROS2_HUMBLE)
        if self.ros1:
            transforms = get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
            self.store.register(transforms)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.connections: dict[str, Any] = {}
        self.stack = ExitStack()
        self.writer = self._writer(compression)

    def _writer(self, compression: str) -> Any:
        if self.ros1:
            writer = Ros1Writer(self.path)
            if compression:
                writer.set_compression(Ros1Writer.CompressionFormat[compression.upper()])
            return writer
        plugin = StoragePlugin.MCAP if self.kind is Format.mcap else StoragePlugin.SQLITE3
        writer = Ros2Writer(self.path, version=9, storage_plugin=plugin)
        if compression:
            writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
        return writer

    def __enter__(self) -> Self:
        self.stack.enter_context(self.writer)
        return self

    def __exit__(self, *caught: object) -> None:
        self.stack.__exit__(*caught)

    def write(self, topic: str, message: Any, received_ns: int) -> None:
        kind = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        raw = self.store.serialize_ros1(message, kind) if self.ros1 else self.store.serialize_cdr(message, kind)
        self.writer.write(self.connections[topic], received_ns, raw)

    def make(self, kind: str, **fields: Any) -> Any:
        return self.store.types[kind](**fields)

    def header(self, stamp_ns: int, frame: str) -> Any:
        sec, nanosec = divmod(stamp_ns, SECOND_NS)
        stamp = self.make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
        sequence = {"seq": 0} if self.ros1 else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **sequence)

    def image(
        self, topic: str, stamp_ns: int, frame: str, encoding: str, pixels: np.ndarray, *, padding: int = 0, **at: int
    ) -> None:
        """Rows of any type, with bytes behind each row."""
        rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(pixels.shape[0], -1)
        rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=77)
        message = self.make(
            "sensor_msgs/msg/Image",
            header=self.header(stamp_ns, frame),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=int(pixels.dtype.byteorder == ">"),
            step=rows.shape[1],
            data=rows.ravel(),
        )
        self.write(topic, message, at.get("received_ns", stamp_ns + 3_000_000))

    def compressed(self, topic: str, stamp_ns: int, frame: str, format_: str, data: bytes) -> None:
        message = self.make(
            "sensor_msgs/msg/CompressedImage",
            header=self.header(stamp_ns, frame),
            format=format_,
            data=np.frombuffer(data, np.uint8),
        )
        self.write(topic, message, stamp_ns + 3_000_000)

    def camera_info(self, topic: str, stamp_ns: int, frame: str, *, size: tuple[int, int], **said: Any) -> None:
        """`k` has four numbers fx, fy, cx, cy; the rest are as in the message."""
        fx, fy, cx, cy = said["k"]
        k = np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1.0])
        p = said.get("p", np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1.0, 0]))
        d, r = np.array(said.get("d", [0.0] * 5)), np.array(said.get("r", np.eye(3).ravel()))
        left, top, width, height = said.get("roi", (0, 0, 0, 0))
        matrices = dict(zip("DKRP" if self.ros1 else "dkrp", (d, k, r, p), strict=True))
        roi = self.make(
            "sensor_msgs/msg/RegionOfInterest",
            x_offset=left,
            y_offset=top,
            width=width,
            height=height,
            do_rectify=False,
        )
        message = self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(stamp_ns, frame),
            width=size[0],
            height=size[1],
            distortion_model=said.get("model", "plumb_bob"),
            binning_x=said.get("binning", (0, 0))[0],
            binning_y=said.get("binning", (0, 0))[1],
            roi=roi,
            **matrices,
        )
        self.write(topic, message, stamp_ns + 3_000_000)

    def _values(self, pose: np.ndarray) -> tuple[Any, Any]:
        x, y, z = pose[:3, 3].tolist()
        qx, qy, qz, qw = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
        return (x, y, z), self.make("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw)

    def pose(self, pose: np.ndarray) -> Any:
        (x, y, z), rotation = self._values(pose)
        point = self.make("geometry_msgs/msg/Point", x=x, y=y, z=z)
        return self.make("geometry_msgs/msg/Pose", position=point, orientation=rotation)

    def transform(self, stamp_ns: int, parent: str, child: str, pose: np.ndarray) -> Any:
        (x, y, z), rotation = self._values(pose)
        vector = self.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)
        moved = self.make("geometry_msgs/msg/Transform", translation=vector, rotation=rotation)
        header = self.header(stamp_ns, parent)
        return self.make("geometry_msgs/msg/TransformStamped", header=header, child_frame_id=child, transform=moved)

    def tf(self, topic: str, stamp_ns: int, *transforms: tuple[str, str, np.ndarray]) -> None:
        messages = [self.transform(stamp_ns, *transform) for transform in transforms]
        self.write(topic, self.make("tf2_msgs/msg/TFMessage", transforms=messages), stamp_ns + 3_000_000)

    def posed(self, topic: str, stamp_ns: int, kind: str, parent: str, child: str, pose: np.ndarray) -> None:
        """A PoseStamped, PoseWithCovarianceStamped, TransformStamped or Odometry message."""
        header = self.header(stamp_ns, parent)
        if kind == "TransformStamped":
            message = self.transform(stamp_ns, parent, child, pose)
        elif kind == "PoseStamped":
            message = self.make("geometry_msgs/msg/PoseStamped", header=header, pose=self.pose(pose))
        else:
            uncertain = self.make("geometry_msgs/msg/PoseWithCovariance", pose=self.pose(pose), covariance=np.zeros(36))
            if kind == "PoseWithCovarianceStamped":
                message = self.make("geometry_msgs/msg/PoseWithCovarianceStamped", header=header, pose=uncertain)
            else:
                still = self.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
                twist = self.make("geometry_msgs/msg/Twist", linear=still, angular=still)
                uncertain_twist = self.make(
                    "geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)
                )
                message = self.make(
                    "nav_msgs/msg/Odometry", header=header, child_frame_id=child, pose=uncertain, twist=uncertain_twist
                )
        self.write(topic, message, stamp_ns + 3_000_000)


def png(pixels: np.ndarray) -> bytes:
    done, encoded = cv2.imencode(".png", pixels)
    assert done
    return encoded.tobytes()
