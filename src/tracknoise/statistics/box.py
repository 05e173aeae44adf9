"""What a box plot shows of a set of values: the one place that defines it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

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
    lower, median, upper = np.percentile(ordered, [25, 50, 75])
    reach = WHISKER_REACH * (upper - lower)
    within = ordered[(ordered >= lower - reach) & (ordered <= upper + reach)]
    lowest, highest = min(lower, within[0]), max(upper, within[-1])
    return Box(ordered.size, *map(float, (np.mean(ordered), median, lower, upper, lowest, highest)))
