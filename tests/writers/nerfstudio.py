"""Writes nerfstudio's transforms.json. Knows nothing of the reader."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np


def opengl_pose(world_from_camera: np.ndarray) -> list[list[float]]:
    """Columns of the rotation are right, up and back."""
    right, down, forward, centre = world_from_camera[:3].T
    return [*np.stack([right, -down, -forward, centre], axis=1).tolist(), [0.0, 0.0, 0.0, 1.0]]


def write_transforms(
    folder: Path, names: Sequence[str], poses: np.ndarray, *, name: str = "transforms.json", **common: Any
) -> None:
    """`frames` in common are further entries of each frame."""
    further = common.pop("frames", [{} for _ in names])
    frames = [
        {"file_path": file, "transform_matrix": opengl_pose(pose), **more}
        for file, pose, more in zip(names, poses, further, strict=True)
    ]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(json.dumps({**common, "frames": frames}, indent=1))
