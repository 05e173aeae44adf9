"""Confidence intervals of every point of every curve of a run, and of lifetimes, survival and outlier ratio.

Scenes, or groups of them, are left out in turn, or resampled. If there are too few, blocks of tracks within them are
used (`tracknoise.analysis.condition_units`). Intervals of `blocks` cover other tracks in the same scenes, but not other
scenes. The default kind is `student` (`tracknoise.inference.jackknife`). It contains the true value at least as
often as either kind of bootstrap (`tracknoise.inference.bootstrap`), with any number of scenes that was tried.
The advantage is largest with few scenes.

A core comes from a median, which does not add up over scenes or blocks. Its logarithm is what is averaged over scenes:
the robust scale is the geometric mean of the cores of the scenes. With too few scenes, the logarithms of the cores of
blocks are resampled within each scene, for the width of the interval alone. Intervals of (autocorrelation) are made on
Fisher's scale, on which a correlation has no limits.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import special

from tracknoise.analysis.condition_units import SUMS, CurveSums, aspect_sums, error_sums, moments_to_order_2, units_of
from tracknoise.analysis.lifetime_intervals import SCALAR_UNITS, lifetime_bounds, outlier_bounds
from tracknoise.analysis.scene_spread import (
    OF_SCENES,
    Parts,
    between_scenes,
    coverage_of_heavy_tails,
    geometric_rows,
    own_values,
    with_biases,
    with_coverage,
    with_estimates,
    with_heavy_scales,
)
from tracknoise.inference.bootstrap import N_DRAWS, Draws, draws_by_dataset
from tracknoise.inference.conventions import KIND_OF_INTERVAL, LEVEL, IntervalKind
from tracknoise.inference.coverage import coverage_of_heavy_errors
from tracknoise.inference.estimates import EstimateArray
from tracknoise.inference.intervals import BetweenScenes, LabelledEstimates, Method, averaged, geometric, pooled
from tracknoise.inference.units import NO_GROUPS, Resampled, SceneGroups, Units, by_number
from tracknoise.statistics.definitions import NAMES, POOLED, UNITS
from tracknoise.statistics.grouping import Tables, TablesByCondition, by_condition, scenes_by_dataset
from tracknoise.statistics.lifetimes import horizons, lifetimes_of_ends
from tracknoise.tables.defaults import POPULATION as DEFAULT_POPULATION
from tracknoise.tables.enumerations import Aspect, Axis, Population, Weighting
from tracknoise.tables.findings_schema import INTERVALS
from tracknoise.tables.schema import (
    ASPECT,
    ASPECT_BLOCKS,
    ASPECTS,
    AXIS,
    BLOCKS,
    ENDS,
    FRAME_COUNTS,
    INCREMENTS,
    MOMENTS,
    ORIGIN,
    POPULATION,
    SCALE_BLOCKS,
    SCALES,
    check,
    empty,
)

CORE = "core"
_AXES = ("u", "v")
_POINT = ["trimming", "axis", "at"]
_SUMS = ("known_u", "log_u", "known_v", "log_v")


def core_bounds(scales: pl.DataFrame, blocks: pl.DataFrame | None, draws: Draws, method: Method) -> LabelledEstimates:
    """Geometric mean over scenes of their cores, of u and of v at every point.

    `scales`: columns of `SCALES`, rows of one condition and population.
    """
    by_scene = _units(scales, None, draws.groups)
    units = by_scene if by_scene.resampled or blocks is None else _units(scales, blocks, draws.groups)
    held = np.transpose(units.sums[..., 0::2], (2, 1, 0))
    estimates = geometric(units, draws.weights(units), _core_logarithms, method, sizes=held)
    if units.resampled == Resampled.blocks:
        value = geometric(by_scene, np.empty((0, len(by_scene.sums))), _core_logarithms, Method()).value
        moved = value / np.where(estimates.value > 0, estimates.value, np.nan)
        estimates = replace(estimates, value=value, low=estimates.low * moved, high=estimates.high * moved)
    between = between_scenes(by_scene, _cores, ["log"] * len(_AXES), estimates)
    labels = pl.DataFrame({"coordinate": _AXES}).join(by_scene.points, how="cross")
    named = labels.with_columns_seq(statistic=pl.lit(CORE), weighting=pl.lit(Weighting.geometric))
    return LabelledEstimates(named, estimates, units, geometric_rows(between, range(len(_AXES))))


def _units(scales: pl.DataFrame, blocks: pl.DataFrame | None, groups: SceneGroups) -> Units:
    """Units by scene, or by block at the same points."""
    if blocks is None:
        return units_of(_sums(scales), points=_POINT, columns=_SUMS, groups=groups)
    everywhere = scales.select_seq(_POINT).unique().join(scales.select_seq("scene").unique(), how="cross")
    missing = everywhere.with_columns_seq(block=pl.lit(0, dtype=pl.UInt8), **{name: pl.lit(0.0) for name in _SUMS})
    sums = _sums(blocks).join(everywhere, on=[*_POINT, "scene"], how="semi")
    columns = [*_POINT, "scene", "block", *_SUMS]
    every = pl.concat([sums.select_seq(columns), missing.select_seq(columns)])
    return units_of(_sums(scales), every, points=_POINT, columns=_SUMS, groups=groups)


def _sums(scales: pl.DataFrame) -> pl.DataFrame:
    """Rows with the columns of `_SUMS`, 0 where a scene has no core."""
    parts = {}
    for axis in _AXES:
        core = pl.col(f"core_{axis}_px")
        parts[f"known_{axis}"] = core.is_not_null().cast(pl.Float64)
        parts[f"log_{axis}"] = core.log().fill_null(0.0)
    return scales.with_columns_seq(**parts)


def _core_logarithms(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean logarithm of u and of v from `_SUMS`, (2, points, ...), NaN where there is none."""
    counted, total = sums[0::2], sums[1::2]
    return np.asarray(total / np.where(counted > 0, counted, np.nan))


def _cores(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.exp(_core_logarithms(sums))


AUTOCORRELATION = "autocorrelation"
CHANGE_SUMS = ("n", "lagged_uu", "squares_uu", "lagged_vv", "squares_vv")
"""What (autocorrelation) is made of: the count of pairs of changes, and the sums of their products and squares."""
_MOMENTS = ("mean_u", "mean_v", "m_uu", "m_uv", "m_vv")
_CHANGE_POINT = ["trimming", "lag"]


def moments_of_changes(increments: TablesByCondition) -> TablesByCondition:
    """Rows of lag 0 of `INCREMENTS` as moments of an aspect, but for absolute values, which count as 0."""
    return {key: _as_moments(part) for key, part in increments.items()}


def _as_moments(increments: pl.DataFrame) -> pl.DataFrame:
    return increments.filter(pl.col("lag") == 0).select_seq(
        pl.lit(Aspect.change, dtype=ASPECT).alias("aspect"),
        pl.lit(None, dtype=pl.UInt32).alias("at_least"),
        *ORIGIN,
        pl.lit(Population.visible, dtype=POPULATION).alias("population"),
        "trimming",
        pl.lit(Axis.age, dtype=AXIS).alias("axis"),
        pl.col("age").alias("at"),
        "n",
        *_MOMENTS,
        mean_abs_u=pl.lit(0.0),
        mean_abs_v=pl.lit(0.0),
    )


def correlated_changes(increments: TablesByCondition) -> TablesByCondition:
    """Rows of `INCREMENTS` of which (autocorrelation) is made, of the conditions that have any."""
    pairs = {key: part.filter(pl.col("lag") > 0) for key, part in increments.items()}
    return {key: part for key, part in pairs.items() if not part.is_empty()}


def correlation_bounds(increments: pl.DataFrame, draws: Draws, method: Method) -> Iterator[LabelledEstimates]:
    """(autocorrelation) at every lag, of u and of v."""
    units = units_of(increments, increments, points=_CHANGE_POINT, columns=CHANGE_SUMS, groups=draws.groups)
    coordinates = pl.DataFrame({"coordinate": ["u", "v"]})
    labels = coordinates.join(units.points.rename({"lag": "at"}), how="cross").with_columns_seq(
        statistic=pl.lit(AUTOCORRELATION),
        axis=pl.lit("lag"),
        aspect=pl.lit(Aspect.change, dtype=ASPECT),
        population=pl.lit(Population.visible),
    )
    yield LabelledEstimates(labels, correlated(units, draws.weights(units), method), units)


def correlated(units: Units, weights: NDArray[np.float64], method: Method) -> EstimateArray:
    """(autocorrelation) of u and of v, with intervals; what a unit weighs in it are the squares of its changes.

    Shapes: weights (draws, units). `units`: columns `CHANGE_SUMS`.
    """
    squares = np.stack([units.sums[..., CHANGE_SUMS.index(name)].T for name in ("squares_uu", "squares_vv")])
    return pooled(units, weights, _autocorrelation, method, scales=["fisher"] * 2, sizes=squares)


def _autocorrelation(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of u and of v, (2, points, ...)."""
    _, lagged_u, squares_u, lagged_v, squares_v = sums
    squares = np.stack([squares_u, squares_v])
    return np.asarray(np.stack([lagged_u, lagged_v]) / np.where(squares > 0, squares, np.nan))


_CURVES = [
    *((role, coordinate) for role in ("mean", "absolute") for coordinate in ("u", "v")),
    *((role, coordinate) for role in ("second", "central") for coordinate in ("u", "v", "uv")),
]
"""What `curve_statistics` returns: the role of each statistic, as in `tracknoise.statistics.curves`, and
coordinate."""
_MEANT = {Aspect.gradient: ("absolute", "second"), Aspect.change: ("mean", "second", "central")}
"""Roles that an aspect has, if not all: a gradient has no sign, and of changes no absolute values are kept."""
_SCALES = ["linear" if role == "mean" or coordinate == "uv" else "log" for role, coordinate in _CURVES]
_GEOMETRIC = [row for row, scale in enumerate(_SCALES) if scale == "log" and _CURVES[row][0] != "central"]
"""Rows of `curve_statistics` that have a geometric mean over scenes."""
_SECOND = [_CURVES.index(("second", coordinate)) for coordinate in "uv"]
_SCALARS: Mapping[str, str] = {**SCALAR_UNITS, AUTOCORRELATION: "1"}
_BETWEEN = ("spread", "next_low", "next_high", "coverage")
_NUMBERS = ["value", "low", "high", *_BETWEEN]
_POWERS = {row: 1.0 if _CURVES[row][0] == "second" else 0.5 for row in _GEOMETRIC}
"""Power of the squared scale that a statistic is, by row."""
_ABSOLUTE_OF = {_CURVES.index(("second", axis)): _CURVES.index(("absolute", axis)) for axis in "uv"}
"""Row of the mean absolute error of a coordinate, by that of its second moment."""
_Heavy = Mapping[int, tuple[NDArray[np.float64], NDArray[np.float64]]]
"""By row of a second moment: coverage of its mean and of its geometric mean over scenes, (points,) each."""
_STATISTIC = pl.coalesce(
    pl.when(axis=axis).then(pl.col("role").replace_strict(called)) for axis, called in NAMES.items()
)
"""Name of a statistic, from its role."""
_SORTED = ["aspect", "at_least", "population", "trimming", "weighting", "statistic", "axis", "at", "coordinate"]


def interval_table(
    moments: Tables,
    ends: Tables,
    frames: Tables,
    *,
    blocks: Tables = (),
    aspects: Tables = (),
    changes: Tables = (),
    aspect_blocks: Tables = (),
    scales: Tables = (),
    scale_blocks: Tables = (),
    groups: SceneGroups = NO_GROUPS,
    restricted_to: pl.DataFrame | None = None,
    population: str = DEFAULT_POPULATION,
    kind: str = KIND_OF_INTERVAL,
    level: float = LEVEL,
    n_draws: int = N_DRAWS,
    seed: int = 0,
) -> pl.DataFrame:
    """Intervals of every point of all curves, and of all numbers of which each condition has one.

    Parameters
    ----------
    moments, ends, frames
        Tables of all scenes, `MOMENTS`, `ENDS` and `FRAME_COUNTS`.
    blocks
        Schema `BLOCKS`: what to resample in conditions of too few scenes. Without it the
        errors of such conditions have no bounds; lifetimes and outlier ratios do.
    aspects
        Schema `ASPECTS`, for intervals of these, too; along the gradient, an axis without sign, of absolute errors and
        second moments only. No more of them is held than that needs.
    changes
        Schema `INCREMENTS`, for intervals of the changes of errors from frame to frame: of their mean and second
        moments by age, and of their autocorrelation by lag.
    aspect_blocks
        Schema `ASPECT_BLOCKS`: what to resample of aspects and changes in conditions of too few scenes.
    scales, scale_blocks
        Schemas `SCALES` and `SCALE_BLOCKS`, for intervals of the robust scale of errors.
    groups
        Groups of scenes that are not independent of each other: these, or scenes within them, are resampled.
    restricted_to
        Horizons of restricted mean lifetimes, as `tracknoise.statistics.lifetimes.horizons` returns them; by
        default those of `ends`.
    population
        Which observations the errors are of: `visible` or `projected`.
    kind
        `student`, `percentile` or `bca`.
    level
        Probability that an interval contains the true value.
    n_draws, seed
        Of the bootstrap, which `student` does not need. All conditions of a dataset share their draws, so that a scene
        is drawn with all that belongs to it.

    Returns
    -------
    polars.DataFrame
        Schema `INTERVALS`, sorted. `value` is that of the tables of curves and of the summary. Bounds are null where
        the value is, where fewer than `MIN_SCENES` scenes of a condition that has as many take part, and for
        quantiles of lifetimes that the bounds of the survival curve do not reach. `n_units` and
        `n_scenes` count what takes part. Blocks of the outlier ratio are of frames that follow one another.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    errors = by_condition(moments, MOMENTS, "moments")
    lived, seen = by_condition(ends, ENDS, "ends"), by_condition(frames, FRAME_COUNTS, "frames")
    scenes = scenes_by_dataset(chain(errors.items(), lived.items(), seen.items()))
    drawn = draws_by_dataset(scenes, n_draws=0 if kind == IntervalKind.student else n_draws, seed=seed, groups=groups)
    method = Method(kind, level)
    moved = by_condition(changes, INCREMENTS, "increments")
    within = by_condition(aspect_blocks, ASPECT_BLOCKS, "blocks of aspects")
    made = _Making(drawn, method)
    cores, core_blocks = (
        by_condition(scales, SCALES, "scales"),
        by_condition(scale_blocks, SCALE_BLOCKS, "scale blocks"),
    )
    parts = [
        *_curve_rows(error_sums(errors, by_condition(blocks, BLOCKS, "blocks"), population), made),
        *_curve_rows(aspect_sums(by_condition(aspects, ASPECTS, "aspects", moments_to_order_2), within), made),
        *_curve_rows(aspect_sums(moments_of_changes(moved), within), made),
        *_core_rows(cores, core_blocks, population, made),
        *_lifetime_rows(lived, made, restricted_to),
        *_scalar_rows(seen, outlier_bounds, made),
        *_scalar_rows(correlated_changes(moved), correlation_bounds, made),
    ]
    table = pl.concat([empty(INTERVALS), *parts]).with_columns_seq(pl.col(_NUMBERS).fill_nan(None))
    return check(table.sort(*POOLED, *_SORTED), INTERVALS, "intervals")


def curve_statistics(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """(nu), (eta), (Phi) and central covariance, as `tracknoise.statistics.curves` has them, from sums.

    Shapes: sums (8, ...); returns (10, ...). Mean u, v; absolute u, v; second u, v, uv. Central u, v, uv, px and px^2.
    NaN where undefined.
    """
    n, u, v, uu, uv, vv, abs_u, abs_v = sums
    count, freedom = np.where(n > 0, n, np.nan), np.where(n > 1, n - 1, np.nan)
    mean_u, mean_v = u / count, v / count
    central = [np.maximum(uu - u * mean_u, 0.0), np.maximum(vv - v * mean_v, 0.0), uv - u * mean_v]
    second = [total / count for total in (uu, vv, uv)]
    return np.stack([mean_u, mean_v, abs_u / count, abs_v / count, *second, *(total / freedom for total in central)])


@dataclass(frozen=True, slots=True)
class _Making:
    """How intervals are made: draws of the scenes of each dataset, and the method."""

    drawn: Mapping[str, Draws]
    method: Method

    def labels(self, units: Units) -> dict[str, Any]:
        """How the intervals of a condition are made, by column."""
        return {"kind": self.method.kind, "level": self.method.level, "resampled": units.resampled}


def _curve_rows(sums: Iterable[CurveSums], made: _Making) -> Iterator[pl.DataFrame]:
    """Rows of every aspect of every condition."""
    keys = [*POOLED, "aspect", "at_least", "population"]
    for key, scenes, blocks in sums:
        draws = made.drawn[key[0]]
        units = units_of(scenes, blocks, points=_POINT, columns=SUMS, groups=draws.groups)
        rows = pl.concat(_weighted(units, draws.weights(units), made.method))
        meant = _MEANT.get(key[keys.index("aspect")])
        chosen = rows if meant is None else rows.filter(pl.col("role").is_in(meant))
        labels = {**dict(zip(keys, key, strict=True)), **made.labels(units)}
        yield _typed(chosen, labels, statistic=_STATISTIC, unit=pl.col("role").replace_strict(UNITS))


def _weighted(units: Units, weights: NDArray[np.float64], method: Method) -> Iterator[pl.DataFrame]:
    """Rows of each weighting."""
    roles = pl.DataFrame(_CURVES, schema=["role", "coordinate"], orient="row")
    labels, own = roles.join(units.points, how="cross"), own_values(units, curve_statistics)
    by_feature, by_scene = (Parts.of(units, weighting) for weighting in (Weighting.features, Weighting.scenes))
    estimates = with_biases(
        units, by_feature, pooled(units, weights, curve_statistics, method, scales=_SCALES), _SECOND
    )
    between = between_scenes(units, curve_statistics, _SCALES, estimates)
    heavy = _if_errors_are_heavy(units, own, estimates)
    beside = _stated(between, units, own, by_feature, estimates, heavy)
    yield _weighing(Weighting.features, LabelledEstimates(labels, estimates, units, beside))
    estimates = with_biases(
        units, by_scene, averaged(units, weights, curve_statistics, method, scales=_SCALES), _SECOND
    )
    beside = _stated(with_estimates(between, units, _SCALES, estimates), units, own, by_scene, estimates, heavy)
    yield _weighing(Weighting.scenes, LabelledEstimates(labels, estimates, units, beside))
    labels = roles[_GEOMETRIC].join(units.points, how="cross")
    estimates = geometric(units, weights, curve_logarithms, method)
    beside = geometric_rows(between, _GEOMETRIC)
    for row, (_, typical) in heavy.items():
        beside = with_coverage(beside, [_GEOMETRIC.index(row)], typical[None])
    yield _weighing(Weighting.geometric, LabelledEstimates(labels, estimates, units, beside))


def _weighing(weighting: Weighting, estimates: LabelledEstimates) -> pl.DataFrame:
    """Rows with the name of their weighting."""
    rows = _rows(estimates)
    name = pl.Series("weighting", [weighting], dtype=INTERVALS["weighting"])
    return rows.hstack([name.new_from_index(0, rows.height)])


def _stated(
    between: BetweenScenes,
    units: Units,
    own: NDArray[np.float64],
    parts: Parts,
    estimates: EstimateArray,
    heavy: _Heavy,
) -> BetweenScenes:
    """The same with the coverage if biases or scales of scenes, or single errors, have heavy tails."""
    if not _is_stated(units, estimates):
        return between
    stated = with_coverage(between, _SECOND, coverage_of_heavy_tails(units, parts, level=estimates.level))
    stated = with_heavy_scales(stated, own, estimates, _POWERS)
    for row, (pooled_errors, _) in heavy.items():
        stated = with_coverage(stated, [row], pooled_errors[None])
    return stated


def _is_stated(units: Units, estimates: EstimateArray) -> bool:
    """Whether the coverage of intervals is known under heavy tails."""
    return estimates.kind == IntervalKind.student and units.resampled in OF_SCENES


def _if_errors_are_heavy(units: Units, own: NDArray[np.float64], estimates: EstimateArray) -> _Heavy:
    """Coverage under heavy tails of single errors, by row of a second moment; empty where it is not known."""
    if not _is_stated(units, estimates):
        return {}
    n = by_number(units.scene, units.sums)[..., 0].T
    return {
        second: coverage_of_heavy_errors(own[second], own[absolute], n, level=estimates.level)
        for second, absolute in _ABSOLUTE_OF.items()
    }


def curve_logarithms(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithms of eta and Phi of u and of v, (4, ...), from sums (8, ...); minus infinity where these are 0.

    The logarithm of a mean of n values is too low on average. That of Gaussian errors is added: ln(n / 2) - psi(n / 2)
    of a second moment, and (pi / 2 - 1) / (2 n) of a mean absolute error, to first order.
    """
    values = curve_statistics(sums)[_GEOMETRIC]
    n = np.where(sums[0] > 0, sums[0], np.nan)
    of_second, of_absolute = np.log(n / 2) - special.digamma(n / 2), (np.pi / 2 - 1) / (2 * n)
    too_low = np.stack([of_absolute if _CURVES[row][0] == "absolute" else of_second for row in _GEOMETRIC])
    logs = np.log(values, out=np.where(values == 0, -np.inf, np.nan), where=values > 0)
    return np.asarray(logs + too_low)


def _core_rows(
    scales: TablesByCondition, blocks: TablesByCondition, population: str, made: _Making
) -> Iterator[pl.DataFrame]:
    """Rows of the robust scale of errors, of every condition."""
    for key, part in scales.items():
        of_population = part.filter(population=population)
        if not of_population.is_empty():
            within = blocks[key].filter(population=population) if key in blocks else None
            estimates = core_bounds(of_population, within, made.drawn[key[0]], made.method)
            labels = {**dict(zip(POOLED, key, strict=True)), "aspect": Aspect.all, "at_least": None}
            yield _typed(
                _rows(estimates), {**labels, "population": population, "unit": "px", **made.labels(estimates.units)}
            )


def _scalar_rows(
    tables: TablesByCondition,
    bounded: Callable[[pl.DataFrame, Draws, Method], Iterator[LabelledEstimates]],
    made: _Making,
) -> Iterator[pl.DataFrame]:
    """Rows of the lifetimes, of the outlier ratio, or of the autocorrelation, of every condition."""
    usual = {"aspect": Aspect.all, **dict.fromkeys(("at_least", "population", "trimming", "weighting", "coordinate"))}
    for key, part in tables.items():
        if estimates := list(bounded(part, made.drawn[key[0]], made.method)):
            rows = pl.concat(map(_rows, estimates))
            missing = {name: value for name, value in usual.items() if name not in rows.columns}
            labels = {**dict(zip(POOLED, key, strict=True)), **missing, **made.labels(estimates[0].units)}
            yield _typed(rows, labels, unit=pl.col("statistic").replace_strict(_SCALARS))


def _lifetime_rows(
    lived: TablesByCondition, made: _Making, restricted_to: pl.DataFrame | None
) -> Iterator[pl.DataFrame]:
    """Rows of the lifetimes of every condition. Those of a data set and speed share the horizon of restricted means."""
    shared = horizons(lifetimes_of_ends(lived.values())) if restricted_to is None else restricted_to
    horizon = {(dataset, speed): frames for dataset, speed, frames in shared.iter_rows()}
    for key, part in lived.items():
        here = (key[0], key[POOLED.index("speed")])
        yield from _scalar_rows({key: part}, partial(lifetime_bounds, horizon=horizon[here]), made)


def _rows(found: LabelledEstimates) -> pl.DataFrame:
    """One row per statistic and point."""
    estimates, between = found.estimates, found.between
    values = {name: getattr(estimates, name).ravel() for name in ("value", "low", "high", "n_units", "n_scenes")}
    apart = {name: np.full(estimates.value.size, np.nan) for name in _BETWEEN}
    if between is not None:
        apart = {name: getattr(between, name).ravel() for name in _BETWEEN}
    return found.labels.hstack(pl.DataFrame({**values, **apart}))


def _typed(rows: pl.DataFrame, labels: Mapping[str, Any], **computed: pl.Expr) -> pl.DataFrame:
    """Rows with the columns of `INTERVALS`, in one pass: `known` is the same in all of them."""
    columns = {**{name: pl.lit(value) for name, value in labels.items()}, **computed}
    return rows.select_seq(columns.get(name, pl.col(name)).cast(kind).alias(name) for name, kind in INTERVALS.items())
