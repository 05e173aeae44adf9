"""Which depth belongs to which image, where each has its own time."""

import numpy as np
from numpy.typing import NDArray


def nearest(times_s: NDArray[np.float64], others_s: NDArray[np.float64], *, max_gap_s: float) -> NDArray[np.intp]:
    """Associate each time with the nearest of others. None of the others is used twice.

    Two times belong together if each is the nearest of the other; of two at the same distance, the earlier is.

    Parameters
    ----------
    times_s
        (n,) float64, seconds, increasing.
    others_s
        (k,) float64, seconds, increasing.
    max_gap_s
        Largest distance between two times that belong together, seconds.

    Returns
    -------
    (n,) intp
        Index of the other of each time; -1 where it has none.
    """
    if not len(times_s) or not len(others_s):
        return np.full(len(times_s), -1, np.intp)
    other = _nearest_indices(times_s, others_s)
    mutual = _nearest_indices(others_s, times_s)[other] == np.arange(len(times_s))
    close = np.abs(others_s[other] - times_s) <= max_gap_s
    return np.where(mutual & close, other, -1)


def _nearest_indices(times_s: NDArray[np.float64], others_s: NDArray[np.float64]) -> NDArray[np.intp]:
    """Index of the other that is nearest to each time, the earlier of two at the same distance."""
    after = np.clip(np.searchsorted(others_s, times_s), 1, max(len(others_s) - 1, 1))
    after = np.minimum(after, len(others_s) - 1)
    before = np.maximum(after - 1, 0)
    later: NDArray[np.bool_] = others_s[after] - times_s < times_s - others_s[before]
    return np.where(later, after, before)
