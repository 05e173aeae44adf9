"""Survival with censored lives: the Kaplan-Meier estimate, areas under it, and restricted means.

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
    ended, censored = _as_arrays(n_ended, n_censored)
    events = ended if n_events is None else np.asarray(n_events, dtype=np.float64)
    reached = np.flip(np.cumsum(np.flip(ended + censored, axis), axis=axis), axis)
    at_risk = reached - censored
    stays = 1 - events / np.where(at_risk > 0, at_risk, 1.0)
    return Survival(at_risk, np.asarray(np.cumprod(stays, axis=axis), dtype=np.float64))


def restricted_mean(
    n_ended: ArrayLike, n_censored: ArrayLike, horizon: ArrayLike, *, lifetimes: ArrayLike | None = None
) -> NDArray[np.float64]:
    """Restricted mean lifetime: the Kaplan-Meier estimate of the mean of min(lifetime, horizon), in frames.

    It is the area under the survival curve from 0 to the horizon. Unlike a mean lifetime without a horizon, it does
    not depend on where sequences end, as long as some tracks can be followed to the horizon. Compare lifetimes at a
    common horizon only: the least `follow_up` of all scenes and levels that are compared. That is the largest lifetime
    up to which each of them has follow-up.

    Parameters
    ----------
    n_ended, n_censored : (..., lifetimes)
        Counts, or weighted counts, of the tracks that ended and that were censored at each lifetime.
    horizon
        Frames, above 0; any shape that broadcasts with the counts without their axis of lifetimes.
    lifetimes : (lifetimes,)
        Whole frames, ascending; 1, 2, 3 and so on by default.

    Returns
    -------
    float64
        Of the shape of the counts without their axis of lifetimes. NaN where there is no track, and where the follow-up
        does not reach the horizon and the curve is not yet 0.
    """
    ended, censored = _as_arrays(n_ended, n_censored)
    curve = kaplan_meier(ended, censored).beyond
    area = area_under(curve, _whole_frames(lifetimes, ended.shape[-1]), horizon)
    reached = follow_up(ended, censored, lifetimes=lifetimes)
    return np.where(np.asarray(horizon) <= reached, area, np.nan)


def area_under(curve: NDArray[np.float64], lifetimes: NDArray[np.float64], horizon: ArrayLike) -> NDArray[np.float64]:
    """Area under survival curves from 0 to a horizon, in frames. A curve keeps its last value.

    Parameters
    ----------
    curve : (..., lifetimes)
        Survival beyond each lifetime.
    lifetimes : (lifetimes,)
        Whole frames, ascending.
    horizon : (...)
        Frames.

    Returns
    -------
    (...) float64
    """
    level = np.concatenate([np.ones_like(curve[..., :1]), curve], axis=-1)
    edges = np.concatenate([[0.0], lifetimes, [np.inf]])
    width = np.diff(np.minimum(edges, np.asarray(horizon, dtype=np.float64)[..., None]), axis=-1)
    area: NDArray[np.float64] = (level * width).sum(axis=-1)
    return area


def follow_up(n_ended: ArrayLike, n_censored: ArrayLike, *, lifetimes: ArrayLike | None = None) -> NDArray[np.float64]:
    """Largest horizon to which `restricted_mean` is known, in frames.

    Parameters
    ----------
    n_ended, n_censored, lifetimes
        As in `restricted_mean`.

    Returns
    -------
    float64
        The longest lifetime; infinite where the survival curve reaches 0; NaN where there is no track.
    """
    ended, censored = _as_arrays(n_ended, n_censored)
    seen = (ended + censored > 0) * _whole_frames(lifetimes, ended.shape[-1])
    longest = np.where((kaplan_meier(ended, censored).beyond == 0).any(axis=-1), np.inf, seen.max(axis=-1, initial=0.0))
    return np.where((ended + censored).sum(axis=-1) > 0, longest, np.nan)


def _as_arrays(*counts: ArrayLike) -> list[NDArray[np.float64]]:
    return [np.asarray(count, dtype=np.float64) for count in counts]


def _whole_frames(lifetimes: ArrayLike | None, count: int) -> NDArray[np.float64]:
    return np.arange(1.0, count + 1) if lifetimes is None else np.asarray(lifetimes, dtype=np.float64)
