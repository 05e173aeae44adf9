"""How errors behave in time: white, a random walk, or a drift, by condition, trimming and coordinate.

The second moment about zero is fitted over the ages by (growth), and the changes of errors from one frame that the
tracker saw to the next are correlated by (autocorrelation) of `tracknoise.statistics.increments`.

Errors are zero at birth (or in the key frame) by construction: what is measured at age k is n_k - n_0, where n_0 is how
far from the feature the detector put it. Where n_0 is of the same kind as the later n_k, independent and of variance
s^2, the second moment is 2 s^2 from the first age on. `white_px` is the root of the constant, and thus sqrt(2) s then;
it is s where nothing is wrong with the first position, as with the template of a tracker, or with the oracle.

As variances at all ages come from the same tracks, each age is weighted by how much its second moment varies when
scenes are drawn again, and a twentieth of itself besides, so that no age decides alone.
"""

from collections.abc import Iterable, Iterator, Mapping
from math import nan
from typing import Any

import numpy as np
import polars as pl

from tracknoise.findings.anchored import NO_KEY_FRAMES, anchored
from tracknoise.findings.growth.behaviour import Growth, behaves
from tracknoise.findings.growth.fit import TERMS
from tracknoise.findings.growth.grown import MIN_AGES, SUMS, Fit, fit_ages, fitted, mean_drift, neighbours, related
from tracknoise.findings.sampling.bounds import Method
from tracknoise.findings.sampling.resampling import LEVEL
from tracknoise.findings.sampling.units import Draws, additive, draws_by_dataset, units_of
from tracknoise.findings.shape.verdict import Interval
from tracknoise.findings.wording import count
from tracknoise.statistics.conditions import Tables, TablesByCondition, by_condition, scenes_by_dataset
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import reduce_each
from tracknoise.tables.findings_schema import TIME_STRUCTURE
from tracknoise.tables.schema import BLOCKS, INCREMENTS, MOMENTS, check, empty

_KEY = [*POOLED, "trimming"]
_SIZES = dict(zip(TERMS, ("white_px", "walk_px_per_sqrt_frame", "drift_px_per_frame"), strict=True))
_UNKNOWN = Interval(nan, nan, nan)


def time_structure(
    moments: Tables,
    increments: pl.DataFrame | Iterable[pl.DataFrame],
    *,
    blocks: Tables = (),
    key_frames: Mapping[str, int] = NO_KEY_FRAMES,
    min_features: int = 100,
    level: float = LEVEL,
    n_draws: int = 1000,
    seed: int = 0,
) -> pl.DataFrame:
    """How visible errors grow, by condition, trimming and coordinate, with intervals and a verdict.

    Parameters
    ----------
    moments, increments
        Of all scenes, `MOMENTS` and `INCREMENTS`.
    blocks
        Schema `BLOCKS`: what to resample in conditions of too few scenes. They have no bounds without, and no verdict.
    key_frames
        Where a scan makes errors zero in one frame: which, by direction. Time is then the distance from it.
    min_features
        Ages are fitted up to the first at which all scenes together have fewer features than this.
    level, n_draws, seed
        As in `tracknoise.findings.intervals.intervals.intervals`.

    Returns
    -------
    polars.DataFrame
        Schema `TIME_STRUCTURE`, sorted: a row for each condition and trimming that has visible errors, and coordinate.
        Where fewer than `MIN_AGES` ages can be fitted there are no numbers, and the verdict is undecided.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    by_scene = _sums(by_condition(moments, MOMENTS, "moments"), key_frames)
    by_block = _sums(by_condition(blocks, BLOCKS, "blocks"), key_frames)
    changes = reduce_each(increments, INCREMENTS, "increments", neighbours).partition_by(_KEY, as_dict=True)
    drawn = draws_by_dataset(scenes_by_dataset(by_scene.items()), n_draws=n_draws, seed=seed)
    tables = [empty(TIME_STRUCTURE)]
    for key, part in by_scene.items():
        rows = _rows(part, by_block.get(key), changes.get(key), drawn[key[0]], Method(level=level), min_features)
        labels = {**dict(zip(_KEY, key, strict=True)), "level": level}
        tables.append(pl.DataFrame([{**labels, **row} for row in rows], schema=dict(TIME_STRUCTURE)))
    table = pl.concat(tables).with_columns(pl.selectors.float().fill_nan(None)).sort(*_KEY, "coordinate")
    return check(table, TIME_STRUCTURE, "time structure")


def _sums(moments: TablesByCondition, key_frames: Mapping[str, int]) -> dict[tuple[Any, ...], pl.DataFrame]:
    """Sums of each condition and trimming; what is added up in one place is of one scene, and in its order."""
    return {
        (*key, *trimming): sums
        for key, part in moments.items()
        for trimming, sums in additive(anchored(part, key_frames)).partition_by("trimming", as_dict=True).items()
    }


def _rows(
    scenes: pl.DataFrame,
    blocks: pl.DataFrame | None,
    changes: pl.DataFrame | None,
    draws: Draws,
    method: Method,
    min_features: int,
) -> Iterator[dict[str, Any]]:
    """The rows of a condition and trimming, by the columns of `TIME_STRUCTURE`."""
    units = units_of(_apart(scenes), None if blocks is None else _apart(blocks), points=["since"], columns=SUMS)
    ages = fit_ages(units, min_features=min_features)
    fits: tuple[Fit | None, Fit | None] = (None, None)
    if np.count_nonzero(ages) >= MIN_AGES and (units.sums[:, ages, 1:].sum(axis=0) > 0).all():
        fits = fitted(units, draws.weights(units), ages, method)
    alike, drifts = (_UNKNOWN, _UNKNOWN), mean_drift(scenes)
    if changes is not None:
        alike = related(changes, draws, Method("student", method.level), resampled=units.resampled is not None)
    n_ages = int(np.count_nonzero(ages))
    for place, coordinate in enumerate("uv"):
        row = {"coordinate": coordinate, "n_ages": n_ages, "n_scenes": len(units.scenes)}
        numbers = _numbers(fits[place], alike[place], drifts[place], n_ages)
        yield {**row, "resampled": units.resampled, **numbers}


def _apart(moments: pl.DataFrame) -> pl.DataFrame:
    """Moments by how far they are from where errors are zero, before or after."""
    return moments.with_columns(pl.col("since").abs())


def _numbers(fit: Fit | None, related: Interval, mean_px_per_frame: float, n_ages: int) -> dict[str, Any]:
    """Values with their bounds, and the verdict."""
    found = {"autocorrelation": related}
    if fit is None:
        few = f"{count(n_ages, 'age')} with enough errors, and at least {MIN_AGES} are needed"
        verdict, why = "undecided", few if n_ages < MIN_AGES else "all errors are zero at some age"
    else:
        found |= {_SIZES[term]: size for term, size in fit.sizes.items()}
        verdict, why = behaves(Growth(fit.sizes, fit.shares, related, mean_px_per_frame, fit.misfit))
    bounds = {
        f"{name}{end}": getattr(interval, which)
        for name, interval in found.items()
        for end, which in (("", "value"), ("_low", "low"), ("_high", "high"))
    }
    return {**bounds, "verdict": verdict, "why": why}
