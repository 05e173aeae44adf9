"""Small worlds in Gazebo's format, written by hand."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

QUARTERS = np.array([[20, 90], [160, 240]], np.uint8)
"""Grey levels of the four quarters of `picture`, as one who looks at it sees them."""


@pytest.fixture
def world(tmp_path: Path) -> Callable[[str], Path]:
    """Writes a world with the given contents to ``test.world``."""

    def write(contents: str) -> Path:
        path = tmp_path / "test.world"
        path.write_text(f"<sdf version='1.6'>\n<world name='w'>\n{contents}\n</world>\n</sdf>")
        return path

    return write


@pytest.fixture
def model(tmp_path: Path) -> Callable[..., Path]:
    """Writes a model of one link with the given contents; gives its folder in ``models``."""

    def write(name: str, contents: str, *, own: str = "") -> Path:
        folder = tmp_path / "models" / name
        folder.mkdir(parents=True)
        (folder / "model.config").write_text("<model><sdf version='1.6'>model.sdf</sdf></model>")
        link = f"<link name='link'><visual name='visual'>{contents}</visual></link>"
        (folder / "model.sdf").write_text(f"<sdf version='1.6'><model name='{name}'>{own}{link}</model></sdf>")
        return folder

    return write


@pytest.fixture
def picture() -> Callable[[Path], Path]:
    """Writes an image of four grey quarters."""

    def write(path: Path) -> Path:
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), np.kron(QUARTERS, np.ones((8, 8), np.uint8)))
        return path

    return write
