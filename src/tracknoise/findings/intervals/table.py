"""Confidence intervals of every point of every curve, and of lifetimes, survival and outlier ratio.

Scenes, or groups of them, are left out in turn, or resampled. If there are too few, blocks of tracks within them are
used (`tracknoise.findings.sampling.units`). Intervals of `blocks` cover other tracks in the same scenes, but not other
scenes. The default kind is `student` (`tracknoise.findings.sampling.jackknife`). It contains the true value at least as
often as either kind of bootstrap (`tracknoise.findings.sampling.resampling`), with any number of scenes that was tried.
The advantage is largest with few scenes.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.estimate import EstimateArray
from tracknoise.findings.intervals.between_scenes import (
    between_scenes,
    geometric_rows,
    with_coverage,
    with_estimates,
)
from tracknoise.findings.intervals.biased_scenes import Parts, with_biases
from tracknoise.findings.intervals.change_bounds import (
    AUTOCORRELATION,
    correlated_changes,
    correlation_bounds,
    moments_of_changes,
)
from tracknoise.findings.intervals.core_bounds import core_bounds
from tracknoise.findings.intervals.curve_sums import CurveSums, aspect_sums, error_sums, moments_to_order_2
from tracknoise.findings.intervals.heavy_tails import coverage_of_heavy_tails
from tracknoise.findings.intervals.scalar_bounds import SCALAR_UNITS, lifetime_bounds, outlier_bounds
from tracknoise.findings.sampling.bounds import BetweenScenes, LabelledEstimates, Method, averaged, geometric, pooled
from tracknoise.findings.sampling.draws import N_DRAWS, Draws, draws_by_dataset
from tracknoise.findings.sampling.groups import NO_GROUPS, SceneGroups
from tracknoise.findings.sampling.units import SUMS, Units, units_of
from tracknoise.statistics.conditions import Tables, TablesByCondition, by_condition, scenes_by_dataset
from tracknoise.statistics.definitions import NAMES, POOLED, UNITS
from tracknoise.statistics.tracks.lifetimes import horizons, lifetimes_of_ends
from tracknoise.tables.defaults import KIND_OF_INTERVAL, LEVEL, POPULATION
from tracknoise.tables.enumerations import Aspect, IntervalKind, Weighting
from tracknoise.tables.findings_schema import INTERVALS
from tracknoise.tables.schema import (
    ASPECT_BLOCKS,
    ASPECTS,
    BLOCKS,
    ENDS,
    FRAME_COUNTS,
    INCREMENTS,
    MOMENTS,
    SCALE_BLOCKS,
    SCALES,
    check,
    empty,
)

_POINT = ["trimming", "axis", "at"]
_CURVES = [
    *((role, coordinate) for role in ("mean", "absolute") for coordinate in ("u", "v")),
    *((role, coordinate) for role in ("second", "central") for coordinate in ("u", "v", "uv")),
]
"""What `curve_statistics` returns: the role of each statistic, as in `tracknoise.statistics.errors.curves`, and
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
    population: str = POPULATION,
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
        Horizons of restricted mean lifetimes, as `tracknoise.statistics.tracks.lifetimes.horizons` returns them; by
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
    made = _Making(drawn, method, groups)
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
    """(nu), (eta), (Phi) and central covariance, as `tracknoise.statistics.errors.curves` has them, from sums.

    Parameters
    ----------
    sums : (8, ...)
        Those of `tracknoise.findings.sampling.units.SUMS`.

    Returns
    -------
    (10, ...) float64
        Mean u, v; absolute u, v; second u, v, uv; central u, v, uv, px and px^2; NaN where undefined.
    """
    n, u, v, uu, uv, vv, abs_u, abs_v = sums
    count, divisor = np.where(n > 0, n, np.nan), np.where(n > 1, n - 1, np.nan)
    mean_u, mean_v = u / count, v / count
    central = [np.maximum(uu - u * mean_u, 0.0), np.maximum(vv - v * mean_v, 0.0), uv - u * mean_v]
    spread = [total / divisor for total in (uu, vv, uv, *central)]
    return np.stack([mean_u, mean_v, abs_u / count, abs_v / count, *spread])


@dataclass(frozen=True, slots=True)
class _Making:
    """How intervals are made: draws of the scenes of each dataset, the method, and groups of scenes."""

    drawn: Mapping[str, Draws]
    method: Method
    groups: SceneGroups

    def labels(self, units: Units) -> dict[str, Any]:
        """How the intervals of a condition are made, by column."""
        return {"kind": self.method.kind, "level": self.method.level, "resampled": units.resampled}


def _curve_rows(sums: Iterable[CurveSums], made: _Making) -> Iterator[pl.DataFrame]:
    """Rows of every aspect of every condition."""
    keys = [*POOLED, "aspect", "at_least", "population"]
    for key, scenes, blocks in sums:
        units = units_of(scenes, blocks, points=_POINT, columns=SUMS, groups=made.groups)
        rows = pl.concat(_weighted(units, made.drawn[key[0]].weights(units), made.method))
        meant = _MEANT.get(key[keys.index("aspect")])
        chosen = rows if meant is None else rows.filter(pl.col("role").is_in(meant))
        known = {**dict(zip(keys, key, strict=True)), **made.labels(units)}
        yield _typed(chosen, known, statistic=_STATISTIC, unit=pl.col("role").replace_strict(UNITS))


def _weighted(units: Units, weights: NDArray[np.float64], method: Method) -> Iterator[pl.DataFrame]:
    """Rows of each weighting."""
    roles = pl.DataFrame(_CURVES, schema=["role", "coordinate"], orient="row")
    labels = roles.join(units.points, how="cross")
    by_feature, by_scene = (Parts.of(units, weighting) for weighting in (Weighting.features, Weighting.scenes))
    found = with_biases(units, by_feature, pooled(units, weights, curve_statistics, method, scales=_SCALES), _SECOND)
    between = between_scenes(units, curve_statistics, _SCALES, found)
    beside = _stated(between, units, by_feature, found)
    yield _weighing(Weighting.features, LabelledEstimates(labels, found, units, beside))
    found = with_biases(units, by_scene, averaged(units, weights, curve_statistics, method, scales=_SCALES), _SECOND)
    beside = _stated(with_estimates(between, units, _SCALES, found), units, by_scene, found)
    yield _weighing(Weighting.scenes, LabelledEstimates(labels, found, units, beside))
    labels = roles[_GEOMETRIC].join(units.points, how="cross")
    found = geometric(units, weights, _logarithms, method)
    beside = geometric_rows(between, _GEOMETRIC)
    yield _weighing(Weighting.geometric, LabelledEstimates(labels, found, units, beside))


def _weighing(weighting: Weighting, found: LabelledEstimates) -> pl.DataFrame:
    """Rows with the name of their weighting."""
    rows = _rows(found)
    name = pl.Series("weighting", [weighting], dtype=INTERVALS["weighting"])
    return rows.hstack([name.new_from_index(0, rows.height)])


def _stated(between: BetweenScenes, units: Units, parts: Parts, found: EstimateArray) -> BetweenScenes:
    """The same with the coverage of second moments if biases of scenes have heavy tails."""
    if found.kind != IntervalKind.student:
        return between
    return with_coverage(between, _SECOND, coverage_of_heavy_tails(units, parts, level=found.level))


def _logarithms(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithms of the statistics that have a geometric mean; minus infinity where they are 0."""
    values = curve_statistics(sums)[_GEOMETRIC]
    return np.log(values, out=np.where(values == 0, -np.inf, np.nan), where=values > 0)


def _core_rows(
    scales: TablesByCondition, blocks: TablesByCondition, population: str, made: _Making
) -> Iterator[pl.DataFrame]:
    """Rows of the robust scale of errors, of every condition."""
    for key, part in scales.items():
        known = part.filter(population=population)
        if not known.is_empty():
            within = blocks[key].filter(population=population) if key in blocks else None
            found = core_bounds(known, within, made.drawn[key[0]], made.method, made.groups)
            labels = {**dict(zip(POOLED, key, strict=True)), "aspect": Aspect.all, "at_least": None}
            yield _typed(_rows(found), {**labels, "population": population, "unit": "px", **made.labels(found.units)})


def _scalar_rows(
    tables: TablesByCondition,
    bounded: Callable[[pl.DataFrame, Draws, Method, SceneGroups], Iterator[LabelledEstimates]],
    made: _Making,
) -> Iterator[pl.DataFrame]:
    """Rows of the lifetimes, of the outlier ratio, or of the autocorrelation, of every condition."""
    usual = {"aspect": Aspect.all, **dict.fromkeys(("at_least", "population", "trimming", "weighting", "coordinate"))}
    for key, part in tables.items():
        if found := list(bounded(part, made.drawn[key[0]], made.method, made.groups)):
            rows = pl.concat(map(_rows, found))
            missing = {name: value for name, value in usual.items() if name not in rows.columns}
            known = {**dict(zip(POOLED, key, strict=True)), **missing, **made.labels(found[0].units)}
            yield _typed(rows, known, unit=pl.col("statistic").replace_strict(_SCALARS))


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


def _typed(rows: pl.DataFrame, known: Mapping[str, Any], **computed: pl.Expr) -> pl.DataFrame:
    """Rows with the columns of `INTERVALS`, in one pass: `known` is the same in all of them."""
    columns = {**{name: pl.lit(value) for name, value in known.items()}, **computed}
    return rows.select_seq(columns.get(name, pl.col(name)).cast(kind).alias(name) for name, kind in INTERVALS.items())
