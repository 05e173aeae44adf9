"""Standard deviations of estimates by leaving out stretches of a recording."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

BLOCKS = 10


def jackknife(rows: NDArray[np.float64], estimate: Callable[[NDArray[np.float64]], float]) -> tuple[float, float]:
    """An estimate from rows in the order of time, and its standard deviation.

    Parameters
    ----------
    rows
        (n, ...) float64, n at least 2.
    estimate
        Makes the estimate of some of the rows.
    """
    blocks = np.array_split(np.arange(len(rows)), min(BLOCKS, len(rows)))
    left_out = [estimate(np.delete(rows, block, axis=0)) for block in blocks]
    return estimate(rows), float(np.sqrt((len(blocks) - 1) * np.var(left_out)))
