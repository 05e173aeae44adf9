"""A sequence in 7-Scenes' layout that can be measured: a textured wall, seen by a camera that moves right."""

from pathlib import Path

import cv2
import numpy as np

SIZE = (96, 128)
"""Rows and columns, px."""
N_FRAMES = 4


def write_wall(folder: Path) -> None:
    """Write the sequence. At 0.117 m and a focal length of 117 px, 1 mm is 1 px: the wall moves by 2 px a frame."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.integers(0, 256, (SIZE[0], SIZE[1] + 40), dtype=np.uint8), (0, 0), 1.2)
    wall = cv2.normalize(wall, None, 0, 255, cv2.NORM_MINMAX)
    depth = np.full(SIZE, 117, np.uint16)
    for i in range(N_FRAMES):
        pose = np.eye(4)
        pose[0, 3] = i * 2e-3
        cv2.imwrite(str(folder / f"frame-{i:06d}.color.png"), wall[:, 2 * i : 2 * i + SIZE[1]])
        cv2.imwrite(str(folder / f"frame-{i:06d}.depth.png"), depth)
        np.savetxt(folder / f"frame-{i:06d}.pose.txt", pose)
    np.savetxt(folder / "camera-intrinsics.txt", [[117, 0, 63.5], [0, 117, 47.5], [0, 0, 1]])
