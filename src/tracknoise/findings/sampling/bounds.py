"""Intervals of whatever can be computed from the sums of a condition's units: arrays only."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import SettingsError
from tracknoise.findings.estimate import EstimateArray
from tracknoise.findings.sampling.jackknife import acceleration, student_interval
from tracknoise.findings.sampling.resampling import interval, leave_one_out, resample
from tracknoise.findings.sampling.units import MIN_SCENES, Units
from tracknoise.tables.defaults import KIND_OF_INTERVAL, LEVEL
from tracknoise.tables.enumerations import IntervalKind, Resampled

Statistics = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Of sums, (columns, points, ...), the statistics, (statistics, points, ...), each NaN where undefined."""


@dataclass(frozen=True, slots=True)
class Method:
    """How intervals are made.

    Parameters
    ----------
    kind
        `student` by `tracknoise.findings.sampling.jackknife`, `percentile` and `bca` by the bootstrap of
        `tracknoise.findings.sampling.resampling`.
    level
        Between 0 and 1.

    Raises
    ------
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """

    kind: str = KIND_OF_INTERVAL
    level: float = LEVEL

    def __post_init__(self) -> None:
        if self.kind not in list(IntervalKind):
            raise SettingsError(f"kind of interval is {self.kind!r}, expected one of {', '.join(IntervalKind)}")
        if not 0 < self.level < 1:
            raise SettingsError(f"level is {self.level}, expected more than 0 and less than 1")

    def by_bootstrap(self) -> "Method":
        """The same, with `bca` in place of `student`: for statistics on which the jackknife fails.

        Student's intervals need a statistic that changes smoothly when a unit is left out, and a scale on which it has
        no limits. Fits with coefficients that may not be negative, and skewness near 0, have neither.
        """
        return Method(IntervalKind.bca, self.level) if self.kind == IntervalKind.student else self


@dataclass(frozen=True, slots=True)
class LabelledEstimates:
    """Estimates and what they are of.

    Attributes
    ----------
    labels
        Columns statistic, axis and at, besides any others: a row for each value, in their order.
    estimates
        The values.
    units
        What was resampled.
    """

    labels: pl.DataFrame
    estimates: EstimateArray
    units: Units


@dataclass(frozen=True, slots=True)
class Sample:
    """The same numbers of all units, of every draw, and of all units but one.

    `whole` is (rows, points), `drawn` (rows, points, draws), `without` (rows, points, units); the rows are columns of
    sums at first, and statistics once these are computed.
    """

    whole: NDArray[np.float64]
    drawn: NDArray[np.float64]
    without: NDArray[np.float64]

    @classmethod
    def of(cls, sums: NDArray[np.float64], weights: NDArray[np.float64]) -> "Sample":
        """Sums (units, points, columns) under weights (draws, units)."""
        drawn, without = resample(sums, weights), leave_one_out(sums)
        return cls(sums.sum(axis=0).T, np.transpose(drawn, (2, 1, 0)), np.transpose(without, (2, 1, 0)))

    def map(self, statistics: Statistics) -> "Sample":
        """Statistics of these sums."""
        return Sample(statistics(self.whole), statistics(self.drawn), statistics(self.without))


def pooled(
    units: Units,
    weights: NDArray[np.float64],
    statistics: Statistics,
    method: Method,
    *,
    scales: Sequence[str] | None = None,
    sizes: NDArray[np.float64] | None = None,
) -> EstimateArray:
    """Statistics of the sums over all units.

    Parameters
    ----------
    units
        The units of a condition.
    weights : (draws, units)
        How often each was drawn; without draws for intervals by the jackknife.
    statistics
        What to compute.
    method
        How to make intervals.
    scales : (statistics,)
        Names in `tracknoise.findings.sampling.jackknife.SCALES`, for intervals by the jackknife; by default all linear.
    sizes : (points, units) or (statistics, points, units)
        How much a unit holds of what a statistic divides by, by default its first column, a count; units of size 0 take
        no part.
    """
    sample = Sample.of(units.sums, weights).map(statistics)
    return _bounded(sample, units, units.sums[..., 0].T if sizes is None else sizes, method, scales)


def averaged(
    units: Units,
    weights: NDArray[np.float64],
    statistics: Statistics,
    method: Method,
    *,
    scales: Sequence[str] | None = None,
) -> EstimateArray:
    """Mean over scenes of each scene's own statistics; scenes in which one is undefined take no part in it.

    Parameters
    ----------
    units, weights, statistics, method, scales
        As in `pooled`.
    """
    if units.resampled == Resampled.blocks:
        return _bounded(_mean_of_scenes(units, weights, statistics), units, units.sums[..., 0].T, method, scales)
    sums = _own(units, statistics)
    sizes = sums[len(sums) // 2 :]
    return _bounded(Sample.of(np.transpose(sums, (2, 1, 0)), weights).map(_mean), units, sizes, method, scales)


def _own(units: Units, statistics: Statistics) -> NDArray[np.float64]:
    """Each unit's own statistics, 0 where undefined, and whether they are defined, (2 statistics, points, units)."""
    own = statistics(np.transpose(units.sums, (2, 1, 0)))
    defined = ~np.isnan(own)
    return np.concatenate([np.where(defined, own, 0.0), defined])


def _mean(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums of values, the first half of the rows, over how many there are, the second half."""
    total, count = np.split(sums, 2)
    return total / np.where(count > 0, count, np.nan)


def _mean_of_scenes(units: Units, weights: NDArray[np.float64], statistics: Statistics) -> Sample:
    """Mean over scenes, where blocks are resampled within each: leaving out a block changes its scene's value alone."""
    blocks = [units.scene == place for place in range(len(units.scenes))]
    parts = [Sample.of(units.sums[chosen], weights[:, chosen]).map(statistics) for chosen in blocks]
    without = [_mean_of([part.without if part is left else part.whole[..., None] for part in parts]) for left in parts]
    whole, drawn = _mean_of([part.whole for part in parts]), _mean_of([part.drawn for part in parts])
    return Sample(whole, drawn, np.concatenate(without, axis=-1))


def _mean_of(values: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Mean of those that are defined."""
    defined = [~np.isnan(value) for value in values]
    total = sum(np.where(known, value, 0.0) for known, value in zip(defined, values, strict=True))
    count = sum(known.astype(np.float64) for known in defined)
    return np.asarray(total / np.where(count > 0, count, np.nan))


def _bounded(
    sample: Sample, units: Units, sizes: NDArray[np.float64], method: Method, scales: Sequence[str] | None
) -> EstimateArray:
    """Intervals where enough is resampled; `sizes` is (points, units) or (statistics, points, units)."""
    n_units, n_scenes = (np.broadcast_to(n, sample.whole.shape) for n in units.contributing(sizes > 0))
    by_block = units.resampled == Resampled.blocks
    in_stratum = n_units // np.maximum(n_scenes, 1) if by_block else np.where(n_scenes >= MIN_SCENES, n_units, 0)
    strata = units.scene if by_block else None
    if method.kind == IntervalKind.student:
        held = np.moveaxis(sizes.reshape(-1, *sizes.shape[-2:]), -1, 0)
        named = scales or ["linear"] * len(sample.whole)
        low, high = _by_jackknife(sample, named, in_stratum, held, strata, method.level)
    else:
        low, high = _by_bootstrap(sample, in_stratum, strata, method)
    return EstimateArray(sample.whole, low, high, n_units, n_scenes, method.kind, method.level)


def _by_bootstrap(
    sample: Sample, n_units: NDArray[np.intp], strata: NDArray[np.intp] | None, method: Method
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Bounds of statistics from their draws."""
    drawn, without = np.moveaxis(sample.drawn, -1, 0), np.moveaxis(sample.without, -1, 0)
    grows = acceleration(without, strata) if method.kind == IntervalKind.bca else 0.0
    kind, level = method.kind, method.level
    return interval(sample.whole, drawn, n_units=n_units, acceleration=grows, kind=kind, level=level)


def _by_jackknife(
    sample: Sample,
    scales: Sequence[str],
    n_units: NDArray[np.intp],
    sizes: NDArray[np.float64],
    strata: NDArray[np.intp] | None,
    level: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Bounds of statistics, each on its scale; `sizes` is (units, statistics or 1, points)."""
    low, high = np.empty_like(sample.whole), np.empty_like(sample.whole)
    for scale in sorted(set(scales)):
        rows = np.array([name == scale for name in scales])
        without = np.moveaxis(sample.without[rows], -1, 0)
        low[rows], high[rows] = student_interval(
            sample.whole[rows],
            without,
            scale=scale,
            level=level,
            n_units=n_units[rows],
            sizes=sizes if sizes.shape[1] == 1 else sizes[:, rows],
            strata=strata,
        )
    return low, high
