"""Writes recordings as 7-Scenes publishes them: one Kinect with two cameras. It shares no code with the reader.

The depth camera looks at a wall. Its depth maps, its poses and the poses from structure from motion are those of the
geometry below, which a test can compute again for any pixel.
"""

from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

SIZE = (640, 480)
DEPTH_MATRIX = np.array([[585.0, 0.0, 320.0], [0.0, 585.0, 240.0], [0.0, 0.0, 1.0]])
DEPTH_TO_COLOUR = np.array(
    [
        [9.9996518012567637e-01, 2.6765126468950343e-03, -7.9041012313000904e-03, -2.5558943178152542e-02],
        [-2.7409311281316700e-03, 9.9996302803027592e-01, -8.1504520778013286e-03, 1.0109636268061706e-04],
        [7.8819942130445332e-03, 8.1718328771890631e-03, 9.9993554558014031e-01, 2.0318321729487039e-03],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
"""As printed by those who measured it, with all digits."""
WALL_NORMAL, WALL_DISTANCE_M = np.array([0.2, -0.1, np.sqrt(0.95)]), 2.0
"""Points of the wall: normal . point = distance, in the world."""


def colour_poses(count: int) -> np.ndarray:
    """world_from_colour, (count, 4, 4)."""
    poses = np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
    for index, pose in enumerate(poses):
        pose[:3, :3] = Rotation.from_rotvec([0.02 * index, -0.03 * index, 0.01 * index]).as_matrix()
        pose[:3, 3] = (0.03 * index, 0.01 * index, -0.02 * index)
    return poses


def depth_poses(count: int) -> np.ndarray:
    """world_from_depth, (count, 4, 4)."""
    return colour_poses(count) @ DEPTH_TO_COLOUR


def wall_depth(matrix: np.ndarray, world_from_camera: np.ndarray, size: tuple[int, int] = SIZE) -> np.ndarray:
    """Depth of the wall in every pixel, (height, width), metres."""
    columns, rows = np.meshgrid(np.arange(size[0], dtype=float), np.arange(size[1], dtype=float))
    rays = np.stack([columns, rows, np.ones_like(rows)], axis=-1) @ np.linalg.inv(matrix).T
    ahead = rays @ (world_from_camera[:3, :3].T @ WALL_NORMAL)
    return (WALL_DISTANCE_M - WALL_NORMAL @ world_from_camera[:3, 3]) / ahead


def write_sevenscenes(folder: Path, count: int) -> Path:
    """A recording of the wall."""
    folder.mkdir(parents=True, exist_ok=True)
    texture = np.random.default_rng(0).integers(0, 256, (count, SIZE[1], SIZE[0], 3), dtype=np.uint8)
    for index, pose in enumerate(depth_poses(count)):
        stem = folder / f"frame-{index:06d}"
        assert cv2.imwrite(f"{stem}.color.png", texture[index])
        millimetres = np.rint(1000 * wall_depth(DEPTH_MATRIX, pose)).astype(np.uint16)
        assert cv2.imwrite(f"{stem}.depth.png", millimetres)
        np.savetxt(f"{stem}.pose.txt", pose, delimiter="\t")
    return folder


def write_sfm(path: Path, poses: Mapping[str, np.ndarray], focal_px: float) -> Path:
    """Rows of world_to_camera poses, by names of images such as ``seq-01/frame-000000.color.png``."""
    rows = []
    for name, world_from_colour in poses.items():
        inverse = np.linalg.inv(world_from_colour)
        x, y, z, w = Rotation.from_matrix(inverse[:3, :3]).as_quat()
        values = " ".join(f"{value:.12g}" for value in (w, x, y, z, *inverse[:3, 3]))
        rows.append(f"{name} {values} {focal_px}\n")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(rows))
    return path
