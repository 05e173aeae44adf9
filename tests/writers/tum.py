"""Writes recordings as the TUM RGB-D benchmark publishes them. It shares no code with the reader."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

FREIBURG1 = (517.3, 516.5, 318.6, 255.3)


def stamp(time_s: float) -> str:
    return f"{time_s:.6f}"


def pose_row(time: str, pose: np.ndarray) -> str:
    """A time, the position and the quaternion, scalar last."""
    quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat()
    return " ".join([time, *(f"{value:.17g}" for value in (*pose[:3, 3], *quaternion))])


def write_poses(path: Path, times_s: Sequence[float], poses: np.ndarray) -> None:
    rows = [pose_row(stamp(time), pose) for time, pose in zip(times_s, poses, strict=True)]
    path.write_text("\n".join(["# ground truth trajectory", "# timestamp tx ty tz qx qy qz qw", *rows]) + "\n")


def write_list(folder: Path, kind: str, times_s: Sequence[float], images: Sequence[np.ndarray]) -> None:
    (folder / kind).mkdir(parents=True, exist_ok=True)
    lines = [f"# {kind} images", "# timestamp filename"]
    for time, image in zip(times_s, images, strict=True):
        name = f"{kind}/{stamp(time)}.png"
        assert cv2.imwrite(str(folder / name), image)
        lines.append(f"{stamp(time)} {name}")
    (folder / f"{kind}.txt").write_text("\n".join(lines) + "\n")


def write_tum(
    folder: Path,
    images: Sequence[np.ndarray],
    poses: np.ndarray,
    *,
    depths: Sequence[np.ndarray] = (),
    start_s: float = 1305031241.0,
    rate_hz: float = 30.0,
    depth_delay_s: float = 0.005,
    units_per_metre: float = 5000.0,
) -> np.ndarray:
    """Write one recording whose poses are those of its images. Returns the times of the images, s."""
    times_s = np.round(start_s + np.arange(len(images)) / rate_hz, 6)
    write_list(folder, "rgb", times_s, images)
    if len(depths):
        units = [np.rint(depth * units_per_metre).astype(np.uint16) for depth in depths]
        write_list(folder, "depth", times_s + depth_delay_s, units)
    write_poses(folder / "groundtruth.txt", times_s, poses)
    return times_s
