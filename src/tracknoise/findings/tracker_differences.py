"""Mean and covariance of the differences between two trackers, (between), with intervals."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.intervals.condition_table import USUAL, Sampling, condition_table, estimated
from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.units import units_of
from tracknoise.statistics.conditions import Tables, by_condition
from tracknoise.statistics.definitions import POOLED, UNITS
from tracknoise.statistics.errors.moment_cells import ABOUT_ZERO
from tracknoise.tables.findings_schema import TRACKER_DIFFERENCES
from tracknoise.tables.schema import BETWEEN_TRACKERS, check

_SUMS = ["n", "u", "v", "uu", "uv", "vv"]
_POINT = ["other", "age"]
_ROWS = (("mean", "u"), ("mean", "v"), ("central", "u"), ("central", "uv"), ("central", "v"))
"""Statistic and coordinate of the rows of each point."""
_SCALES = ("linear", "linear", "log", "linear", "log")


def tracker_differences(moments: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Mean and covariance of the differences of every two trackers, by age.

    Parameters
    ----------
    moments
        Tables of all scenes, schema `BETWEEN_TRACKERS`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `TRACKER_DIFFERENCES`, sorted. Without rows where no two trackers had tracks of the same corner.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    conditions = by_condition(moments, BETWEEN_TRACKERS, "between trackers")
    table = condition_table(conditions, TRACKER_DIFFERENCES, _rows, sampling)
    order = [*POOLED, "other", "statistic", "age", "coordinate"]
    return check(table.sort(order), TRACKER_DIFFERENCES, "tracker differences")


def _rows(moments: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per other tracker, age, statistic and coordinate of a condition."""
    sums = moments.with_columns_seq(**ABOUT_ZERO)
    units = units_of(sums, sums, points=_POINT, columns=_SUMS, groups=draws.groups)
    weights = draws.weights(units)
    found = pooled(units, weights, _statistics, method, scales=_SCALES)
    labels = pl.DataFrame(_ROWS, schema=["statistic", "coordinate"], orient="row").join(units.points, how="cross")
    n = np.tile(units.sums[..., 0].sum(axis=0), len(_ROWS))
    rows = estimated(labels, found, units, TRACKER_DIFFERENCES, value="value").with_columns_seq(
        pl.col("statistic").replace_strict(UNITS).alias("unit"), pl.Series("n", n)
    )
    strict = pooled(units, weights, _statistics, _corrected(method, units.points), scales=_SCALES)
    nonzero = (strict.low > 0.0) | (strict.high < 0.0)
    means = pl.when(pl.col("statistic") == "mean").then(pl.Series(nonzero.ravel()))
    return rows.with_columns_seq(pl.col("value", "low", "high").fill_nan(None), established=means).drop_nulls("value")


def _corrected(method: Method, points: pl.DataFrame) -> Method:
    """Bonferroni's level for both coordinates and all ages of two trackers."""
    n_ages = points["age"].n_unique()
    return Method(method.kind, 1.0 - (1.0 - method.level) / (2.0 * max(n_ages, 1)))


def _statistics(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means and central covariance, (5, points, ...), of the sums of `_SUMS`; NaN where there are none."""
    n, u, v, uu, uv, vv = sums
    count = np.where(n > 0, n, np.nan)
    mean_u, mean_v = u / count, v / count
    pairs = ((uu, mean_u * mean_u), (uv, mean_u * mean_v), (vv, mean_v * mean_v))
    freedom = np.where(n > 1, n - 1, np.nan)
    central = [(product - count * of_means) / freedom for product, of_means in pairs]
    return np.stack([mean_u, mean_v, *central])
