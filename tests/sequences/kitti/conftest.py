"""A simulated drive in KITTI's layout, written once, and a tiny one to break."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracknoise.geometry.cameras import Camera
from tracknoise.sequences.kitti import Kitti
from tracknoise.sequences.kitti_files import Drive, write_record, write_scan
from tracknoise.sequences.kitti_writer import write_calibration, write_kitti
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.simulated import Simulated, SimulatedSequence

TINY = Camera(32, 24, 30.0, 30.0, 15.5, 11.5)


@pytest.fixture(scope="session")
def simulated() -> list[SimulatedSequence]:
    """Two sequences: one turns about a target, the other drives ahead."""
    reader = Simulated(motions=("fixating", "forward"), frames=16, width=320, height=240, supersampling=1)
    return [reader.open(listed) for listed in reader.sequences()]


@pytest.fixture(scope="session")
def written(simulated, tmp_path_factory) -> Path:
    """Both of them as drives."""
    root = tmp_path_factory.mktemp("kitti") / "raw"
    write_kitti(simulated, root, seed=3)
    return root


@pytest.fixture(scope="session")
def recorded(written) -> list[RecordedSequence]:
    """The drives as they are read."""
    reader = Kitti(written)
    return [reader.open(listed) for listed in reader.sequences()]


@pytest.fixture
def write_drive() -> Callable[..., Drive]:
    def write(day: Path, *, number: int = 1, frames: int = 3, step_m: float = 0.5, first: int = 0) -> Drive:
        """A drive north from 49 N 8 E, before a wall of 1 m depth in all pixels but the first, and 2 m in scans."""
        drive = Drive(day / f"2011_09_26_drive_{number:04d}_sync")
        for index in range(first, first + frames):
            for path in (drive.image(index), drive.oxts(index), drive.depth(index), drive.scan(index)):
                path.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(drive.image(index)), np.full((24, 32), 10 * index, np.uint8))
            units = np.full((24, 32), 256, np.uint16)
            units[0, 0] = 0
            cv2.imwrite(str(drive.depth(index)), units)
            write_record(drive.oxts(index), np.array([49.0 + np.rad2deg(index * step_m / 6378137.0), 8.0, 0, 0, 0, 0]))
            write_scan(drive.scan(index), np.array([[2.0, 0.0, 0.0]]))
        write_calibration(day, TINY)
        return drive

    return write
