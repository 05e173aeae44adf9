"""The other camera of a stereo pair, whose images were taken at the same times."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, TracknoiseError
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.pose import invert
from tracknoise.printable import counted, counted_of
from tracknoise.sequences.euroc.layout import Files
from tracknoise.sequences.euroc.sensors import names_cameras, read_camera
from tracknoise.sequences.euroc.tables import file_names, read_table
from tracknoise.sequences.images import Levels, read_gray
from tracknoise.sequences.sequence import SecondCamera


def find_second(
    files: Files,
    first: str,
    body_from_first: NDArray[np.float64],
    times_ns: NDArray[np.int64],
    *,
    camera_file: Path | None,
    levels: Levels | None,
) -> tuple[SecondCamera | None, tuple[str, ...]]:
    """Find the camera beside another one. It is not needed for other depth or truth, so its faults are no errors.

    Parameters
    ----------
    files
        Of the recording.
    first
        Name of the camera that is measured.
    body_from_first
        (4, 4) float64: where that is on the body.
    times_ns
        (n,) int64: times of its images.
    camera_file
        A file that is used in place of the recording's. If it does not name cameras, it is that of the first alone.
    levels
        Of 16-bit images.

    Returns
    -------
    second : SecondCamera or None
        None where there is none, or it cannot be used.
    notes : tuple of str
        Why it cannot be used, or how many frames it has no image of.
    """
    name = next((name for name in files.cameras() if name != first), None)
    if name is None:
        return None, ()
    try:
        of_both = camera_file if camera_file is not None and names_cameras(camera_file) else None
        calibration = read_camera(of_both or files.calibration(name), name)
        paths = _paths_at(files, name, times_ns)
    except TracknoiseError as error:
        return None, (f"{name} gives no stereo depth: {error}",)
    assert calibration.body_from_camera is not None, "checked when it was read"
    first_from_second = invert(body_from_first) @ calibration.body_from_camera
    missing = paths.count(None)
    have = counted_of(missing, len(paths), "frame", "has", "have")
    notes = (f"{have} no image of {name}, and no stereo depth",) if missing else ()
    return SecondCamera(calibration.camera, first_from_second, _SomeImages(paths, calibration.camera, levels)), notes


@dataclass(frozen=True, slots=True)
class _SomeImages:
    """Reads the image of a frame; None for a frame without one."""

    paths: tuple[Path | None, ...]
    camera: CameraModel
    levels: Levels | None

    def __call__(self, index: int) -> NDArray[np.uint8] | None:
        path = self.paths[index]
        return None if path is None else read_gray(path, self.camera, levels=self.levels)


def _paths_at(files: Files, camera: str, times_ns: NDArray[np.int64]) -> tuple[Path | None, ...]:
    """The image of a camera at each time, to the nanosecond: cameras of a pair are triggered together."""
    table = read_table(files.list_of_images(camera), "a time and the name of an image")
    names = dict(zip(table.times_ns.tolist(), file_names(table), strict=True))
    if names.keys().isdisjoint(times_ns.tolist()):
        times = counted(len(times_ns), "time")
        raise DataError(table.path, f"no image at any of {times}", "images at the times of frames")
    return tuple(files.image(camera, names[time]) if time in names else None for time in times_ns.tolist())
