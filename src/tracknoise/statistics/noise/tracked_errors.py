"""The errors of the tracks of a sequence, with what is an outlier among them."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.frame_geometry import FrameGeometry
from tracknoise.statistics.noise.error_tracks import ErrorTracks
from tracknoise.statistics.noise.true_points import true_points
from tracknoise.statistics.prepared import PreparedSequence

STEPS = 30
"""Largest age, in frames that the tracker saw."""
OUTLIER = 10.0
"""Errors are outliers beyond this many standard deviations, by the median of their length."""
_MEDIAN_LENGTH = float(np.sqrt(2.0 * np.log(2.0)))
"""Median length of pairs of independent Gaussian numbers of standard deviation 1."""


def error_tracks(sequence: PreparedSequence, geometry: FrameGeometry) -> ErrorTracks:
    """Errors of all tracks of a sequence; visible ones only.

    Parameters
    ----------
    sequence
        With errors about the first position of each track.
    geometry
        Poses and cameras of its frames.
    """
    seen = sequence.seen
    rows = sequence.ordered[(seen.age <= STEPS * seen.speed)[sequence.ordered]]
    track, frame, age = sequence.track_row[rows], seen.frame[rows], seen.age[rows].astype(np.float64)
    error = np.where(seen.visible[rows, None], seen.error_px[rows], np.nan)
    outlier, limit = _outliers(error, age, seen.condition[rows], seen.conditions.height)
    begins = np.flatnonzero(np.diff(track, prepend=-1))
    length = np.diff(np.append(begins, len(rows)))
    magnification = _magnification(sequence, geometry, rows, begins, length)
    steps = np.diff(age, prepend=0.0) / magnification**2
    steps[begins] = 0.0
    walked = np.cumsum(steps)
    true_uv = sequence.observations.select("u_true_px", "v_true_px").to_numpy()[rows]
    motion = np.diff(true_uv, axis=0, prepend=np.nan)
    motion[begins] = np.nan
    return ErrorTracks(
        rows=rows,
        track=track,
        frame=frame,
        speed=seen.speed[rows],
        age=age,
        error_px=np.where(outlier[:, None], np.nan, error),
        outlier=outlier,
        limit_px=limit,
        magnification=magnification,
        walked=walked - np.repeat(walked[begins], length),
        motion_px=motion,
    )


def _magnification(
    sequence: PreparedSequence,
    geometry: FrameGeometry,
    rows: NDArray[np.intp],
    begins: NDArray[np.intp],
    length: NDArray[np.intp],
) -> NDArray[np.float64]:
    born = rows[begins]
    points = np.repeat(true_points(sequence, geometry, born), length, axis=0)
    depth = geometry.to_camera(sequence.seen.frame[rows], points)[:, 2]
    first = np.repeat(depth[begins], length)
    known = (depth > 0.0) & (first > 0.0)
    return np.where(known, first, 1.0) / np.where(known, depth, 1.0)


def _outliers(
    error: NDArray[np.float64], age: NDArray[np.float64], condition: NDArray[np.intp], count: int
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Which errors are outliers, and the limit of each condition."""
    length = np.hypot(*error.T)
    counted = np.flatnonzero((age > 0) & ~np.isnan(length))
    order = counted[np.lexsort((length[counted], condition[counted]))]
    starts = np.searchsorted(condition[order], np.arange(count + 1))
    limit = np.full(count, np.nan)
    for number, (low, high) in enumerate(pairwise(starts)):
        if high > low:
            limit[number] = OUTLIER / _MEDIAN_LENGTH * np.median(length[order[low:high]])
    with np.errstate(invalid="ignore"):
        return (age > 0) & (length > limit[condition]), limit
