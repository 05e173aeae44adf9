"""Mardia's numbers, and the gains of other densities, for the bands of one condition, with intervals."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.estimate import EstimateArray
from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.units import UnitPlaces, Units, units_of
from tracknoise.findings.shape.gains import Gains
from tracknoise.findings.shape.mardia import ORDERS, POWER_SUMS, mardia
from tracknoise.statistics.blocks import BLOCKS
from tracknoise.tables.enumerations import Resampled

Array = NDArray[np.float64]

BAND = ["trimming", "age_low"]
"""Columns that identify the bands of a condition."""
FOLDS, MANY_FOLDS, MANY = 8, 2, 17
"""Folds of scenes, or of the blocks of each, and of as many scenes as `MANY` or more.

Half of so many scenes usually have more errors than are fitted (`MAX_FITTED` of `tracknoise.findings.shape.held_out`).
More folds would not be fitted to more, and would share scenes. Verdicts are as with three folds
(`python -m benchmarks.validity.gaussianity --scenes 28`).
"""
_MARDIA = ("skewness", "kurtosis")
_GAINS = ("gain_student", "gain_mixture", "gain_difference")
_MARDIA_WITHIN = ("skewness_within", "kurtosis_within")
_GAINS_WITHIN = ("gain_student_within", "gain_mixture_within", "gain_difference_within", "gain_scales")


def mardia_bounds(
    sums: pl.DataFrame, singles: pl.DataFrame, places: UnitPlaces, draws: Draws, method: Method
) -> pl.DataFrame:
    """Skewness and kurtosis of each band, from the moments of all errors.

    Blocks have no moments beyond order 2. Where scenes are too few, the relative width of the interval is therefore
    that of single errors, resampled by block, which are fewer.

    Parameters
    ----------
    sums
        What `tracknoise.findings.shape.standard.standard_sums` made of the moments of one condition, with `age_low`.
    singles
        What `tracknoise.findings.shape.standard.standardised` made of its samples.
    places
        Where these are added up; their points are the bands.
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
    found = by_scene.points.with_columns_seq(n=pl.Series(totals[0], dtype=pl.Int64), **exact)
    units = by_scene if by_scene.resampled else places.units(_powers(singles.select_seq("z_u", "z_v").to_numpy()))
    bounds = _table(units, pooled(units, draws.weights(units), mardia, method), _MARDIA)
    joined = found.join(bounds, on=BAND, how="left", maintain_order="left", suffix=" resampled")
    scaled = [
        (pl.col(f"{name}_{end}") * pl.col(name) / pl.col(f"{name} resampled")).alias(f"{name}_{end}")
        for name in _MARDIA
        for end in ("low", "high")
    ]
    return joined.with_columns_seq(scaled).select_seq(pl.exclude("^.* resampled$"))


def gain_bounds(singles: pl.DataFrame, places: UnitPlaces, gained: Gains, draws: Draws, method: Method) -> pl.DataFrame:
    """Gains of Student's t and of the mixture in each band, and the parameters of their fits.

    Parameters
    ----------
    singles
        What `tracknoise.findings.shape.standard.standardised` made of the samples of one condition.
    places
        As in `mardia_bounds`.
    gained
        What `tracknoise.findings.shape.held_out.gains` returned for them, with the bands as samples.
    draws, method
        How to resample.

    Returns
    -------
    polars.DataFrame
        `BAND`, `gain_student`, `gain_mixture` and `gain_difference` (the mixture's above Student's), each with its
        bounds; `nu`, `spread_px`, `share` and `ratio`; NaN where there is none.
    """
    bands, scored = places.points, ~np.isnan(gained.student)
    units = places.units([scored, np.nan_to_num(gained.student), np.nan_to_num(gained.mixture)])
    bounds = _table(units, pooled(units, draws.weights(units), _per_error, method), _GAINS)
    size = np.bincount(bands.index, singles["log_spread"].to_numpy(), bands.count) / np.bincount(bands.index)
    parameters = bands.keys.with_columns_seq(
        nu=gained.nu, spread_px=gained.spread * np.exp(size), share=gained.share, ratio=gained.ratio
    )
    return bounds.join(parameters, on=BAND, maintain_order="left")


def within_bounds(
    pairs: Array, places: UnitPlaces, gained: tuple[Gains, Gains], draws: Draws, method: Method
) -> pl.DataFrame:
    """Numbers of errors in units of their own scene, and what the different scales of scenes add.

    Parameters
    ----------
    pairs : (rows, 2)
        What `tracknoise.findings.shape.within.within_scenes` made of single errors.
    places
        Where these are added up; their points are the bands.
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
    sums = [scored, *(np.where(scored, value, 0.0) for value in (whole.student, within.student, within.mixture))]
    every = places.units([*_powers(pairs), *sums])
    moments, units = (replace(every, sums=part) for part in np.split(every.sums, [len(POWER_SUMS)], axis=-1))
    found = _table(moments, pooled(moments, draws.weights(moments), mardia, method), _MARDIA_WITHIN)
    bounds = _table(units, pooled(units, draws.weights(units), _per_error_within, method), _GAINS_WITHIN)
    return found.join(bounds, on=BAND, maintain_order="left")


def _per_error_within(sums: Array) -> Array:
    """Gains of `_GAINS_WITHIN` from how many errors are scored, and sums of the gains that they are made of."""
    scored, whole, student, mixture = sums
    return np.stack([student, mixture, mixture - student, whole - student]) / np.where(scored > 0, scored, np.nan)


def _powers(pairs: Array) -> list[Array]:
    """What `POWER_SUMS` are sums of, of pairs (rows, 2); 0 where one is NaN."""
    there = ~np.isnan(pairs[:, 0])
    u, v = np.where(there[:, None], pairs, 0.0).T
    of_u, of_v = ([there * 1.0, axis, axis**2, axis**2 * axis, axis**2 * axis**2] for axis in (u, v))
    return [of_u[p] * of_v[q] for p, q in ORDERS]


def _per_error(sums: Array) -> Array:
    """Gains of `_GAINS` from how many errors are scored, and sums of their gains."""
    scored, student, mixture = sums
    return np.stack([student, mixture, mixture - student]) / np.where(scored > 0, scored, np.nan)


def folds_of(places: UnitPlaces, seed: int) -> NDArray[np.intp]:
    """Fold of each row: that of its scene or, where blocks are resampled, that of its block, drawn in each scene.

    Parameters
    ----------
    places
        Of single errors.
    seed
        Decides which scenes, if they are more than `FOLDS`, or which blocks are put into one fold.
    """
    rng, count = np.random.default_rng(seed), len(places.scenes)
    if places.resampled == Resampled.blocks:
        return np.concatenate([rng.permutation(BLOCKS) % FOLDS for _ in range(count)])[places.unit]
    folds = FOLDS if count < MANY else MANY_FOLDS
    return np.asarray(rng.permutation(count)[places.unit] % folds)


def _table(units: Units, bounds: EstimateArray, names: Sequence[str]) -> pl.DataFrame:
    """One row per point; columns for each statistic and its bounds."""
    ends = {"": bounds.value, "_low": bounds.low, "_high": bounds.high}
    columns = {f"{name}{end}": values[row] for row, name in enumerate(names) for end, values in ends.items()}
    return units.points.hstack(pl.DataFrame(columns))
