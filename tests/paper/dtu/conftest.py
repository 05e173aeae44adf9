"""Data sets in DTU's layouts: one that is simulated, and ones made by hand of images in one grey."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tracknoise.paper.dtu import write_mat
from tracknoise.paper.dtu_writer import calibration_variables, write_dtu
from tracknoise.paper.light_stage import LightStage, arc, stage_camera

SIZE = (32, 24)
SMALL = partial(LightStage, width=240, height=180)


@pytest.fixture(scope="session")
def stage() -> LightStage:
    return SMALL(1)


@pytest.fixture(scope="session")
def simulated(tmp_path_factory: pytest.TempPathFactory, stage: LightStage) -> Path:
    """Scene SET001, which the stage shows."""
    root = tmp_path_factory.mktemp("simulated") / "dtu"
    write_dtu(root, stage=lambda scene: stage, image_format="bmp")
    return root


@pytest.fixture
def calibration() -> dict[str, Any]:
    """The variables of a calibration for images of 32x24."""
    return dict(calibration_variables(stage_camera(*SIZE), arc()))


@pytest.fixture
def write_set(tmp_path: Path, calibration: dict[str, Any]) -> Callable[..., Path]:
    """Writes a data set of one scene; LED number n has the grey 10 n + position."""

    def write(
        scene: str = "SET001", *, name: str = "Img{:03d}_{:02d}.png", numbers: int = 19, size: tuple[int, int] = SIZE
    ) -> Path:
        folder = tmp_path / scene
        folder.mkdir()
        for position in range(1, 50):
            for number in range(numbers):
                grey = np.full(size[::-1], 10 * number % 200 + position, np.uint8)
                (folder / name.format(position, number)).write_bytes(encoded(grey, name[-4:]))
        write_mat(tmp_path / "Calib_Results_11.mat", calibration)
        (tmp_path / "CleanRecon_2009_11_16").mkdir()
        points = np.arange(12.0).reshape(3, 4)
        variables = {"pts3D_near": points, "pts3D_far": points + 100.0}
        write_mat(tmp_path / "CleanRecon_2009_11_16" / "Clean_Reconstruction_01.mat", variables)
        return tmp_path

    return write


def encoded(image: np.ndarray, suffix: str) -> bytes:
    return cv2.imencode(suffix, image)[1].tobytes()
