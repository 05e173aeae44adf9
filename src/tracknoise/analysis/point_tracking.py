"""Metrics of TAP-Vid and expected feature age, averaged over sequences, with intervals."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import USUAL, Sampling, condition_table, estimated, units_of
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.intervals import Method, pooled
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import Tables, by_condition
from tracknoise.tables.findings_schema import POINT_TRACKING_METRICS
from tracknoise.tables.schema import ORIGIN, POINT_TRACKING, check

_POINT = ["raster", "metric"]
_SUMS = ["n", "value"]


def point_tracking_metrics(metrics: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Mean of each metric over the sequences of a condition, all of equal weight.

    Parameters
    ----------
    metrics
        Tables of all scenes, schema `POINT_TRACKING`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `POINT_TRACKING_METRICS`, sorted.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    conditions = by_condition(metrics, POINT_TRACKING, "point tracking")
    table = condition_table(conditions, POINT_TRACKING_METRICS, _rows, sampling)
    return check(table.sort(*POOLED, *_POINT), POINT_TRACKING_METRICS, "point tracking metrics")


def _rows(metrics: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per raster and metric of a condition."""
    named = [name for name in metrics.columns if name not in (*ORIGIN, "raster", "n_points")]
    labels = [name for name in metrics.columns if name not in (*named, "n_points")]
    long = metrics.unpivot(named, index=labels, variable_name="metric").drop_nulls("value")
    counted = long.with_columns_seq(n=pl.lit(1.0))
    units = units_of(counted, points=_POINT, columns=_SUMS, groups=draws.groups)
    found = pooled(units, draws.weights(units), _means, method, scales=["logit"], sizes=units.sums[..., :1].T)
    return estimated(units.points, found, units, POINT_TRACKING_METRICS, value="value")


def _means(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """(1, points, ...) float64: mean over units; NaN where there is none."""
    return np.asarray(sums[1:2] / np.where(sums[:1] > 0, sums[:1], np.nan))
