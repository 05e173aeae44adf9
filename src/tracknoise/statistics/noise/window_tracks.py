"""Tracks that windows are cut from: their observations, and the derivatives of their positions by their points."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.frame_geometry import FrameGeometry
from tracknoise.statistics.definitions import WINDOWS
from tracknoise.statistics.noise.true_points import true_points
from tracknoise.statistics.prepared import PreparedSequence


def window_runs(
    sequence: PreparedSequence, population: str
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Observations of windows, track by track in order of frames, where each track begins, and how many it has.

    Only tracks whose first observation belongs to the population, and as many observations as a window can have.

    Returns
    -------
    rows : (n,) intp
        Of the observations table.
    start, length : (tracks,) intp
        Of each track in `rows`.
    """
    rows = sequence.ordered
    new = np.flatnonzero(np.diff(sequence.track_row[rows], prepend=-1))
    length = np.diff(np.append(new, len(rows)))
    place = np.arange(len(rows)) - np.repeat(new, length)
    member = sequence.seen.members(population)[rows]
    outside = np.where(member, len(rows), place)
    until = np.minimum.reduceat(outside, new) if len(new) else np.empty(0, np.intp)
    taken = np.minimum(np.minimum(length, until), max(WINDOWS))
    taken = np.where(taken >= min(WINDOWS), taken, 0)
    kept = place < np.repeat(taken, length)
    taken = taken[taken > 0]
    return rows[kept], np.cumsum(taken) - taken, taken


def window_derivatives(
    sequence: PreparedSequence,
    geometry: FrameGeometry,
    rows: NDArray[np.intp],
    start: NDArray[np.intp],
    length: NDArray[np.intp],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Derivatives of the true positions of tracks by their points, and the rays to these.

    Parameters
    ----------
    sequence, geometry
        The tracks, and poses and cameras of their frames.
    rows, start, length
        As `window_runs` returns them.

    Returns
    -------
    jacobian : (n, 2, 3) float64
        px per metre; NaN where the depth is unknown.
    ray_m : (tracks, 3) float64
        From the camera of the first observation to the point, metres.
    """
    frame, born = sequence.seen.frame[rows], rows[start]
    birth = sequence.seen.frame[born]
    points = true_points(sequence, geometry, born)
    ray_m = points - geometry.world_from_camera[birth, :3, 3]
    return geometry.jacobian(frame, np.repeat(points, length, axis=0)), ray_m
