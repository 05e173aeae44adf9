"""Writes sequences as the KITTI odometry benchmark publishes them. It shares no code with the reader."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

BASELINES_M = (0.0, 0.54, 0.06, -0.47)
"""Where the cameras are along x of camera 0: X_k = X_0 - baseline."""
CAMERA0_FROM_VELODYNE = np.array(
    [[0.0, -1.0, 0.0, 0.01], [0.0, 0.0, -1.0, -0.05], [1.0, 0.0, 0.0, -0.3], [0.0, 0.0, 0.0, 1.0]]
)


def row(values: np.ndarray) -> str:
    return " ".join(f"{value:.17g}" for value in np.asarray(values).ravel())


def write_kitti_odometry(
    root: Path,
    images: Sequence[np.ndarray],
    world_from_camera0: np.ndarray,
    *,
    intrinsics: Sequence[float],
    name: str = "00",
    camera: int = 0,
) -> Path:
    """Write one sequence, with the images of one camera. Returns its folder."""
    folder = root / "sequences" / name
    (folder / f"image_{camera}").mkdir(parents=True)
    (root / "poses").mkdir(exist_ok=True)
    for index, image in enumerate(images):
        assert cv2.imwrite(str(folder / f"image_{camera}" / f"{index:06d}.png"), image)
    fx, fy, cx, cy = intrinsics
    lines = []
    for number, baseline in enumerate(BASELINES_M):
        P = np.array([[fx, 0.0, cx, -fx * baseline], [0.0, fy, cy, 0.0], [0.0, 0.0, 1.0, 0.0]])
        lines.append(f"P{number}: {row(P)}")
    lines.append(f"Tr: {row(CAMERA0_FROM_VELODYNE[:3])}")
    (folder / "calib.txt").write_text("\n".join(lines) + "\n")
    (folder / "times.txt").write_text("".join(f"{0.1036 * index:e}\n" for index in range(len(images))))
    rows = "".join(f"{row(pose[:3])}\n" for pose in world_from_camera0)
    (root / "poses" / f"{name}.txt").write_text(rows)
    return folder
