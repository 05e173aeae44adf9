"""How far out errors lie, compared with a Gaussian of the same mean and covariance.

In two dimensions a Gaussian has P(d2 > x) = exp(-x / 2), so that a share p of its errors lies within the distance
sqrt(-2 log(1 - p)).
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TAILS = ((9.21, 0.01), (13.82, 0.001))
"""Squared distances, and how many errors of a Gaussian are beyond, rounded."""
PROBABILITIES = (0.05, *(step / 10 for step in range(1, 10)), 0.95, 0.98, 0.99, 0.995, 0.999)
_BEYOND = 5
"""Fewest errors beyond a quantile that is reported."""


def tail_ratios(squared: Array) -> tuple[float, ...]:
    """P(d2 > x) over that of a Gaussian for each of `TAILS`; NaN where a Gaussian would have less than one error there.

    Parameters
    ----------
    squared : (n,)
        Squared distances d2.
    """
    n = len(squared)
    return tuple(np.count_nonzero(squared > x) / (n * p) if n * p >= 1 else np.nan for x, p in TAILS)


def radii(squared: Array) -> tuple[Array, Array, Array]:
    """Probabilities, and quantiles of the distance: of a Gaussian and observed, as far as there are errors beyond.

    Parameters
    ----------
    squared : (n,)
        Squared distances d2.
    """
    probabilities = np.array([p for p in PROBABILITIES if len(squared) * (1 - p) >= _BEYOND])
    if not len(probabilities):
        return probabilities, np.empty(0), np.empty(0)
    places, distances = np.arange(len(squared)), np.sqrt(np.sort(squared))
    observed = np.interp(probabilities * (len(squared) - 1), places, distances)
    return probabilities, np.sqrt(-2 * np.log1p(-probabilities)), observed
