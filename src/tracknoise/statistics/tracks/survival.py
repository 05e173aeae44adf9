"""The Kaplan-Meier estimate of survival: the only place where it is computed.

An end at L is an event at L. A track that was alive in the last frame of its sequence with lifetime L was never looked
for again, so that it is not at risk at L. `docs/statistics.md` derives this.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Survival(NamedTuple):
    """A survival curve, and the tracks behind it.

    Attributes
    ----------
    at_risk : (..., lifetimes, ...) float64
        Tracks that lived longer than each lifetime, or ended at it.
    beyond : (..., lifetimes, ...) float64
        Estimated probability to live longer than each lifetime. It stays the same where no track is at risk.
    """

    at_risk: NDArray[np.float64]
    beyond: NDArray[np.float64]


def kaplan_meier(
    n_ended: ArrayLike, n_censored: ArrayLike, *, n_events: ArrayLike | None = None, axis: int = -1
) -> Survival:
    """Kaplan-Meier estimate of the survival beyond each lifetime: the product of 1 - n_events / at_risk up to it.

    Parameters
    ----------
    n_ended, n_censored : (..., lifetimes, ...)
        Counts, or weighted counts, of the tracks that ended at each lifetime, and of those that were alive in the last
        frame of their sequence. Lifetimes ascend.
    n_events : (..., lifetimes, ...)
        Those of `n_ended` that count as events; all by default. The others are censored at the lifetime at which they
        ended. They were looked for once more, so that they are at risk there.
    axis
        The axis along which lifetimes run.

    Returns
    -------
    Survival
        Of the shape of the counts.
    """
    ended, censored = (np.asarray(count, dtype=np.float64) for count in (n_ended, n_censored))
    events = ended if n_events is None else np.asarray(n_events, dtype=np.float64)
    reached = np.flip(np.cumsum(np.flip(ended + censored, axis), axis=axis), axis)
    at_risk = reached - censored
    stays = 1 - events / np.where(at_risk > 0, at_risk, 1.0)
    return Survival(at_risk, np.asarray(np.cumprod(stays, axis=axis), dtype=np.float64))
