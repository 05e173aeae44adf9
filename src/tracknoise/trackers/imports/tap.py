"""Tracks of models that track any point (TAP): NumPy archives with the positions of all points in all frames."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.child import call_in_child
from tracknoise.foreign.files import MIB, require_regular
from tracknoise.foreign.parsing import damage_reported
from tracknoise.trackers.imports.rows import Rows

_MOST_BYTES = 1024 * MIB
_EXPECTED = "a .npz file with the arrays tracks and occluded"
_HIDDEN = {"occluded": False, "visible": True}
"""Arrays that state where points are seen, and the value that says so."""


def read_tap(path: Path, *, n_frames: int | None) -> Rows:
    """Read an archive with ``tracks``, (points, frames, 2): u and v, and ``occluded``, (points, frames).

    ``visible`` can replace ``occluded``. With ``query_points``, (points, 3): frame, v and u, the frames before that of
    the query are left out. Each point is a track with one row per frame in which it is not occluded.

    Raises
    ------
    DataError
        If the file is missing or damaged, or an array is missing or has another shape.
    """
    size = require_regular(path, _EXPECTED, most=_MOST_BYTES)
    with damage_reported(path, "not readable", _EXPECTED, with_reason=True):
        arrays = call_in_child(_read, path, size=size)
    tracks, seen = _positions(path, arrays, n_frames), _seen(path, arrays)
    if "query_points" in arrays:
        first = _query_frames(path, arrays["query_points"], len(tracks))
        seen = seen & (np.arange(tracks.shape[1]) >= first[:, None])
    track, frame = np.nonzero(seen)
    uv = tracks[track, frame]
    if not np.isfinite(uv).all():
        place = int(np.flatnonzero(~np.isfinite(uv).all(axis=1))[0])
        found = f"tracks of point {track[place]} in frame {frame[place]} are {uv[place].tolist()}"
        raise DataError(path, found, "finite positions where a point is not occluded")
    if not len(track):
        raise DataError(path, "no visible point", "at least one")
    return Rows(path, track.astype(np.int64), uv, frame=frame.astype(np.int64))


def _read(path: Path) -> dict[str, NDArray[Any]]:
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in ("tracks", *_HIDDEN, "query_points") if name in archive}


def _positions(path: Path, arrays: dict[str, NDArray[Any]], n_frames: int | None) -> NDArray[np.float64]:
    """The array of positions as float64."""
    if "tracks" not in arrays:
        raise DataError(path, "no array tracks", _EXPECTED)
    tracks = arrays["tracks"]
    if tracks.ndim != 3 or tracks.shape[2] != 2 or tracks.dtype.kind not in "fiu":
        found = f"tracks of shape {tracks.shape} and type {tracks.dtype}"
        raise DataError(path, found, "numbers of shape (points, frames, 2)")
    if n_frames is not None and tracks.shape[1] > n_frames >= tracks.shape[0]:
        found = f"tracks of shape {tracks.shape} for {n_frames} frames"
        raise DataError(path, found, "shape (points, frames, 2): transpose the first two axes")
    return np.asarray(tracks, dtype=np.float64)


def _seen(path: Path, arrays: dict[str, NDArray[Any]]) -> NDArray[np.bool_]:
    """Where each point is seen, (points, frames)."""
    name = next((name for name in _HIDDEN if name in arrays), None)
    if name is None:
        raise DataError(path, "no array occluded or visible", _EXPECTED)
    stated, expected = arrays[name], arrays["tracks"].shape[:2]
    if stated.shape != expected or stated.dtype.kind not in "buif" or not np.isin(stated, (0, 1)).all():
        found = f"{name} of shape {stated.shape} and type {stated.dtype}"
        raise DataError(path, found, f"true or false, of shape {expected}")
    return np.asarray(stated.astype(np.bool_) == _HIDDEN[name])


def _query_frames(path: Path, queries: NDArray[Any], count: int) -> NDArray[np.float64]:
    """The frame of each query."""
    if queries.shape != (count, 3) or queries.dtype.kind not in "fiu" or not np.isfinite(queries).all():
        found = f"query_points of shape {queries.shape} and type {queries.dtype}"
        raise DataError(path, found, f"finite numbers of shape ({count}, 3): frame, v and u of each point")
    return np.rint(np.asarray(queries[:, 0], dtype=np.float64))
