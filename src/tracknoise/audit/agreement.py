"""Whether trackers agree on a correction: a fault of the truth is the same for all, a tracker's own bias is not."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.audit.fitted import Fit
from tracknoise.audit.jackknife import jackknife

_LEAST_COUNT, _LEAST_CLUSTERS = 50, 2
"""Fewest observations of a tracker, and fewest clusters with any of them: one alone says nothing of its own error."""
_LEAST_SHARE, _MOST_SHARE = 0.5, 2.0
"""A tracker contradicts if it surely sees less than half, or more than double, of what all see together."""


@dataclass(frozen=True, slots=True)
class Shares:
    """How much of the common correction each tracker sees by itself: 1 where it sees the same.

    Attributes
    ----------
    tracker
        Its place.
    value, low, high
        The share and its interval, adjusted for the number of trackers.
    """

    tracker: int
    value: float
    low: float
    high: float

    @property
    def contradicts(self) -> bool:
        """Whether this tracker surely sees another correction."""
        return self.high < _LEAST_SHARE or self.low > _MOST_SHARE


def shares(fitted: Fit, places: NDArray[np.intp], *, level: float) -> list[Shares]:
    """Compare the corrections that single trackers see with the common one.

    Each tracker's own fit is one step of Newton's method from the common one. Its share is the projection on the common
    correction, in units of the information about it.

    Parameters
    ----------
    fitted
        The common fit.
    places
        Columns of the correction in question.
    level
        Probability of all intervals together.

    Returns
    -------
    list of Shares
        Of the trackers that have enough observations, in several clusters, if there are several such trackers.
    """
    count = fitted.equations.count
    several = np.count_nonzero(count, axis=1) >= _LEAST_CLUSTERS
    enough = np.flatnonzero(several & (count.sum(axis=1) >= _LEAST_COUNT))
    if len(enough) < 2:
        return []
    common = fitted.estimate[places]
    metric = np.linalg.pinv(np.linalg.inv(fitted.equations.information)[np.ix_(places, places)], hermitian=True)
    onto = metric @ common / max(float(common @ metric @ common), 1e-300)
    return [_share(fitted, places, onto, int(tracker), 1.0 - (1.0 - level) / len(enough)) for tracker in enough]


def _share(fitted: Fit, places: NDArray[np.intp], onto: NDArray[np.float64], tracker: int, level: float) -> Shares:
    moves = jackknife(fitted.equations, np.array([tracker]))
    value = 1.0 + float(onto @ moves.step[places])
    spread = float(np.sqrt(onto @ moves.covariance[np.ix_(places, places)] @ onto))
    half = float(special.stdtrit(moves.freedom[places].min(), 0.5 + 0.5 * level)) * spread
    return Shares(tracker, value, value - half, value + half)
