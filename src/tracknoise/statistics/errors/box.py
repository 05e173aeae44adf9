"""Definition of what box plots show."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

WHISKER_REACH = 1.5


@dataclass(frozen=True, slots=True)
class Box:
    """Box, whiskers and mean of n values, in their unit; all None where n is 0."""

    n: int
    mean: float | None
    median: float | None
    lower_quartile: float | None
    upper_quartile: float | None
    lower_whisker: float | None
    upper_whisker: float | None


def box_summary(values: ArrayLike) -> Box:
    """Summarise values for a box plot.

    Quartiles are NumPy's linearly interpolated percentiles. Each whisker ends at the last value within 1.5 times the
    interquartile range of its quartile, or at the quartile itself where no value lies in between.

    Parameters
    ----------
    values
        (n,) finite numbers in any order, which does not change the result.
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    if not ordered.size:
        return Box(0, *[None] * 6)
    return _box(ordered.size, float(np.mean(ordered)), np.percentile(ordered, [25, 50, 75]), ordered)


def box_of_counts(values: ArrayLike, counts: ArrayLike) -> Box:
    """Summarise a histogram for a box plot, as `box_summary` does the values that were counted.

    Parameters
    ----------
    values
        (m,) finite numbers, each once, in any order.
    counts
        (m,) how often each occurred.
    """
    found, times = np.asarray(values, dtype=np.float64), np.asarray(counts, dtype=np.int64)
    order = np.argsort(found[times > 0])
    ordered, last = found[times > 0][order], np.cumsum(times[times > 0][order])
    if not ordered.size:
        return Box(0, *[None] * 6)
    n = int(last[-1])
    position = np.array([0.25, 0.5, 0.75]) * (n - 1)
    below, above = (ordered[np.searchsorted(last, rounded(position), side="right")] for rounded in (np.floor, np.ceil))
    quartiles = below + (position % 1.0) * (above - below)
    return _box(n, float(ordered @ np.diff(last, prepend=0)) / n, quartiles, ordered)


def _box(n: int, mean: float, quartiles: NDArray[np.float64], ordered: NDArray[np.float64]) -> Box:
    lower, median, upper = map(float, quartiles)
    reach = WHISKER_REACH * (upper - lower)
    within = ordered[(ordered >= lower - reach) & (ordered <= upper + reach)]
    lowest, highest = min(lower, float(within[0])), max(upper, float(within[-1]))
    return Box(n, mean, median, lower, upper, lowest, highest)
