"""Student's intervals from the jackknife, on a scale on which a statistic has no limits: arrays only.

The standard error of a statistic g is that of its jackknife (Efron and Stein 1981), se^2 = (n - 1) / n sum (g_i - mean
of g_i)^2, g_i being that of all n units but the i-th. With units drawn within s strata of n, the means are those of the
strata, and the factor is ((s n - 1) / (s n))^2 n / (n - 1), which is the same for s = 1. The interval is g +- t se,
with Student's quantile of s (n - 1) degrees of freedom (student). For what is never negative g is the logarithm, for
shares the logit, so that bounds stay within limits, and lie farther out on the side where few units that are far larger
than the others can be missing from a sample. Where the g_i of a unit does not exist, as that of a share of 0, its
linear approximation stands for it.

Of few scenes that differ much, such intervals hold the true value more often than bootstrap percentiles, corrected or
not, and they need no draws: `python -m benchmarks.validity.intervals`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from tracknoise.findings.sampling.resampling import LEVEL, centred

Function = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True, slots=True)
class Scale:
    """A scale on which a statistic has no limits: the limits, to the scale, from it, and its slope there."""

    low: float
    high: float
    to: Function
    back: Function
    slope: Function


SCALES: Mapping[str, Scale] = {
    "linear": Scale(-np.inf, np.inf, np.asarray, np.asarray, np.ones_like),
    "log": Scale(0.0, np.inf, np.log, np.exp, np.reciprocal),
    "logit": Scale(0.0, 1.0, special.logit, special.expit, lambda share: 1 / (share * (1 - share))),
}


def student_interval(
    estimate: ArrayLike,
    jackknife: NDArray[np.float64],
    *,
    scale: str = "linear",
    level: float = LEVEL,
    n_units: ArrayLike | None = None,
    strata: NDArray[np.intp] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two-sided intervals of any number of statistics by (student).

    Parameters
    ----------
    estimate : (...)
        The statistics of all units.
    jackknife : (units, ...)
        Those of all units but one; NaN where there is none.
    scale
        A name in `SCALES`.
    level
        Between 0 and 1.
    n_units : (...)
        How many units the statistics rest on, by default all; with strata, in each of these. At least 2 are needed.
    strata : (units,) intp
        The stratum of each unit, if there are several.

    Returns
    -------
    low, high : (...) float64
        NaN where the estimate is NaN or rests on fewer than two units, and of a share of 0 or 1: that it was never seen
        says nothing of how rare it is among other units. A size of 0 has both bounds there.
    """
    value, to = np.asarray(estimate, dtype=np.float64), SCALES[scale]
    n = np.broadcast_to(len(jackknife) if n_units is None else np.asarray(n_units), value.shape)
    inside = (value > to.low) & (value < to.high)
    safe = np.where(inside, value, 0.5)
    middle, slope = to.to(safe), to.slope(safe)
    there = (jackknife > to.low) & (jackknife < to.high)
    linear = middle + slope * (jackknife - value)
    moved = np.where(there, to.to(np.where(there, jackknife, 0.5)), linear)
    squares: NDArray[np.float64] = (centred(moved, strata) ** 2).sum(axis=0)
    units, n_strata = np.maximum(n, 2), 1 if strata is None else len(np.unique(strata))
    factor = (1 - 1 / (n_strata * units)) ** 2 * units / (units - 1)
    width = special.stdtrit(n_strata * (units - 1.0), (1 + level) / 2) * np.sqrt(factor * squares)
    usable = (n > 1) & ~np.isnan(value) & (inside | (scale != "logit"))
    low, high = (np.where(inside, to.back(middle + shift), value) for shift in (-width, width))
    return np.where(usable, low, np.nan), np.where(usable, high, np.nan)
