"""Writing sequences: folders that appear at once, times of frames, and the camera of formats that hold only one."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise import atomic
from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera, CameraModel
from tracknoise.sequences.sequence import Sequence, camera_at


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """As `tracknoise.atomic.created_folder`; DataError if there is something already, or it cannot be written."""
    path = Path(path).absolute()
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise DataError(path, "already exists", "a new or empty folder")
    try:
        with atomic.created_folder(path) as unfinished:
            yield unfinished
    except OSError as error:
        reason = error.strerror or error
        raise DataError(path, f"cannot be written ({reason})", "a folder that can be written") from error


def write_times(path: Path, times_s: NDArray[np.float64]) -> None:
    """Write the times of frames, (n,) float64, with all digits, as the reader ``folder`` reads them."""
    lines = ["# timestamp_s (seconds; one row per frame)", *map(repr, times_s.tolist()), ""]
    path.write_text("\n".join(lines), encoding="utf-8")


def pinhole_of(sequence: Sequence) -> Camera:
    """The pinhole camera of all frames."""
    camera = sequence.camera
    if not isinstance(camera, Camera):
        raise DataError(sequence.source, f"a camera of the model {type(camera).__name__}", "a pinhole camera")
    only_camera(sequence)
    return camera


def only_camera(sequence: Sequence) -> CameraModel:
    """The camera of all frames."""
    camera = sequence.camera
    if any(camera_at(sequence, index) != camera for index in range(len(sequence))):
        raise DataError(sequence.source, "a camera that changes from frame to frame", "one camera for all frames")
    return camera
