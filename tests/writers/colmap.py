"""Writes reconstructions in COLMAP's text and binary formats. Knows nothing of the reader."""

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

MODELS = [
    "SIMPLE_PINHOLE",
    "PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "OPENCV",
    "OPENCV_FISHEYE",
    "FULL_OPENCV",
    "FOV",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
    "THIN_PRISM_FISHEYE",
    "RAD_TAN_THIN_PRISM_FISHEYE",
    "SIMPLE_DIVISION",
    "DIVISION",
    "SIMPLE_FISHEYE",
    "FISHEYE",
    "EUCM",
]
Camera = tuple[str, int, int, Sequence[float]]
"""Model, width, height, parameters."""


def _values(world_from_camera: np.ndarray) -> list[float]:
    """qw qx qy qz tx ty tz of the inverse."""
    inverse = np.linalg.inv(world_from_camera)
    x, y, z, w = Rotation.from_matrix(inverse[:3, :3]).as_quat()
    return [w, x, y, z, *inverse[:3, 3]]


def write_text(folder: Path, cameras: Mapping[int, Camera], images: Mapping[str, tuple[int, np.ndarray]]) -> None:
    """`images` are the camera's number and the pose by name; every other one has points."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["# Camera list with one line of data per camera:"]
    for number, (model, width, height, parameters) in cameras.items():
        lines.append(f"{number} {model} {width} {height} {' '.join(repr(float(value)) for value in parameters)}")
    (folder / "cameras.txt").write_text("\n".join(lines) + "\n")
    lines = [
        "# Image list with two lines of data per image:",
        "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME",
    ]
    for number, (name, (camera, pose)) in enumerate(images.items(), start=1):
        lines.append(f"{number} {' '.join(repr(float(value)) for value in _values(pose))} {camera} {name}")
        lines.append("10.5 20.25 -1 3.0 4.0 7" if number % 2 else "")
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    (folder / "points3D.txt").write_text("# empty\n")


def write_binary(folder: Path, cameras: Mapping[int, Camera], images: Mapping[str, tuple[int, np.ndarray]]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    content = struct.pack("<Q", len(cameras))
    for number, (model, width, height, parameters) in cameras.items():
        content += struct.pack("<iiQQ", number, MODELS.index(model), width, height)
        content += struct.pack(f"<{len(parameters)}d", *parameters)
    (folder / "cameras.bin").write_bytes(content)
    content = struct.pack("<Q", len(images))
    for number, (name, (camera, pose)) in enumerate(images.items(), start=1):
        content += struct.pack("<i7di", number, *_values(pose), camera) + name.encode() + b"\0"
        points = [(10.5, 20.25, -1), (3.0, 4.0, 7)] if number % 2 else []
        content += struct.pack("<Q", len(points)) + b"".join(struct.pack("<ddq", *point) for point in points)
    (folder / "images.bin").write_bytes(content)
    for name in ("points3D.bin", "rigs.bin", "frames.bin"):  # the last two since COLMAP 3.12
        (folder / name).write_bytes(struct.pack("<Q", 0))


def write_depth_map(path: Path, depth: np.ndarray) -> None:
    """As COLMAP's own scripts: the array of width x height x channels in Fortran order."""
    height, width = depth.shape
    path.parent.mkdir(parents=True, exist_ok=True)
    transposed = np.transpose(depth.astype("<f4")[..., None], (1, 0, 2))
    path.write_bytes(f"{width}&{height}&1&".encode() + transposed.reshape(-1, order="F").tobytes())
