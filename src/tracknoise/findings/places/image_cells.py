"""Mean error and spread in each cell of the image, with intervals."""

from dataclasses import replace
from functools import partial

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.intervals.condition_table import USUAL, Sampling, condition_table
from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.units import units_of
from tracknoise.statistics.conditions import Tables, by_condition
from tracknoise.statistics.definitions import POOLED
from tracknoise.tables.findings_schema import IMAGE_CELLS
from tracknoise.tables.schema import IMAGE_MAP, check

_COLUMNS = ["n", "sum_u", "sum_v", "sum_uu", "sum_vv"]
_POINT = ["axis", "at", "row", "column"]


def image_cells(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Mean error of every cell of the image that has an error, in every condition.

    Parameters
    ----------
    sums
        Tables of all scenes, schema `IMAGE_MAP`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `IMAGE_CELLS`, sorted. The bounds in u and in v hold together with the probability of the level.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    conditions = by_condition(
        sums, IMAGE_MAP, "image map", lambda table: table.with_columns_seq(pl.col("n").cast(pl.Int64))
    )
    rows = partial(_rows, level=sampling.level)
    in_each_axis = replace(sampling, level=1.0 - (1.0 - sampling.level) / 2.0)  # Bonferroni's, for u and v
    table = condition_table(conditions, IMAGE_CELLS, rows, in_each_axis)
    return check(table.sort(*POOLED, *_POINT), IMAGE_CELLS, "image cells")


def _rows(sums: pl.DataFrame, draws: Draws, method: Method, level: float) -> pl.DataFrame:
    """One row per age and cell of a condition."""
    units = units_of(sums, sums, points=_POINT, columns=_COLUMNS, groups=draws.groups)
    found = pooled(units, draws.weights(units), _means, method)
    names = ("mean_u", "mean_v", "spread")
    columns = {f"{name}_px": value for name, value in zip(names, found.value, strict=True)}
    for name, low, high in zip(names[:2], found.low, found.high, strict=False):
        columns |= {f"{name}_low": low, f"{name}_high": high}
    differs = ((found.low[:2] > 0) | (found.high[:2] < 0)).any(axis=0)
    known = ~np.isnan(found.low[:2]).any(axis=0)
    return units.points.with_columns_seq(
        pl.col("axis").cast(pl.String),
        *(pl.Series(name, values, dtype=pl.Float64, nan_to_null=True) for name, values in columns.items()),
        n=units.sums[..., 0].sum(axis=0),
        differs=pl.when(pl.Series(known)).then(pl.Series(differs)),
        kind=pl.lit(found.kind),
        level=pl.lit(level),
        resampled=pl.lit(units.resampled, dtype=pl.String),
        n_units=found.n_units[0],
        n_scenes=found.n_scenes[0],
    )


def _means(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean error in u and in v, and the root mean variance of both, (3, points, ...)."""
    n = np.where(sums[0] > 0, sums[0], np.nan)
    u, v, uu, vv = sums[1:] / n
    return np.stack([u, v, np.sqrt(np.maximum(uu - u * u + vv - v * v, 0.0) / 2.0)])
