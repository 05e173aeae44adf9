"""Mardia's numbers, and the gains of other densities, for the bands of one condition, with intervals."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.estimate import EstimateArray
from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.groups import SceneGroups, scheme
from tracknoise.findings.sampling.units import Units, units_of
from tracknoise.findings.shape.gains import Gains
from tracknoise.findings.shape.mardia import ORDERS, POWER_SUMS, mardia
from tracknoise.statistics.blocks import BLOCKS
from tracknoise.statistics.grouping import Groups, group_rows

Array = NDArray[np.float64]

BAND = ["trimming", "age_low"]
"""Columns that identify the bands of a condition."""
FOLDS, MANY_FOLDS, MANY = 8, 3, 17
"""Folds of scenes, or of the blocks of each, and of as many scenes as `MANY` or more, among which chance does less."""
_UNIT = ("dataset", "scene", "block")
_MARDIA = ("skewness", "kurtosis")
_GAINS = ("gain_student", "gain_mixture", "gain_difference")
_MARDIA_WITHIN = ("skewness_within", "kurtosis_within")
_GAINS_WITHIN = ("gain_student_within", "gain_mixture_within", "gain_difference_within", "gain_scales")
_BOTH = ("scored", "whole", "student", "mixture")
_SCORED = ("scored", "student", "mixture")


def mardia_bounds(sums: pl.DataFrame, singles: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """Skewness and kurtosis of each band, from the moments of all errors.

    Blocks have no moments beyond order 2. Where scenes are too few, the relative width of the interval is therefore
    that of single errors, resampled by block, which are fewer.

    Parameters
    ----------
    sums
        What `tracknoise.findings.shape.standard.standard_sums` made of the moments of one condition, with `age_low`.
    singles
        What `tracknoise.findings.shape.standard.standardised` made of its samples.
    draws, method
        How to resample.

    Returns
    -------
    polars.DataFrame
        `BAND`, n, and skewness and kurtosis, each with its bounds (``_low``, ``_high``); NaN where there is none.
    """
    by_scene = units_of(sums, points=BAND, columns=POWER_SUMS, groups=draws.groups).across_groups()
    totals = by_scene.sums.sum(axis=0).T
    exact = dict(zip(_MARDIA, mardia(totals), strict=True))
    found = by_scene.points.with_columns(n=pl.Series(totals[0], dtype=pl.Int64), **exact)
    units = by_scene if by_scene.resampled else _block_sums(singles, draws.groups)
    bounds = _table(units, pooled(units, draws.weights(units), mardia, method), _MARDIA)
    joined = found.join(bounds, on=BAND, how="left", maintain_order="left", suffix=" resampled")
    scaled = [
        (pl.col(f"{name}_{end}") * pl.col(name) / pl.col(f"{name} resampled")).alias(f"{name}_{end}")
        for name in _MARDIA
        for end in ("low", "high")
    ]
    return joined.with_columns(scaled).select(pl.exclude("^.* resampled$"))


def gain_bounds(
    singles: pl.DataFrame, bands: Groups, gained: Gains, draws: Draws, method: Method
) -> tuple[pl.DataFrame, Units]:
    """Gains of Student's t and of the mixture in each band, and the parameters of their fits.

    Parameters
    ----------
    singles
        What `tracknoise.findings.shape.standard.standardised` made of the samples of one condition.
    bands
        Their rows by `BAND`.
    gained
        What `tracknoise.findings.shape.held_out.gains` returned for them, with the bands as samples.
    draws, method
        How to resample.

    Returns
    -------
    bounds : polars.DataFrame
        `BAND`, `gain_student`, `gain_mixture` and `gain_difference` (the mixture's above Student's), each with its
        bounds; `nu`, `spread_px`, `share` and `ratio`; NaN where there is none.
    units : Units
        What was resampled.
    """
    scored = ~np.isnan(gained.student)
    sums = (scored * 1.0, np.nan_to_num(gained.student), np.nan_to_num(gained.mixture))
    columns = zip(_SCORED, sums, strict=True)
    rows = singles.select(*_UNIT, *BAND).with_columns(**dict(columns))
    units = units_of(rows, rows, points=BAND, columns=_SCORED, groups=draws.groups).across_groups()
    bounds = _table(units, pooled(units, draws.weights(units), _per_error, method), _GAINS)
    size = np.bincount(bands.index, singles["log_spread"].to_numpy(), bands.count) / np.bincount(bands.index)
    parameters = bands.keys.with_columns(
        nu=gained.nu, spread_px=gained.spread * np.exp(size), share=gained.share, ratio=gained.ratio
    )
    return bounds.join(parameters, on=BAND, maintain_order="left"), units


def within_bounds(
    singles: pl.DataFrame, pairs: Array, gained: tuple[Gains, Gains], draws: Draws, method: Method
) -> pl.DataFrame:
    """Numbers of errors in units of their own scene, and what the different scales of scenes add.

    Parameters
    ----------
    singles
        As in `gain_bounds`.
    pairs : (rows, 2)
        What `tracknoise.findings.shape.within.within_scenes` made of them.
    gained
        Gains of errors as they are, and in units of their own scene; NaN where there are none.
    draws, method
        How to resample.

    Returns
    -------
    polars.DataFrame
        `BAND`, `skewness_within`, `kurtosis_within`, `gain_student_within`, `gain_mixture_within`,
        `gain_difference_within` and `gain_scales`, which is Student's gain without units of scenes less that with
        them, each with its bounds; NaN where there is none.
    """
    whole, within = gained
    scored = ~(np.isnan(whole.student) | np.isnan(within.student))
    values = (scored, whole.student, within.student, within.mixture)
    sums = dict(zip(_BOTH, (np.where(scored, value, 0.0) for value in values), strict=True))
    there = ~np.isnan(pairs[:, 0])
    u, v = np.where(there[:, None], pairs, 0.0).T
    of_u, of_v = ([there * 1.0, axis, axis**2, axis**2 * axis, axis**2 * axis**2] for axis in (u, v))
    powers = {name: of_u[p] * of_v[q] for name, (p, q) in zip(POWER_SUMS, ORDERS, strict=True)}
    rows = singles.select(*_UNIT, *BAND).with_columns(**sums, **powers)
    columns = [*POWER_SUMS, *_BOTH]
    every = units_of(rows, rows, points=BAND, columns=columns, groups=draws.groups).across_groups()
    moments, units = (replace(every, sums=part) for part in np.split(every.sums, [len(POWER_SUMS)], axis=-1))
    found = _table(moments, pooled(moments, draws.weights(moments), mardia, method), _MARDIA_WITHIN)
    bounds = _table(units, pooled(units, draws.weights(units), _per_error_within, method), _GAINS_WITHIN)
    return found.join(bounds, on=BAND, maintain_order="left")


def _per_error_within(sums: Array) -> Array:
    """Gains of `_GAINS_WITHIN` from sums of `_BOTH`."""
    scored, whole, student, mixture = sums
    return np.stack([student, mixture, mixture - student, whole - student]) / np.where(scored > 0, scored, np.nan)


def _block_sums(singles: pl.DataFrame, groups: SceneGroups) -> Units:
    """`POWER_SUMS` of single errors by block."""
    u, v = singles["z_u"].to_numpy(), singles["z_v"].to_numpy()
    powers = {name: u**p * v**q for name, (p, q) in zip(POWER_SUMS, ORDERS, strict=True)}
    rows = singles.select(*_UNIT, *BAND).with_columns(**powers)
    return units_of(rows, rows, points=BAND, columns=POWER_SUMS, groups=groups)


def _per_error(sums: Array) -> Array:
    """Gains of `_GAINS` from sums of `_SCORED`."""
    scored, student, mixture = sums
    return np.stack([student, mixture, mixture - student]) / np.where(scored > 0, scored, np.nan)


def folds_of(singles: pl.DataFrame, groups: SceneGroups, seed: int) -> NDArray[np.intp]:
    """Fold of each row: that of its scene or, where blocks are resampled, that of its block, drawn in each scene.

    Parameters
    ----------
    singles
        As in `gain_bounds`.
    groups
        Groups of scenes that are not independent of each other.
    seed
        Decides which scenes, if they are more than `FOLDS`, or which blocks are put into one fold.
    """
    rng = np.random.default_rng(seed)
    scenes = group_rows(singles, ["scene"])
    group = groups.of(singles["dataset"][0], scenes.keys["scene"].to_list())
    if scheme(group) is not None:
        folds = FOLDS if scenes.count < MANY else MANY_FOLDS
        return np.asarray(rng.permutation(scenes.count)[scenes.index] % folds)
    blocks = np.stack([rng.permutation(BLOCKS) % FOLDS for _ in range(scenes.count)])
    return np.asarray(blocks[scenes.index, singles["block"].to_numpy()])


def _table(units: Units, bounds: EstimateArray, names: Sequence[str]) -> pl.DataFrame:
    """One row per point; columns for each statistic and its bounds."""
    ends = {"": bounds.value, "_low": bounds.low, "_high": bounds.high}
    columns = {f"{name}{end}": values[row] for row, name in enumerate(names) for end, values in ends.items()}
    return units.points.hstack(pl.DataFrame(columns))
