"""Tiny hand-made scenes in the layouts of the readers."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

IDENTITY_NED = "0 0 0 0 0 0 1"


def texture(width: int, height: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


@pytest.fixture
def write_sevenscenes() -> Callable[..., Path]:
    def write(folder: Path, *, frames: int = 3, size: tuple[int, int] = (640, 480), suffix: str = "png") -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        for index in range(frames):
            stem = folder / f"frame-{index:06d}"
            cv2.imwrite(f"{stem}.color.{suffix}", texture(*size, index))
            cv2.imwrite(f"{stem}.depth.png", np.full(size[::-1], 1500, np.uint16))
            pose = np.eye(4)
            pose[0, 3] = 0.1 * index
            np.savetxt(f"{stem}.pose.txt", pose)
        return folder

    return write


@pytest.fixture
def write_tartanair() -> Callable[..., Path]:
    def write(folder: Path, *, frames: int = 3, camera: str = "left", rows: int | None = None) -> Path:
        v1 = camera in ("left", "right")
        width, height = (640, 480) if v1 else (640, 640)
        images, depths = folder / f"image_{camera}", folder / f"depth_{camera}"
        images.mkdir(parents=True)
        depths.mkdir()
        depth = np.full((height, width), 2.5, "<f4")
        depth[0, 0] = 20_000.0
        for index in range(frames):
            cv2.imwrite(str(images / f"{index:06d}_{camera}.png"), texture(width, height, index))
            if v1:
                np.save(depths / f"{index:06d}_{camera}_depth.npy", depth)
            else:
                packed = depth.view(np.uint8).reshape(height, width, 4)
                cv2.imwrite(str(depths / f"{index:06d}_{camera}_depth.png"), packed)
        count = frames if rows is None else rows
        lines = [f"{0.5 * index} 0 0 0 0 0 1\n" for index in range(count)]
        (folder / f"pose_{camera}.txt").write_text("".join(lines))
        return folder

    return write
