"""Times of a drive's images: a line ``2011-09-26 13:02:25.964389445`` for each frame, from frame 0 on."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_text
from tracknoise.foreign.parsing import damage_reported
from tracknoise.printable import counted

_TIME = re.compile(r"(?:19|20|21)[0-9]{2}-[0-9]{2}-[0-9]{2}(?:[ T][0-9:.]+)?")  # a century that 64 bits of ns can hold
_FORMAT = "a time such as 2011-09-26 13:02:25.964389445"


def read_timestamps(path: Path, numbers: range) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
    """Read the times of a drive's frames.

    Parameters
    ----------
    path
        The file; it may be missing.
    numbers
        Of the frames.

    Returns
    -------
    timestamps_s : (n,) float64 or None
        Seconds since the first frame; None where the file is missing or its times do not increase.
    notes : tuple of str
        A sentence in the latter case.

    Raises
    ------
    DataError
        If the file cannot be read, or a frame has no time in it.
    """
    if not path.exists():
        return None, ()
    times = _read(path, numbers)
    timestamps_s: NDArray[np.float64] = (times - times[0]) / np.timedelta64(1, "s")
    if not np.all(np.diff(timestamps_s) > 0.0):
        return None, (f"{path}: the times do not increase, so they are not used",)
    return timestamps_s, ()


def pose_time_notes(images: Path, poses: Path, numbers: range) -> tuple[str, ...]:
    """A sentence on how far the records of poses are from their images in time; none where a file cannot be used.

    Parameters
    ----------
    images, poses
        Files of the times of both.
    numbers
        Of the frames.
    """
    try:
        apart_ms = np.abs((_read(poses, numbers) - _read(images, numbers)) / np.timedelta64(1, "ms"))
    except DataError:
        return ()
    return (
        f"the pose of an image was recorded {np.median(apart_ms):.1f} ms from it in the median, "
        f"{apart_ms.max():.1f} ms at most, and is not moved to its time",
    )


def _read(path: Path, numbers: range) -> NDArray[np.datetime64]:
    """(n,) datetime64: the times of frames."""
    lines = read_text(path, f"in each line {_FORMAT}").splitlines()
    if len(lines) < numbers.stop:
        raise DataError(path, counted(len(lines), "line"), f"at least {numbers.stop}, one for each image")
    return np.array([_time(f"{path}:{number + 1}", lines[number]) for number in numbers])


def _time(place: str, line: str) -> np.datetime64:
    if _TIME.fullmatch(line.strip()) is None:
        raise DataError(place, repr(line), _FORMAT)
    with damage_reported(place, repr(line), _FORMAT):  # a month 13
        return np.datetime64(line.strip(), "ns")
