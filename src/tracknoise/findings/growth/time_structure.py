"""How errors behave in time: white, a random walk, or a drift, by condition, trimming and coordinate.

The second moment about zero is fitted over the ages by (growth), and the changes of errors from one frame that the
tracker saw to the next are correlated by (autocorrelation) of `tracknoise.statistics.increments`.

Errors are zero at birth (or in the key frame) by construction. What is measured at age k is n_k - n_0, where n_0 is the
error of the detected position. If n_0 is independent of the later n_k and has the same variance s^2, the second moment
is 2 s^2 from the first age on. `white_px` is the root of the constant, here sqrt(2) s. It is s if the first position
has no error, as with the template of a tracker, or with the oracle.

The moments at all ages come from the same tracks. Each age is weighted by how much its second moment varies when scenes
are resampled. A twentieth of the moment is added to this spread, so that no single age dominates.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import polars as pl

from tracknoise.findings.anchored import NO_KEY_FRAMES, anchored
from tracknoise.findings.estimate import Estimate
from tracknoise.findings.growth.behaviour import Growth, behaves
from tracknoise.findings.growth.fit import TERMS
from tracknoise.findings.growth.grown import GROWTH_SUMS, MIN_AGES, Fit, fit_ages, fitted, mean_drift
from tracknoise.findings.intervals.change_bounds import CHANGE_SUMS, correlated
from tracknoise.findings.sampling.bounds import Method
from tracknoise.findings.sampling.draws import Draws, draws_by_dataset
from tracknoise.findings.sampling.units import additive, units_of
from tracknoise.statistics.conditions import Tables, TablesByCondition, by_condition, scenes_by_dataset
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import reduce_each
from tracknoise.tables.defaults import KIND_OF_INTERVAL, LEVEL, MIN_FEATURES
from tracknoise.tables.enumerations import Behaviour
from tracknoise.tables.findings_schema import TIME_STRUCTURE
from tracknoise.tables.schema import BLOCKS, INCREMENTS, MOMENTS, ORIGIN, check, empty

_KEY = [*POOLED, "trimming"]
_SIZES = dict(zip(TERMS, ("white_px", "walk_px_per_sqrt_frame", "drift_px_per_frame"), strict=True))
ONE_STEP = pl.col("lag") == 1
"""Rows of `INCREMENTS` of which (autocorrelation) at one step is made: all that time structure needs."""


def time_structure(
    moments: Tables,
    increments: pl.DataFrame | Iterable[pl.DataFrame],
    *,
    blocks: Tables = (),
    key_frames: Mapping[str, int] = NO_KEY_FRAMES,
    min_features: int = MIN_FEATURES,
    kind: str = KIND_OF_INTERVAL,
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
        Where a scan makes errors zero in one frame: that frame, by direction. Time is then the distance from it.
    min_features
        Ages are fitted up to the first at which all scenes together have fewer features than this.
    kind, level, n_draws, seed
        As in `tracknoise.findings.intervals.table.interval_table`. For what is fitted, `bca` takes the place of
        `student` (`Method.by_bootstrap`); columns `kind` and `autocorrelation_kind` say which was made.

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
    changes = reduce_each(increments, INCREMENTS, "increments", _of_one_step).partition_by(_KEY, as_dict=True)
    drawn = draws_by_dataset(scenes_by_dataset(by_scene.items()), n_draws=n_draws, seed=seed)
    tables = [empty(TIME_STRUCTURE)]
    for key, part in by_scene.items():
        rows = _rows(part, by_block.get(key), changes.get(key), drawn[key[0]], Method(kind, level), min_features)
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
    """Rows of a condition and trimming, by the columns of `TIME_STRUCTURE`."""
    units = units_of(_apart(scenes), None if blocks is None else _apart(blocks), points=["since"], columns=GROWTH_SUMS)
    ages = fit_ages(units, min_features=min_features)
    fits: tuple[Fit | None, Fit | None] = (None, None)
    made = method.by_bootstrap()
    if np.count_nonzero(ages) >= MIN_AGES and (units.sums[:, ages, 1:].sum(axis=0) > 0).all():
        fits = fitted(units, draws.weights(units), ages, made)
    related = None if changes is None else _related(changes, draws, method, resampled=units.resampled is not None)
    drifts, n_ages = mean_drift(scenes), int(np.count_nonzero(ages))
    labels = {"n_ages": n_ages, "n_scenes": len(units.scenes), "resampled": units.resampled, "kind": made.kind}
    for place, coordinate in enumerate("uv"):
        numbers = _numbers(fits[place], related and related[place], drifts[place], n_ages)
        yield {"coordinate": coordinate, **labels, "autocorrelation_kind": method.kind, **numbers}


def _of_one_step(increments: pl.DataFrame) -> pl.DataFrame:
    """Rows of lag 1 of `INCREMENTS`, with the columns that (autocorrelation) is made of."""
    return increments.filter(ONE_STEP).select(*ORIGIN, "block", "trimming", *CHANGE_SUMS)


def _related(changes: pl.DataFrame, draws: Draws, method: Method, *, resampled: bool) -> tuple[Estimate, Estimate]:
    """(autocorrelation) at one step of u and of v; blocks are resampled where scenes are few, if `resampled`."""
    units = units_of(changes, changes if resampled else None, points=[], columns=CHANGE_SUMS)
    found = correlated(units, draws.weights(units), method)
    return found.at(0), found.at(1)


def _apart(moments: pl.DataFrame) -> pl.DataFrame:
    """Moments by how far they are from where errors are zero, before or after."""
    return moments.with_columns(pl.col("since").abs())


def _numbers(fit: Fit | None, related: Estimate | None, mean_px_per_frame: float, n_ages: int) -> dict[str, Any]:
    """Values with their bounds, and the verdict."""
    found = {} if related is None else {"autocorrelation": related}
    if fit is None:
        few = f"ages with enough errors: {n_ages}; at least {MIN_AGES} are needed"
        verdict, why = Behaviour.undecided, few if n_ages < MIN_AGES else "all errors are zero at some age"
    else:
        found |= {_SIZES[term]: size for term, size in fit.sizes.items()}
        verdict, why = behaves(Growth(fit.sizes, fit.shares, related, mean_px_per_frame, fit.misfit))
    bounds = {
        f"{name}{end}": getattr(estimate, which)
        for name, estimate in found.items()
        for end, which in (("", "value"), ("_low", "low"), ("_high", "high"))
    }
    return {**bounds, "verdict": verdict, "why": why}
