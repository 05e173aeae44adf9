"""Tracks of models that track any point (TAP): NumPy archives with the positions of all points in all frames."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.child import call_in_child
from tracknoise.foreign.files import MIB, require_regular
from tracknoise.foreign.parsing import damage_reported
from tracknoise.printable import counted
from tracknoise.trackers.imports.rows import Rows

_MOST_BYTES = 1024 * MIB
_EXPECTED = "a .npz file with the arrays tracks and occluded"
_FRAMES_FIRST = "pred_tracks"
"""The name of positions of shape (frames, points, 2), which are those of CoTracker."""
_NAMES: Mapping[str, tuple[str, ...]] = {
    "positions": ("tracks", "points", "target_points", _FRAMES_FIRST),
    "hidden": ("occluded", "pred_occluded"),
    "seen": ("visible", "visibles", "visibility", "pred_visibility"),
    "queries": ("query_points", "queries"),
}
"""Names that models and data sets give the arrays, by what they hold."""
_AXES = {"positions": 3, "hidden": 2, "seen": 2, "queries": 2}
_Arrays = Mapping[str, tuple[str, NDArray[Any]]]
"""Arrays with their names, by what they hold."""


def read_tap(path: Path, *, n_frames: int | None) -> Rows:
    """Read an archive with ``tracks``, (points, frames, 2): u and v, and ``occluded``, (points, frames).

    ``visible`` can replace ``occluded``. With ``query_points``, (points, 3), whose first column is the frame, the
    frames before that of the query are left out. Each point is a track with one row per frame in which it is not
    occluded. `_NAMES` has further names. An additional first axis of length 1 is ignored. ``pred_tracks`` have frames
    before points, and so has what states where these are seen.

    Raises
    ------
    DataError
        If the file is missing or damaged, or an array is missing or has another shape.
    """
    size = require_regular(path, _EXPECTED, most=_MOST_BYTES)
    with damage_reported(path, "not readable", _EXPECTED, with_reason=True):
        arrays = call_in_child(_read, path, size=size)
    tracks, seen = _positions(path, arrays, n_frames), _seen(path, arrays)
    if "queries" in arrays:
        first = _query_frames(path, *arrays["queries"], len(tracks))
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


def _read(path: Path) -> dict[str, tuple[str, NDArray[Any]]]:
    with np.load(path, allow_pickle=False) as archive:
        present = {role: next((name for name in names if name in archive), None) for role, names in _NAMES.items()}
        found = {role: (name, archive[name]) for role, name in present.items() if name is not None}
    return {role: (name, _without_batch(values, _AXES[role])) for role, (name, values) in found.items()}


def _without_batch(values: NDArray[Any], axes: int) -> NDArray[Any]:
    """The array without axes of length 1 that are too many: the first ones, then the last ones."""
    while values.ndim > axes and len(values) == 1:
        values = values[0]
    while values.ndim > axes and values.shape[-1] == 1:
        values = values[..., 0]
    return values


def _positions(path: Path, arrays: _Arrays, n_frames: int | None) -> NDArray[np.float64]:
    """The array of positions as float64, (points, frames, 2)."""
    if "positions" not in arrays:
        raise DataError(path, "no array tracks", _EXPECTED)
    name, tracks = arrays["positions"]
    if tracks.ndim != 3 or tracks.shape[2] != 2 or tracks.dtype.kind not in "fiu":
        found = f"{name} of shape {tracks.shape} and type {tracks.dtype}"
        raise DataError(path, found, "numbers of shape (points, frames, 2)")
    if name == _FRAMES_FIRST:
        return np.asarray(tracks.swapaxes(0, 1), dtype=np.float64)
    if n_frames is not None and _are_frames_first(tracks.shape[0], tracks.shape[1], n_frames):
        found = f"{name} of shape {tracks.shape} for {counted(n_frames, 'frame')}"
        raise DataError(path, found, "shape (points, frames, 2): transpose the first two axes")
    return np.asarray(tracks, dtype=np.float64)


def _are_frames_first(first: int, second: int, n_frames: int) -> bool:
    """Whether the lengths of two axes show that the first one is that of frames."""
    return first == n_frames != second or first <= n_frames < second


def _seen(path: Path, arrays: _Arrays) -> NDArray[np.bool_]:
    """Where each point is seen, (points, frames)."""
    role = next((role for role in ("hidden", "seen") if role in arrays), None)
    if role is None:
        raise DataError(path, "no array occluded or visible", _EXPECTED)
    name, stated = arrays[role]
    of, positions = arrays["positions"]
    expected = positions.shape[:2]
    if stated.shape != expected or stated.dtype.kind not in "buif" or not np.isin(stated, (0, 1)).all():
        found = f"{name} of shape {stated.shape} and type {stated.dtype}"
        raise DataError(path, found, f"true or false, of shape {expected}")
    seen = stated.astype(np.bool_) == (role == "seen")
    return np.asarray(seen.T if of == _FRAMES_FIRST else seen)


def _query_frames(path: Path, name: str, queries: NDArray[Any], count: int) -> NDArray[np.float64]:
    """The frame of each query."""
    if queries.shape != (count, 3) or queries.dtype.kind not in "fiu" or not np.isfinite(queries).all():
        found = f"{name} of shape {queries.shape} and type {queries.dtype}"
        raise DataError(path, found, f"finite numbers of shape ({count}, 3): frame, v and u of each point")
    return np.rint(np.asarray(queries[:, 0], dtype=np.float64))
