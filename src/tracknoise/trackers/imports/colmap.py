"""Tracks from a COLMAP database: keypoints, chained over consecutive images by verified matches.

Tables and encodings: https://colmap.github.io/database.html.
"""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.child import call_in_child
from tracknoise.foreign.files import MIB, require_regular
from tracknoise.foreign.natural_order import natural_order
from tracknoise.foreign.parsing import damage_reported
from tracknoise.printable import counted
from tracknoise.trackers.imports.rows import Rows

_MOST_BYTES = 4096 * MIB
_EXPECTED = "a COLMAP database"
_PAIR_BASE = 2**31 - 1
"""A pair of images i < j has the number i * _PAIR_BASE + j."""
_Keypoints = list[NDArray[np.float64]]
_Matches = list[NDArray[np.int64]]


def read_colmap(path: Path, *, n_frames: int | None) -> Rows:
    """Read the keypoints of all images, and chain them to tracks by the inlier matches of consecutive images.

    Frames are images in the order of their names, in which numbers count as numbers. A keypoint without a match in the
    next image is the last of its track. The positions are those of the file, whose origin is the corner of the first
    pixel.

    Raises
    ------
    DataError
        If the file is missing, damaged or open in another program, a match names a keypoint that does not exist, or the
        number of images is not that of the frames. None as `n_frames` allows any number.
    """
    size = require_regular(path, _EXPECTED, most=_MOST_BYTES)
    _require_closed(path)
    with damage_reported(path, "not readable", _EXPECTED, with_reason=True):
        keypoints, matches = call_in_child(_read, path, size=size)
    if n_frames not in (None, len(keypoints)):
        frames = counted(n_frames or 0, "frame")
        raise DataError(path, counted(len(keypoints), "image"), f"one for each of the {frames}")
    counts = [len(points) for points in keypoints]
    if not sum(counts):
        raise DataError(path, "no keypoint", "at least one")
    frame = np.repeat(np.arange(len(counts)), counts)
    return Rows(path, _chained(counts, matches), np.concatenate(keypoints), frame=frame)


def _require_closed(path: Path) -> None:
    """Refuse a database whose last changes are in a file beside it: reading them would write there."""
    log = path.with_name(f"{path.name}-wal")
    if log.is_file() and log.stat().st_size:
        raise DataError(path, f"changes that are in {log.name} alone", "a database that no program has open")


def _read(path: Path) -> tuple[_Keypoints, _Matches]:
    """Keypoints of each image, and matches (k, 2) of each image with the next; images in the order of their names."""
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as database:
        numbers = {str(name): int(image) for image, name in database.execute("SELECT image_id, name FROM images")}
        images = [numbers[name] for name in natural_order(numbers)]
        points = {row[0]: row[1:] for row in database.execute("SELECT image_id, rows, cols, data FROM keypoints")}
        pairs = {
            row[0]: row[1:] for row in database.execute("SELECT pair_id, rows, cols, data FROM two_view_geometries")
        }
        keypoints = [_keypoints(path, points.get(image)) for image in images]
        counts = [len(one) for one in keypoints]
        matches = [_between(path, pairs, images[k : k + 2], counts[k : k + 2]) for k in range(len(images) - 1)]
    return keypoints, matches


def _keypoints(path: Path, stored: tuple[int, int, bytes | None] | None) -> NDArray[np.float64]:
    if stored is None or not stored[0]:
        return np.empty((0, 2))
    table = _matrix(path, stored, np.dtype("<f4"), "keypoints")
    if table.shape[1] < 2 or not np.isfinite(table[:, :2]).all():
        raise DataError(path, f"keypoints of shape {table.shape}", "finite positions in the first two columns")
    return table[:, :2].astype(np.float64)


def _between(
    path: Path, pairs: dict[int, tuple[int, int, bytes | None]], images: list[int], counts: list[int]
) -> NDArray[np.int64]:
    """Matches (k, 2) from the first of two images to the second, in this order; each keypoint at most once."""
    low, high = sorted(images)
    stored = pairs.get(low * _PAIR_BASE + high)
    if stored is None or not stored[0]:
        return np.empty((0, 2), np.int64)
    matches = _matrix(path, stored, np.dtype("<u4"), "matches").astype(np.int64)
    if images[0] != low:
        matches = matches[:, ::-1]
    if matches.shape[1] != 2 or (matches >= counts).any():
        raise DataError(path, f"matches of images {images[0]} and {images[1]}", "two numbers of keypoints that exist")
    for column in (0, 1):
        matches = matches[np.sort(np.unique(matches[:, column], return_index=True)[1])]
    return matches


def _matrix(
    path: Path, stored: tuple[int, int, bytes | None], dtype: np.dtype[np.generic], what: str
) -> NDArray[np.generic]:
    rows, columns, data = stored
    if data is None or rows < 0 or columns < 1 or len(data) != rows * columns * dtype.itemsize:
        found = f"{what} of {rows} x {columns} numbers in {counted(len(data or b''), 'byte')}"
        raise DataError(path, found, f"{dtype.itemsize} bytes for each number")
    return np.frombuffer(data, dtype).reshape(rows, columns)


def _chained(counts: list[int], matches: _Matches) -> NDArray[np.int64]:
    """The number of the track of each keypoint, images one after another."""
    tracks: list[NDArray[np.int64]] = []
    n_tracks = 0
    for index, count in enumerate(counts):
        track = np.full(count, -1)
        if index:
            before, after = matches[index - 1].T
            track[after] = tracks[-1][before]
        new = np.flatnonzero(track < 0)
        track[new] = n_tracks + np.arange(len(new))
        n_tracks += len(new)
        tracks.append(track)
    return np.concatenate(tracks)
