"""Which of other times is nearest to each time: depths of images, observations of frames."""

import numpy as np
from numpy.typing import NDArray


def nearest(times_s: NDArray[np.float64], others_s: NDArray[np.float64], *, max_gap_s: float) -> NDArray[np.intp]:
    """Find the nearest of other times for each time, of two at the same distance the earlier.

    Parameters
    ----------
    times_s
        (n,) float64, seconds.
    others_s
        (k,) float64, seconds, increasing.
    max_gap_s
        Largest distance, seconds.

    Returns
    -------
    (n,) intp
        Index of the other of each time; -1 where none is within that distance. One other may be that of several times.
    """
    if not len(others_s):
        return np.full(len(times_s), -1, np.intp)
    last = len(others_s) - 1
    after = np.minimum(np.searchsorted(others_s, times_s), last)
    before = np.maximum(after - 1, 0)
    index = np.where(np.abs(others_s[after] - times_s) < np.abs(times_s - others_s[before]), after, before)
    return np.where(np.abs(others_s[index] - times_s) <= max_gap_s, index, -1)
