"""Videos: their frames as PNG files with times, which every run can read by number, exactly and in any order."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign_files import is_regular_file, require_regular
from tracknoise.sequences.images import encode_png
from tracknoise.sequences.writing import new_folder, write_times
from tracknoise.text import counted
from tracknoise.time_units import SHORTEST_S

_ENDINGS = (".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".mts", ".wmv", ".ts", ".3gp")
_MOST_BYTES = 1 << 40
_MOST_TRIED = 1 << 24
_QUIET = "-8"
"""What FFmpeg calls the level at which it prints nothing."""


def is_video(path: Path) -> bool:
    """Whether a file has the ending of a video."""
    return path.suffix.lower() in _ENDINGS and is_regular_file(path)


def frame_size(video: Path) -> tuple[int, int]:
    """Width and height of the frames of a video, px: as they are stored.

    Raises
    ------
    DataError
        If OpenCV cannot read the file.
    """
    require_regular(video, "a video", most=_MOST_BYTES)
    with _opened(video) as capture:
        return tuple(int(capture.get(key)) for key in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))  # type: ignore[return-value]


def write_frames(video: Path, folder: Path, size: tuple[int, int] | None) -> tuple[int, tuple[str, ...]]:
    """Write the frames of a video to a new folder that the reader ``folder`` reads; it appears when it is complete.

    Images are 8-bit gray, as they are stored: a video that is to be shown turned is not turned.

    Parameters
    ----------
    video
        The file.
    folder
        New or empty.
    size
        Width and height that the frames must have, px; None for any.

    Returns
    -------
    count : int
        How many frames there are.
    notes : tuple of str
        Where their times are from, and how many could not be read.

    Raises
    ------
    DataError
        If OpenCV cannot read the file or finds fewer than two frames, they have another size, or the folder is neither
        new nor empty.
    """
    with new_folder(folder) as unfinished, _opened(video) as capture:
        (unfinished / "images").mkdir()
        times_s: list[float] = []
        for image in _images(capture):
            actual = (image.shape[1], image.shape[0])
            if size is not None and actual != size:
                raise DataError(video, f"frames of {actual[0]}x{actual[1]}", f"the camera's {size[0]}x{size[1]}")
            (unfinished / "images" / f"{len(times_s):06d}.png").write_bytes(encode_png(image))
            times_s.append(capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3)
        if len(times_s) < 2:
            raise DataError(video, f"{counted(len(times_s), 'frame')} that OpenCV can read", "a video of at least two")
        times, note = _times(np.array(times_s), capture.get(cv2.CAP_PROP_FPS))
        if times is not None:
            write_times(unfinished / "timestamps.txt", times)
        stated = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
    lost = f"{len(times_s)} of the {stated} frames that it states can be read"
    return len(times_s), (note, *((lost,) if len(times_s) < stated else ()))


def are_frames(folder: Path) -> bool:
    """Whether a folder is one of `write_frames`, and nothing else is in it."""
    names = {entry.name for entry in folder.iterdir()} if folder.is_dir() else set()
    return "images" in names and names <= {"images", "timestamps.txt"}


@contextmanager
def silent_opencv() -> Iterator[None]:
    """OpenCV and FFmpeg print nothing: what is wrong with a video is said in one line."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", _QUIET)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)


@contextmanager
def _opened(video: Path) -> Iterator[cv2.VideoCapture]:
    with silent_opencv():
        capture = cv2.VideoCapture(str(video))
        try:
            if not capture.isOpened():
                raise DataError(video, "a file that OpenCV cannot read", "a video")
            capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
            yield capture
        finally:
            capture.release()


def _images(capture: cv2.VideoCapture) -> Iterator[NDArray[np.uint8]]:
    """(height, width) uint8: each frame in order."""
    for _ in range(_MOST_TRIED):
        is_read, image = capture.read()
        if not is_read:
            return
        yield np.asarray(image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def _times(shown_s: NDArray[np.float64], rate_hz: float) -> tuple[NDArray[np.float64] | None, str]:
    """Times of frames, seconds: those that the video states, or by its rate; None without either."""
    if np.all(np.diff(shown_s) > SHORTEST_S):
        return shown_s - shown_s[0], "times are those that the video states"
    if rate_hz > 0.0:
        return np.arange(len(shown_s)) / rate_hz, f"times are those of {rate_hz:g} frames per second"
    return None, "the video states no times"
