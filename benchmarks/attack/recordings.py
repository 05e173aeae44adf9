"""Small valid bags, reconstructions of COLMAP and data sets of nerfstudio."""

import json
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

SIZE = (24, 16)
_FRAMES = 2
_TRANSFORMS = "tf2_msgs/msg/TFMessage"


def bags(folder: Path) -> None:
    """Bags of all three kinds, with images, depths, intrinsics and tf; chunks are compressed in the first."""
    folder.mkdir()
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", _TRANSFORMS))
    ros1 = Ros1Writer(folder / "one.bag")
    ros1.set_compression(Ros1Writer.CompressionFormat.LZ4)
    _write(ros1, store, ros1=True)
    for plugin in (StoragePlugin.SQLITE3, StoragePlugin.MCAP):
        writer = Ros2Writer(folder / plugin.name.lower(), version=9, storage_plugin=plugin)
        _write(writer, get_typestore(Stores.ROS2_HUMBLE), ros1=False)


def colmap(folder: Path) -> None:
    """The same reconstruction in both formats, with images and depth maps."""
    for kind in ("text", "binary"):
        (folder / kind / "images").mkdir(parents=True)
        (folder / kind / "stereo" / "depth_maps").mkdir(parents=True)
        for index in range(_FRAMES):
            cv2.imwrite(str(folder / kind / "images" / f"{index}.png"), _picture(index))
            depth = b"24&16&1&" + np.full(SIZE, 2.0, "<f4").tobytes()
            (folder / kind / "stereo" / "depth_maps" / f"{index}.png.geometric.bin").write_bytes(depth)
    (folder / "text" / "cameras.txt").write_text("# cameras\n1 OPENCV 24 16 20 20 12 8 0.01 0.001 0 0\n")
    lines = [f"{index + 1} 1 0 0 0 {index} 0 0 1 {index}.png\n3.0 4.0 -1\n" for index in range(_FRAMES)]
    (folder / "text" / "images.txt").write_text("# images\n" + "".join(lines))
    camera = struct.pack("<QiiQQ8d", 1, 1, 4, 24, 16, 20, 20, 12, 8, 0.01, 0.001, 0, 0)
    (folder / "binary" / "cameras.bin").write_bytes(camera)
    images = [
        struct.pack("<i7di", index + 1, 1, 0, 0, 0, index, 0, 0, 1) + f"{index}.png\0".encode() + bytes(8)
        for index in range(_FRAMES)
    ]
    (folder / "binary" / "images.bin").write_bytes(struct.pack("<Q", _FRAMES) + b"".join(images))


def nerfstudio(folder: Path) -> None:
    """Images, depths and a file with intrinsics of all frames and of one."""
    folder.mkdir()
    frames = []
    for index in range(_FRAMES):
        cv2.imwrite(str(folder / f"{index}.png"), _picture(index))
        cv2.imwrite(str(folder / f"depth{index}.png"), np.full(SIZE[::-1], 2000, np.uint16))
        pose = np.eye(4)
        pose[0, 3] = index
        frames.append(
            {"file_path": f"{index}.png", "depth_file_path": f"depth{index}.png", "transform_matrix": pose.tolist()}
        )
    frames[1]["fl_x"] = 21.0
    common = {"camera_model": "OPENCV", "fl_x": 20.0, "cx": 12.0, "w": 24, "h": 16, "k1": 0.01, "frames": frames}
    (folder / "transforms.json").write_text(json.dumps(common))


def _picture(index: int) -> np.ndarray:
    return np.random.default_rng(index).integers(0, 256, SIZE[::-1], dtype=np.uint8)


def _write(writer: Any, store: Any, *, ros1: bool) -> None:
    with writer:
        connections: dict[str, Any] = {}
        for topic, kind, stamp_ns, message in _messages(store, ros1=ros1):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            raw = store.serialize_ros1(message, kind) if ros1 else store.serialize_cdr(message, kind)
            writer.write(connections[topic], stamp_ns, raw)


def _messages(store: Any, *, ros1: bool) -> list[tuple[str, str, int, Any]]:
    written = []
    for index in range(_FRAMES):
        stamp_ns = 10**9 + index * 50_000_000
        for topic, kind, fields in _contents(store, index, ros1=ros1):
            header = _header(store, stamp_ns, ros1=ros1)
            whole = {"transforms": [_transform(store, header, index)]} if kind == _TRANSFORMS else fields
            if kind != _TRANSFORMS:
                whole["header"] = header
            written.append((topic, kind, stamp_ns, store.types[kind](**whole)))
    return written


def _header(store: Any, stamp_ns: int, *, ros1: bool) -> Any:
    sec, nanosec = divmod(stamp_ns, 10**9)
    stamp = store.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    return store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="optical", **({"seq": 0} if ros1 else {}))


def _transform(store: Any, header: Any, index: int) -> Any:
    header.frame_id = "world"
    moved = store.types["geometry_msgs/msg/Transform"](
        translation=store.types["geometry_msgs/msg/Vector3"](x=float(index), y=0.0, z=0.0),
        rotation=store.types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
    )
    kind = "geometry_msgs/msg/TransformStamped"
    return store.types[kind](header=header, child_frame_id="optical", transform=moved)


def _contents(store: Any, index: int, *, ros1: bool) -> list[tuple[str, str, dict[str, Any]]]:
    width, height = SIZE
    shape = {"height": height, "width": width, "is_bigendian": 0}
    k = np.array([20.0, 0, 11.5, 0, 20.0, 7.5, 0, 0, 1.0])
    matrices = dict(zip("DKRP" if ros1 else "dkrp", (np.zeros(5), k, np.eye(3).ravel(), np.zeros(12)), strict=True))
    roi = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
    info = {
        "height": height,
        "width": width,
        "distortion_model": "plumb_bob",
        "binning_x": 0,
        "binning_y": 0,
        "roi": store.types["sensor_msgs/msg/RegionOfInterest"](**roi),
        **matrices,
    }
    depth = np.full((height, width), 2.0, "<f4").view(np.uint8).ravel()
    gray = {"encoding": "mono8", "step": width, "data": _picture(index).ravel()}
    return [
        ("/image", "sensor_msgs/msg/Image", {**shape, **gray}),
        ("/depth", "sensor_msgs/msg/Image", {**shape, "encoding": "32FC1", "step": 4 * width, "data": depth}),
        ("/camera_info", "sensor_msgs/msg/CameraInfo", info),
        ("/tf", _TRANSFORMS, {}),
    ]
