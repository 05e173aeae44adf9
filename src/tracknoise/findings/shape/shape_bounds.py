"""Mardia's numbers, and the gains of other densities, for the bands of one condition, with intervals."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.sampling.bounds import Bounds, Method, pooled
from tracknoise.findings.sampling.resampling import MIN_SCENES
from tracknoise.findings.sampling.units import Draws, Units, units_of
from tracknoise.findings.shape.held_out import gains
from tracknoise.findings.shape.mardia import ORDERS, mardia
from tracknoise.findings.shape.standard import POWER_SUMS
from tracknoise.statistics.blocks import BLOCKS
from tracknoise.statistics.grouping import group_rows

Array = NDArray[np.float64]

BAND = ["trimming", "age_low"]
"""What tells the bands of a condition apart."""
FOLDS, MANY_FOLDS, MANY = 8, 3, 17
"""Folds of scenes, or of the blocks of each, and of as many scenes as `MANY` or more, among which chance does less."""
_MARDIA = ("skewness", "kurtosis")
_GAINS = ("gain_student", "gain_mixture", "gain_difference")
_TOLD = ("told", "student", "mixture")


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
    by_scene = units_of(sums, points=BAND, columns=POWER_SUMS)
    totals = by_scene.sums.sum(axis=0).T
    exact = dict(zip(_MARDIA, mardia(totals), strict=True))
    found = by_scene.points.with_columns(n=pl.Series(totals[0], dtype=pl.Int64), **exact)
    units = by_scene if by_scene.resampled else _block_sums(singles)
    bounds = _table(units, pooled(units, draws.weights(units), mardia, method), _MARDIA)
    joined = found.join(bounds, on=BAND, how="left", maintain_order="left", suffix=" resampled")
    scaled = [
        (pl.col(f"{name}_{end}") * pl.col(name) / pl.col(f"{name} resampled")).alias(f"{name}_{end}")
        for name in _MARDIA
        for end in ("low", "high")
    ]
    return joined.with_columns(scaled).select(pl.exclude("^.* resampled$"))


def gain_bounds(singles: pl.DataFrame, draws: Draws, method: Method, *, seed: int) -> tuple[pl.DataFrame, Units]:
    """Gains of Student's t and of the mixture in each band, and the parameters of their fits.

    Parameters
    ----------
    singles
        What `tracknoise.findings.shape.standard.standardised` made of the samples of one condition.
    draws, method
        How to resample.
    seed
        Decides which scenes, if they are more than `FOLDS`, or which blocks are put into one fold.

    Returns
    -------
    bounds : polars.DataFrame
        `BAND`, `gain_student`, `gain_mixture` and `gain_difference` (the mixture's above Student's), each with its
        bounds; `nu`, `spread_px`, `share` and `ratio`; NaN where there is none.
    units : Units
        What was resampled.
    """
    groups = group_rows(singles, BAND)
    pairs = singles.select("z_u", "z_v").to_numpy()
    found = gains(pairs, groups.index, _folds(singles, seed), groups.count)
    told = ~np.isnan(found.student)
    columns = zip(_TOLD, (told * 1.0, np.nan_to_num(found.student), np.nan_to_num(found.mixture)), strict=True)
    rows = singles.select("scene", "block", *BAND).with_columns(**dict(columns))
    units = units_of(rows, rows, points=BAND, columns=_TOLD)
    bounds = _table(units, pooled(units, draws.weights(units), _per_error, method), _GAINS)
    size = np.bincount(groups.index, singles["log_spread"].to_numpy(), groups.count) / np.bincount(groups.index)
    parameters = groups.keys.with_columns(
        nu=found.nu, spread_px=found.spread * np.exp(size), share=found.share, ratio=found.ratio
    )
    return bounds.join(parameters, on=BAND, maintain_order="left"), units


def _block_sums(singles: pl.DataFrame) -> Units:
    """`POWER_SUMS` of single errors by block."""
    u, v = singles["z_u"].to_numpy(), singles["z_v"].to_numpy()
    powers = {name: u**p * v**q for name, (p, q) in zip(POWER_SUMS, ORDERS, strict=True)}
    rows = singles.select("scene", "block", *BAND).with_columns(**powers)
    return units_of(rows, rows, points=BAND, columns=POWER_SUMS)


def _per_error(sums: Array) -> Array:
    """Gains of `_GAINS` from sums of `_TOLD`."""
    told, student, mixture = sums
    return np.stack([student, mixture, mixture - student]) / np.where(told > 0, told, np.nan)


def _folds(singles: pl.DataFrame, seed: int) -> NDArray[np.intp]:
    """Of which fold each row is: that of its scene or, where scenes are few, that of its block, drawn in each scene."""
    rng = np.random.default_rng(seed)
    scenes = group_rows(singles, ["scene"])
    if scenes.count >= MIN_SCENES:
        folds = FOLDS if scenes.count < MANY else MANY_FOLDS
        return np.asarray(rng.permutation(scenes.count)[scenes.index] % folds)
    blocks = np.stack([rng.permutation(BLOCKS) % FOLDS for _ in range(scenes.count)])
    return np.asarray(blocks[scenes.index, singles["block"].to_numpy()])


def _table(units: Units, bounds: Bounds, names: Sequence[str]) -> pl.DataFrame:
    """A row a point, a column a statistic and either of its bounds."""
    ends = {"": bounds.value, "_low": bounds.low, "_high": bounds.high}
    columns = {f"{name}{end}": values[row] for row, name in enumerate(names) for end, values in ends.items()}
    return units.points.hstack(pl.DataFrame(columns))
