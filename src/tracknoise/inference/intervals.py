"""Intervals of whatever can be computed from the sums of a condition's units: arrays only."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import special

from tracknoise.exceptions import SettingsError
from tracknoise.inference.bootstrap import interval, leave_one_out, resample
from tracknoise.inference.conventions import KIND_OF_INTERVAL, LEVEL, IntervalKind
from tracknoise.inference.estimates import EstimateArray
from tracknoise.inference.jackknife import acceleration, student_interval
from tracknoise.inference.units import MIN_SCENES, MIN_WITHIN, Resampled, Units, by_number

_MANY = 10**9
"""With so many units, percentiles are not expanded."""
Statistics = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Of sums, (columns, points, ...), the statistics, (statistics, points, ...), each NaN where undefined."""


@dataclass(frozen=True, slots=True)
class Method:
    """How intervals are made.

    Parameters
    ----------
    kind
        `student` by `tracknoise.inference.jackknife`, `percentile` and `bca` by the bootstrap of
        `tracknoise.inference.bootstrap`.
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
class BetweenScenes:
    """How much scenes differ in statistics of one condition, (statistics, points), NaN where it is not known."""

    # standard deviation between scenes: of the logarithm of scales, of the logit of shares, otherwise in the unit
    spread: NDArray[np.float64]
    # next_low, next_high: bounds of the next scene's own value
    next_low: NDArray[np.float64]
    next_high: NDArray[np.float64]
    # share of intervals that contain the true value in data like these, outside the tested range
    coverage: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LabelledEstimates:
    """Estimates and what they are of."""

    labels: pl.DataFrame  # columns statistic, axis and at, besides any others: a row for each value, in their order
    estimates: EstimateArray  # the values
    units: Units  # what was resampled
    between: BetweenScenes | None = None  # how much scenes differ in them; None where it was not computed


@dataclass(frozen=True, slots=True)
class Sample:
    """The same numbers of all units, of every draw, and of all units but one.

    `whole` is (statistics, points), `drawn` (statistics, points, draws), `without` (statistics, points, units).
    """

    whole: NDArray[np.float64]
    drawn: NDArray[np.float64]
    without: NDArray[np.float64]

    @classmethod
    def of(
        cls,
        sums: NDArray[np.float64],
        weights: NDArray[np.float64],
        statistics: Statistics,
        joined: NDArray[np.float64] | None = None,
    ) -> "Sample":
        """Statistics of sums (units, points, columns) under weights (draws, units).

        `joined` are the sums of what is left out in turn, (groups, points, columns), by default each unit.
        """
        drawn, without = resample(sums, weights), leave_one_out(sums if joined is None else joined)
        return cls(
            statistics(sums.sum(axis=0).T),
            statistics(np.transpose(drawn, (2, 1, 0))),
            statistics(np.transpose(without, (2, 1, 0))),
        )


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
        Names in `tracknoise.inference.jackknife.SCALES`, for intervals by the jackknife; by default all linear.
    sizes : (points, units) or (statistics, points, units)
        How much a unit holds of what a statistic divides by, by default its first column, a count; units of size 0 take
        no part.
    """
    sample = Sample.of(units.sums, weights, statistics, units.joined(units.sums))
    return _bounded(sample, units, sizes, method, scales)


def pooled_by(
    methods: Sequence[Method],
    units: Units,
    weights: NDArray[np.float64],
    statistics: Statistics,
    *,
    scales: Sequence[str] | str | None = None,
    sizes: NDArray[np.float64] | None = None,
) -> list[EstimateArray]:
    """The same by several methods. The statistics are computed only once.

    Parameters
    ----------
    methods
        How to make intervals.
    units, weights, statistics, sizes
        As in `pooled`.
    scales
        As in `pooled`, or one name for all.
    """
    sample = Sample.of(units.sums, weights, statistics, units.joined(units.sums))
    scale_names = [scales] * len(sample.whole) if isinstance(scales, str) else scales
    return [_bounded(sample, units, sizes, method, scale_names) for method in methods]


def averaged(
    units: Units,
    weights: NDArray[np.float64],
    statistics: Statistics,
    method: Method,
    *,
    scales: Sequence[str] | None = None,
    sizes: NDArray[np.float64] | None = None,
) -> EstimateArray:
    """Mean over scenes of each scene's own statistics; scenes in which one is undefined take no part in it.

    Parameters
    ----------
    units, weights, statistics, method, scales
        As in `pooled`.
    sizes : (statistics, points, units)
        What blocks hold of each statistic, by default their first column.
    """
    if units.resampled == Resampled.blocks:
        return _bounded(_mean_of_scenes(units, weights, statistics), units, sizes, method, scales)
    own_values = _own(units, statistics)
    sums, defined = np.transpose(own_values, (2, 1, 0)), own_values[len(own_values) // 2 :]
    return _bounded(Sample.of(sums, weights, _mean, units.joined(sums)), units, defined, method, scales)


def geometric(
    units: Units,
    weights: NDArray[np.float64],
    logarithms: Statistics,
    method: Method,
    *,
    sizes: NDArray[np.float64] | None = None,
) -> EstimateArray:
    """Geometric mean over scenes of each scene's own statistics, which are scales.

    Where it is 0, because that of a scene is, it has no bounds, unless that of every scene is 0.

    Parameters
    ----------
    units, weights, method
        As in `pooled`.
    logarithms
        Of the statistics; minus infinity where these are 0.
    sizes
        As in `averaged`.
    """
    own_logs = logarithms(np.transpose(by_number(units.scene, units.sums), (2, 1, 0)))
    zeros = np.isneginf(own_logs)
    is_zero, are_zero = zeros.any(axis=-1), (zeros | np.isnan(own_logs)).all(axis=-1)
    estimate = averaged(units, weights, lambda sums: _finite(logarithms(sums)), method, sizes=sizes)
    held = units.sums[..., 0].T if sizes is None else sizes
    has_value = held > 0 if units.resampled == Resampled.blocks else ~np.isnan(own_logs)
    enough, counts = _resampled(units, has_value) > 1, units.contributing(has_value)
    value, *bounds = (np.exp(array) for array in (estimate.value, estimate.low, estimate.high))
    low, high = (np.where(is_zero, np.where(are_zero & enough, 0.0, np.nan), bound) for bound in bounds)
    n_units, n_scenes = (
        np.where(is_zero, n, finite) for n, finite in zip(counts, (estimate.n_units, estimate.n_scenes), strict=True)
    )
    value = np.where(is_zero, 0.0, value)
    return replace(estimate, value=value, low=low, high=high, n_units=n_units, n_scenes=n_scenes)


def column_means(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means from sums whose first row is the count: (rows, ...) gives (rows - 1, ...), NaN where the count is 0."""
    return np.asarray(sums[1:] / np.where(sums[0] > 0, sums[0], np.nan))


def _finite(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.isfinite(values), values, np.nan)


def _own(units: Units, statistics: Statistics) -> NDArray[np.float64]:
    """Each unit's own statistics, 0 where undefined, and whether they are defined, (2 statistics, points, units)."""
    own_values = statistics(np.transpose(units.sums, (2, 1, 0)))
    defined = ~np.isnan(own_values)
    return np.concatenate([np.where(defined, own_values, 0.0), defined])


def _mean(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums of values, the first half of the rows, over how many there are, the second half."""
    total, count = np.split(sums, 2)
    return total / np.where(count > 0, count, np.nan)


def _mean_of_scenes(units: Units, weights: NDArray[np.float64], statistics: Statistics) -> Sample:
    """Mean over scenes, where blocks are resampled within each: leaving out a block changes its scene's value alone."""
    blocks = [units.scene == place for place in range(len(units.scenes))]
    parts = [Sample.of(units.sums[chosen], weights[:, chosen], statistics) for chosen in blocks]
    without = [_mean_of([part.without if part is left else part.whole[..., None] for part in parts]) for left in parts]
    whole, drawn = _mean_of([part.whole for part in parts]), _mean_of([part.drawn for part in parts])
    return Sample(whole, drawn, np.concatenate(without, axis=-1))


def _mean_of(values: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Mean of those that are defined."""
    defined = [~np.isnan(value) for value in values]
    total = sum(np.where(is_defined, value, 0.0) for is_defined, value in zip(defined, values, strict=True))
    count = sum(is_defined.astype(np.float64) for is_defined in defined)
    return np.asarray(total / np.where(count > 0, count, np.nan))


def _bounded(
    sample: Sample, units: Units, sizes: NDArray[np.float64] | None, method: Method, scales: Sequence[str] | None
) -> EstimateArray:
    """Intervals where enough is resampled; `sizes` is as in `pooled`."""
    sizes = units.sums[..., 0].T if sizes is None else sizes
    present = sizes > 0
    n_units, n_scenes = (np.broadcast_to(n, sample.whole.shape) for n in units.contributing(present))
    n = np.broadcast_to(_resampled(units, present), sample.whole.shape)
    held = units.joined(np.moveaxis(sizes.reshape(-1, *sizes.shape[-2:]), -1, 0))
    if method.kind == IntervalKind.student:
        named = scales or ["linear"] * len(sample.whole)
        low, high = _by_jackknife(sample, named, units, n, held, method.level)
    else:
        low, high = _by_bootstrap(sample, units, present, n, method)
    effective = np.broadcast_to(_effective(held), sample.whole.shape)
    return EstimateArray(sample.whole, low, high, n_units, n_scenes, method.kind, method.level, effective)


def _effective(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """How many units of one size have a mean as uncertain as those of these sizes (units, ...)."""
    total, squares = sizes.sum(axis=0), np.square(sizes).sum(axis=0)
    return np.asarray(np.square(total) / np.where(squares > 0, squares, 1.0))


def _resampled(units: Units, present: NDArray[np.bool_]) -> NDArray[np.intp]:
    """How many units are resampled in each number, in each scene if these are blocks; 0 where they are too few."""
    n_units, n_scenes = units.contributing(present)
    if units.resampled == Resampled.blocks:
        return np.asarray(n_units // np.maximum(n_scenes, 1))
    enough = (n_units >= MIN_SCENES) & (units.resampled is not None)
    if units.resampled == Resampled.within:
        enough &= n_units - units.groups_present(present) >= MIN_WITHIN
    return np.where(enough, n_units, 0)


def _by_bootstrap(
    sample: Sample,
    units: Units,
    present: NDArray[np.bool_],
    n: NDArray[np.intp],
    method: Method,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Bounds of statistics from their draws; `n` is what `_resampled` counts."""
    drawn, without = np.moveaxis(sample.drawn, -1, 0), np.moveaxis(sample.without, -1, 0)
    grows = acceleration(without, units.strata) if method.kind == IntervalKind.bca else 0.0
    if units.resampled == Resampled.within:
        freedom = np.maximum(n - units.groups_present(present), 1)
        drawn, n = _stretched(sample.whole, drawn, n, freedom, method.level), np.where(n > 0, _MANY, 0)
    return interval(sample.whole, drawn, n_units=n, acceleration=grows, kind=method.kind, level=method.level)


def _stretched(
    whole: NDArray[np.float64],
    drawn: NDArray[np.float64],
    n: NDArray[np.intp],
    freedom: NDArray[np.intp],
    level: float,
) -> NDArray[np.float64]:
    """Draws (draws, ...) within groups, moved away from the estimate: few draws differ if groups are small.

    Their percentiles are then those of Student's distribution with the degrees of freedom within groups.
    """
    tail = (1 + level) / 2
    factor = special.stdtrit(freedom * 1.0, tail) / special.ndtri(tail) * np.sqrt(n / freedom)
    return np.asarray(whole + (drawn - whole) * factor)


def _by_jackknife(
    sample: Sample,
    scales: Sequence[str],
    units: Units,
    n_units: NDArray[np.intp],
    sizes: NDArray[np.float64],
    level: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Bounds of statistics, each on its scale.

    `n_units` is what `_resampled` counts, `sizes` is (units, statistics or 1, points).
    """
    low, high = np.empty_like(sample.whole), np.empty_like(sample.whole)
    within = units.resampled == Resampled.within
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
            strata=None if within else units.strata,
            groups=units.strata if within else None,
        )
    return low, high
