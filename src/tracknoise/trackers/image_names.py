"""Frames of a sequence by the names of their image files, as other programs write them."""

import re
from collections.abc import Sequence
from pathlib import PurePosixPath

import numpy as np
from numpy.typing import NDArray

_IMAGE = re.compile(r"\.(png|jpe?g|bmp|tiff?|pgm|ppm|webp|exr)$", re.IGNORECASE)
_NUMBER = re.compile(r"(\d+)\D*$")
_SECONDS = re.compile(r"\d+\.\d+")
_LEAST_DIGITS, _MOST_DIGITS = 16, 19
"""Of a time in nanoseconds; longer numbers are none."""


def is_image_name(text: str) -> bool:
    """Whether a text is the name of an image file."""
    return _IMAGE.search(text.strip()) is not None


def frames_named(names: NDArray[np.str_], files: Sequence[str]) -> NDArray[np.int64]:
    """The frame of each name (n,), -1 where there is none.

    `files`: the image of each frame. Names may have folders and an ending, or not. Where no name is that of a file, the
    last number in each counts, as long as it is another one in each file.
    """
    named, place = np.unique(names, return_inverse=True)
    for extract in (_stem, _last_number):
        frame_of = {extract(file): frame for frame, file in enumerate(files)}
        if None in frame_of or len(frame_of) < len(files):
            continue
        frame = np.array([frame_of.get(extract(name), -1) for name in named.tolist()], dtype=np.int64)
        if (frame >= 0).any():
            return np.asarray(frame[place])
    return np.full(len(names), -1, dtype=np.int64)


def numbers_named(names: NDArray[np.str_]) -> NDArray[np.int64]:
    """The last number in each name (n,), -1 where there is none."""
    named, place = np.unique(names, return_inverse=True)
    numbers = [_last_number(name) for name in named.tolist()]
    return np.array([-1 if number is None else number for number in numbers], dtype=np.int64)[place]


def times_named(names: NDArray[np.str_]) -> NDArray[np.float64] | None:
    """The times (n,) that names are, seconds: whole nanoseconds or seconds with a point; None where they are none."""
    named, place = np.unique(names, return_inverse=True)
    stems = [_stem(name) for name in named.tolist()]
    if all(stem.isdecimal() and _LEAST_DIGITS <= len(stem) <= _MOST_DIGITS for stem in stems):
        return np.array([int(stem) / 1e9 for stem in stems])[place]
    if all(_SECONDS.fullmatch(stem) for stem in stems):
        return np.array([float(stem) for stem in stems])[place]
    return None


def _stem(name: str) -> str:
    """The name without folders and the ending of an image file: names that are times have other points."""
    return _IMAGE.sub("", PurePosixPath(name.strip().replace("\\", "/")).name)


def _last_number(name: str) -> int | None:
    match = _NUMBER.search(_stem(name))
    return int(match[1]) if match and len(match[1]) <= _MOST_DIGITS - 1 else None
