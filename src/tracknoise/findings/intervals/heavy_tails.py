"""Coverage of intervals of second moments if the biases of scenes have heavy tails, which a few scenes do not show.

It is that of simulated scenes whose number, share of squared biases and spread of variances are those of the data, and
whose biases have Student's distribution of 3 degrees of freedom. It is stated where heavy tails would cost more than
`TOLERATED` of the coverage. `python -m benchmarks.validity.differing_scenes` measures what they cost.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.estimate import EstimateArray
from tracknoise.findings.intervals.biased_scenes import OF_SCENES, Parts, biased_interval, spread_of_biases
from tracknoise.findings.sampling.jackknife import student_interval
from tracknoise.findings.sampling.tested_range import RUNS, parts_of_runs, rounded_count
from tracknoise.findings.sampling.units import MIN_SCENES, Units
from tracknoise.tables.enumerations import IntervalKind

Array = NDArray[np.float64]

TOLERATED = 0.02
"""Coverage that may be lost before it is stated."""
_STEP = 0.2
"""Shares and spreads are rounded to multiples of this."""


def coverage_of_heavy_tails(units: Units, parts: Parts, *, level: float) -> Array:
    """Coverage of the intervals of `tracknoise.findings.intervals.biased_scenes` if biases are heavy-tailed.

    Parameters
    ----------
    units
        Of one condition, with the columns of `tracknoise.findings.sampling.units.SUMS`.
    parts
        Of their second moments.
    level
        Of the intervals.

    Returns
    -------
    (2, points) float64
        Of u and of v; NaN where it is the level to within `TOLERATED`, or where no scenes are resampled.
    """
    found = np.full(parts.biases.shape[1:], np.nan)
    if units.resampled in OF_SCENES:
        shares, spreads = _share_of_biases(parts), _log_spread(parts)
        counts = (parts.sizes[..., 0] > 0).sum(axis=0)
        for place in zip(*np.nonzero(shares >= _STEP), strict=True):
            share, spread = (round(float(part[place]) / _STEP) * _STEP for part in (shares, spreads))
            found[place] = _covered(rounded_count(float(counts[place[0]]), least=MIN_SCENES), share, spread, level)
    return np.where(found < level - TOLERATED, found, np.nan).T


def _share_of_biases(parts: Parts) -> Array:
    """Share of the second moment that is the variance of biases between scenes, (points, 2); 0 where unknown."""
    with np.errstate(divide="ignore", invalid="ignore"):
        total = (parts.squares + parts.variances).sum(axis=0) / parts.sizes.sum(axis=0)
        share = spread_of_biases(parts)[1] / total
    return np.asarray(np.clip(np.nan_to_num(share, posinf=0.0), 0.0, 1.0))


def _log_spread(parts: Parts) -> Array:
    """Standard deviation between units of the logarithm of their own variance, 0 where there are fewer than two."""
    own = parts.variances / np.where(parts.sizes > 0, parts.sizes, 1.0)
    there = own > 0
    logs = np.where(there, np.log(np.where(there, own, 1.0)), 0.0)
    count = there.sum(axis=0)
    mean = logs.sum(axis=0) / np.maximum(count, 1)
    return np.asarray(np.sqrt((there * np.square(logs - mean)).sum(axis=0) / np.maximum(count - 1, 1)))


@lru_cache(maxsize=4096)
def _covered(n: int, share: float, spread: float, level: float) -> float:
    """Share of intervals of simulated scenes that contain the true second moment, 1."""
    heavy, gaussian = _drawn(n)
    biases = np.sqrt(share / 3) * heavy
    variances = (1 - share) * np.exp(spread * gaussian - spread**2 / 2)
    found = [_intervals(biases[:, part], variances[:, part], level) for part in parts_of_runs(n)]
    low, high = np.concatenate(found, axis=2)
    return float(((low <= 1) & (high >= 1)).mean())


@lru_cache(maxsize=1)
def _drawn(n: int) -> tuple[Array, Array]:
    """Of Student's distribution of 3 degrees of freedom, and of a Gaussian, for `RUNS` sets of n scenes."""
    rng, shape = np.random.default_rng(n), (n, RUNS, 1)
    return rng.standard_t(3, size=shape), rng.normal(size=shape)


def _intervals(biases: Array, variances: Array, level: float) -> tuple[Array, Array]:
    """Those of the second moments of scenes of such biases and variances, (scenes, runs, 1)."""
    parts = Parts(np.ones_like(biases), biases, np.square(biases), variances)
    within, total = variances.mean(axis=0), variances.sum(axis=0)
    low, high = student_interval(within, (total - variances) / (len(biases) - 1), scale="log", level=level)
    units, kind = np.full(within.T.shape, len(biases)), IntervalKind.student
    estimates = EstimateArray(within.T, low.T, high.T, units, units, kind, level)
    return biased_interval(parts, estimates, (within + parts.squares.mean(axis=0)).T)
