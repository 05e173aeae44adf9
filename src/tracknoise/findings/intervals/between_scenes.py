"""How much scenes differ, where the next scene is expected, and the coverage of intervals that were not tested."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.estimate import EstimateArray
from tracknoise.findings.sampling.bounds import BetweenScenes, Statistics
from tracknoise.findings.sampling.next_scene import next_scene
from tracknoise.findings.sampling.tested_range import coverage_outside
from tracknoise.findings.sampling.units import Units, by_number
from tracknoise.tables.enumerations import IntervalKind, Resampled

_TESTED = (Resampled.scenes, Resampled.groups)


def between_scenes(
    units: Units, statistics: Statistics, scales: Sequence[str], estimates: EstimateArray
) -> BetweenScenes:
    """How much scenes differ in their own statistics.

    Parameters
    ----------
    units
        The units of the condition.
    statistics
        What to compute of the sums of each scene.
    scales
        Of each statistic, a name in `tracknoise.findings.sampling.jackknife.SCALES`.
    estimates
        Whose coverage is asked for.
    """
    own = own_values(units, statistics)
    found = next_scene(units, own, scales, level=estimates.level)
    return BetweenScenes(found.spread, found.low, found.high, _coverage(estimates, units, found.spread, scales))


def own_values(units: Units, statistics: Statistics) -> NDArray[np.float64]:
    """Statistics of the sums of each scene, (statistics, points, scenes)."""
    return statistics(np.transpose(by_number(units.scene, units.sums), (2, 1, 0)))


def spread_on(units: Units, statistics: Statistics, scale: str, *, level: float) -> NDArray[np.float64]:
    """Standard deviation between scenes, (statistics, points), of all statistics on one scale: see `between_scenes`."""
    own = own_values(units, statistics)
    return next_scene(units, own, [scale] * len(own), level=level).spread


def with_estimates(
    between: BetweenScenes, units: Units, scales: Sequence[str], estimates: EstimateArray
) -> BetweenScenes:
    """The same beside other estimates of the same statistics, whose coverage is asked for."""
    return replace(between, coverage=_coverage(estimates, units, between.spread, scales))


def with_coverage(between: BetweenScenes, rows: Sequence[int], coverage: NDArray[np.float64]) -> BetweenScenes:
    """The same with the coverage of some statistics, (rows, points), where that is known and lower."""
    lowest = between.coverage.copy()
    lowest[list(rows)] = np.fmin(lowest[list(rows)], coverage)
    return replace(between, coverage=lowest)


def geometric_rows(between: BetweenScenes, rows: Sequence[int]) -> BetweenScenes:
    """Of some of the statistics, beside their geometric means: these are tested with any spread."""
    spread, low, high = (array[list(rows)] for array in (between.spread, between.next_low, between.next_high))
    return BetweenScenes(spread, low, high, np.full(spread.shape, np.nan))


def _coverage(
    estimates: EstimateArray, units: Units, spread: NDArray[np.float64], scales: Sequence[str]
) -> NDArray[np.float64]:
    """Coverage of intervals of estimates, (statistics, points), NaN inside the tested range."""
    tested = estimates.kind == IntervalKind.student and units.resampled in _TESTED
    if not tested or estimates.n_effective is None:
        return np.full(spread.shape, np.nan)
    parts = zip(estimates.n_units, spread, estimates.n_effective, scales, strict=True)
    return np.stack([coverage_outside(n, own, worth, scale, level=estimates.level) for n, own, worth, scale in parts])
