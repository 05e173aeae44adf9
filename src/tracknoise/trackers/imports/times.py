"""Times of imported observations, assigned to the frames of a sequence."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.association import nearest
from tracknoise.trackers.imports.rows import Rows

_Taken = tuple[Rows, int]


def in_seconds(rows: Rows, offset_s: float) -> Rows:
    """The same rows with times in seconds, an offset added. Nanoseconds are added as whole numbers."""
    if rows.time_ns is not None:
        return replace(rows, time_s=(rows.time_ns + round(1e9 * offset_s)) / 1e9, time_ns=None)
    assert rows.time_s is not None, "there are times"
    return replace(rows, time_s=rows.time_s + offset_s)


def nearest_frames(rows: Rows, frames_s: NDArray[np.float64], max_gap_s: float) -> _Taken:
    """Assign each row to the frame that is nearest in time.

    Of several rows of a track that are nearest to the same frame, the nearest is kept.

    Parameters
    ----------
    rows
        With times in seconds.
    frames_s
        (n,) float64, increasing: the time of each frame.
    max_gap_s
        Rows that are farther from every frame are left out.

    Returns
    -------
    rows
        With frames.
    left_out
        Number of rows that are too far from every frame.

    Raises
    ------
    DataError
        If all rows are.
    """
    time_s = _times(rows)
    frame = nearest(time_s, frames_s, max_gap_s=max_gap_s)
    gap = np.abs(time_s - frames_s[frame])
    near = np.flatnonzero(frame >= 0)
    _require_any(rows, near, frames_s)
    order = near[np.lexsort([gap[near], rows.track[near], frame[near]])]
    first = np.ones(len(order), dtype=np.bool_)
    first[1:] = (np.diff(frame[order]) != 0) | (np.diff(rows.track[order]) != 0)
    kept = np.sort(order[first])
    return rows.chosen(kept, frame[kept], rows.uv[kept]), len(time_s) - len(near)


def interpolated(rows: Rows, frames_s: NDArray[np.float64], max_gap_s: float) -> _Taken:
    """Positions of each track at the times of frames, linear between the observations before and after.

    Parameters
    ----------
    rows
        With times in seconds.
    frames_s
        (n,) float64, increasing: the time of each frame.
    max_gap_s
        A track has no position in a frame between two observations that are farther apart.

    Returns
    -------
    rows
        With frames, one for each track and frame; response and quality are those of the observation before.
    left_out
        0: observations between frames are used.

    Raises
    ------
    DataError
        If no track has a position in any frame, or a track has two observations at one time.
    """
    time_s = _times(rows)
    order = np.lexsort([time_s, rows.track])
    track, time_s, uv = rows.track[order], time_s[order], rows.uv[order]
    _require_one_each(rows, order, track, time_s)
    same = np.append(track[1:] == track[:-1], np.False_)  # whether the next row is of the same track
    following = np.append(time_s[1:], np.nan)
    linked = same & (following - time_s <= max_gap_s)
    first = np.searchsorted(frames_s, time_s)
    last = np.where(linked, np.searchsorted(frames_s, np.where(linked, following, time_s)), first)
    at_row = (first < len(frames_s)) & (frames_s[np.minimum(first, len(frames_s) - 1)] == time_s)
    counts = np.where(linked, last - first, at_row)
    row = np.repeat(np.arange(len(track)), counts)
    frame = first[row] + np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    _require_any(rows, row, frames_s)
    later = np.where(linked[row], row + 1, row)
    span = np.where(linked[row], time_s[later] - time_s[row], 1.0)
    share = (frames_s[frame] - time_s[row]) / span
    return rows.chosen(order[row], frame, uv[row] + share[:, None] * (uv[later] - uv[row])), 0


def _times(rows: Rows) -> NDArray[np.float64]:
    assert rows.time_s is not None, "times are in seconds"
    return rows.time_s


def _require_any(rows: Rows, used: NDArray[np.intp], frames_s: NDArray[np.float64]) -> None:
    if len(used):
        return
    time_s = _times(rows)
    expected = f"times of the frames, from {frames_s[0]:.9g} to {frames_s[-1]:.9g} s; if the clocks differ, set"
    shift = f"time_offset_s, which is added: {frames_s[0] - time_s.min():.9f} would make both begin together"
    raise DataError(rows.path, f"times from {time_s.min():.9g} to {time_s.max():.9g} s", f"{expected} {shift}")


def _require_one_each(
    rows: Rows, order: NDArray[np.intp], track: NDArray[np.int64], time_s: NDArray[np.float64]
) -> None:
    twice = np.zeros(len(order), dtype=np.bool_)
    twice[order[1:]] = (np.diff(track) == 0) & (np.diff(time_s) == 0)
    rows.refuse(twice, "track", rows.track, "one row for each track and time")
