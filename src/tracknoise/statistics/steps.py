"""Pairs of observations of one track that lie a number of steps of its tracker apart. Arrays only."""

import numpy as np
from numpy.typing import NDArray


def followers(
    track: NDArray[np.intp], frame: NDArray[np.int64], speed: NDArray[np.int64], steps: int
) -> NDArray[np.intp]:
    """Rows for which the row `steps` places above is of the same track, as many frames of the tracker earlier.

    Parameters
    ----------
    track, frame, speed : (rows,)
        Sorted by track, which is a different number in each sequence and condition, and by frame.
    steps
        Number of rows, and of frames that the tracker saw.
    """
    late, early = slice(steps, None), slice(None, max(len(frame) - steps, 0))
    return np.flatnonzero((track[late] == track[early]) & (frame[late] - frame[early] == steps * speed[late])) + steps


def changes(
    error_px: NDArray[np.float64], track: NDArray[np.intp], frame: NDArray[np.int64], speed: NDArray[np.int64]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Rows that follow on another, and how much their error changed since then.

    Parameters
    ----------
    error_px
        (rows, 2) float64.
    track, frame, speed
        As in `followers`.

    Returns
    -------
    late : (changes,) intp
        Row at the end of each change.
    change_px : (changes, 2) float64
    """
    late = followers(track, frame, speed, 1)
    return late, error_px[late] - error_px[late - 1]
