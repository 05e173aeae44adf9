"""The rigid share of the errors of every condition, (rigid.share), with intervals."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.intervals.condition_table import USUAL, Sampling, condition_table, estimated
from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.units import units_of
from tracknoise.statistics.conditions import Tables, by_condition
from tracknoise.statistics.definitions import POOLED
from tracknoise.tables.findings_schema import RIGID_SHARE
from tracknoise.tables.schema import RIGID, check

_SUMS = ["n", "error_uu", "error_vv", "left_uu", "left_vv", "rigid_uu", "rigid_vv"]
_POINT = ["fitted_to", "age"]
_COORDINATES = ("u", "v", "both")


def rigid_share(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Share of the second moment that pose errors explain, by age and coordinate.

    Parameters
    ----------
    sums
        Tables of all scenes, schema `RIGID`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `RIGID_SHARE`, sorted.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    conditions = by_condition(sums, RIGID, "rigid")
    table = condition_table(conditions, RIGID_SHARE, _rows, sampling)
    return check(table.sort([*POOLED, *_POINT, "coordinate"]), RIGID_SHARE, "rigid share")


def _rows(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per coordinate, source of the pose errors and age of a condition."""
    units = units_of(sums, sums, points=_POINT, columns=_SUMS, groups=draws.groups)
    found = pooled(units, draws.weights(units), _shares, method)
    labels = pl.DataFrame({"coordinate": _COORDINATES}).join(units.points, how="cross")
    total = units.sums.sum(axis=0).T
    n = np.tile(total[0], len(_COORDINATES))
    moments = {
        name: pl.Series(_by_coordinate(total[places]).ravel() / n)
        for name, places in (("second_px2", slice(1, 3)), ("left_px2", slice(3, 5)))
    }
    rows = estimated(labels, found, units, RIGID_SHARE, value="share").with_columns(pl.Series("n", n), **moments)
    return rows.with_columns(pl.col("share", "low", "high").fill_nan(None)).drop_nulls("share")


def _shares(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares in u, in v and in both, (3, points, ...), of the sums of `_SUMS`; NaN where all errors are 0."""
    error, rigid = _by_coordinate(sums[1:3]), _by_coordinate(sums[5:7])
    return np.asarray(rigid / np.where(error > 0.0, error, np.nan))


def _by_coordinate(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums in u, in v and in both, (3, ...), of those in u and v, (2, ...)."""
    return np.concatenate([sums, sums.sum(axis=0, keepdims=True)])
