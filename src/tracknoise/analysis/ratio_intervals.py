"""Ratios of two sums over features, and metrics of point trackers, with intervals over scenes."""

import polars as pl

from tracknoise.analysis.condition_units import USUAL, Sampling, condition_table, estimates_by_point, units_of
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.intervals import Method, column_means, pooled
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import Tables, by_condition
from tracknoise.tables.findings_schema import ESTIMATE_COLUMNS
from tracknoise.tables.quantities import QUANTITIES, ComparedBy, Quantity
from tracknoise.tables.quantities import RATIOS as NAMES_OF_RATIOS
from tracknoise.tables.run_table import ESTIMATED, ESTIMATED_OF_N, OF_CONDITION, Rows, RunTable, Value, one_number, same
from tracknoise.tables.schema import ORIGIN, POINT_TRACKING, RATIOS, TRIMMING
from tracknoise.tables.schema import POOLED as CONDITIONS

POINT_TRACKING_METRICS = RunTable(
    "point_tracking_metrics",
    {
        **CONDITIONS,
        "raster": pl.String,
        "metric": pl.String,
        **ESTIMATE_COLUMNS,
    },
    one_number(
        "point tracking", "point_tracking", "value", {**OF_CONDITION, "part": "raster", "of": "metric"}, ESTIMATED
    ),
    title="metrics of TAP-Vid and expected feature age",
    quantities={
        "point_tracking": Quantity("share", "Metrics of TAP-Vid and expected feature age: means over sequences.")
    },
)
"""Metrics of TAP-Vid and expected feature age: means over sequences, as benchmarks report them.

The table has rows only where the experiment asks for these metrics.
"""

RATIO_VALUES = RunTable(
    "ratios",
    {
        **CONDITIONS,
        "quantity": pl.String,
        "trimming": TRIMMING,
        "axis": pl.String,
        "at": pl.Int64,
        "n": pl.Int64,
        **ESTIMATE_COLUMNS,
    },
    Rows(
        "ratios",
        {**OF_CONDITION, **same("trimming", "axis", "at")},
        [Value(name, "value", {}, {"quantity": name}, ESTIMATED_OF_N) for name in NAMES_OF_RATIOS],
    ),
    title="shares of features by age",
)
"""Ratios of sums over features, by age: the quantities of `tracknoise.tables.quantities.RATIOS`, features pooled."""

_POINT = ["quantity", "trimming", "axis", "at"]
_METRIC = ["raster", "metric"]


def ratio_intervals(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Every ratio at every age, features pooled.

    `sums`: tables of all scenes, schema `RATIOS`. Returns: schema `RATIO_VALUES`, sorted. Raises as
    `condition_table`.
    """
    conditions = by_condition(sums, RATIOS, "ratio sums")
    return condition_table(conditions, RATIO_VALUES, _rows, sampling).sort(*POOLED, *_POINT)


def _rows(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per ratio, trimming and age of a condition."""
    parts = []
    for (name,), part in sums.partition_by("quantity", as_dict=True, maintain_order=True).items():
        units = units_of(part, part, points=_POINT, columns=["n", "sum"], groups=draws.groups)
        estimates = pooled(units, draws.weights(units), column_means, method, scales=[_scale(str(name))])
        parts.append(estimates_by_point(estimates, units, RATIO_VALUES))
    return pl.concat(parts).drop_nulls("value")


def _scale(name: str) -> str:
    """Scale of the intervals of a ratio."""
    if QUANTITIES[name].unit == "share":
        return "logit"
    return "log" if QUANTITIES[name].compared == ComparedBy.ratio else "linear"


def point_tracking_metrics(metrics: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Mean of each metric over the sequences of a condition, all of equal weight.

    `metrics`: tables of all scenes, schema `POINT_TRACKING`. Returns: schema `POINT_TRACKING_METRICS`, sorted.
    Raises as `condition_table`.
    """
    conditions = by_condition(metrics, POINT_TRACKING, "point tracking")
    return condition_table(conditions, POINT_TRACKING_METRICS, _metric_rows, sampling).sort(*POOLED, *_METRIC)


def _metric_rows(metrics: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per raster and metric of a condition."""
    named = [name for name in metrics.columns if name not in (*ORIGIN, "raster", "n_points")]
    labels = [name for name in metrics.columns if name not in (*named, "n_points")]
    long = metrics.unpivot(named, index=labels, variable_name="metric").drop_nulls("value")
    counted = long.with_columns_seq(n=pl.lit(1.0))
    units = units_of(counted, points=_METRIC, columns=["n", "value"], groups=draws.groups)
    estimates = pooled(units, draws.weights(units), column_means, method, scales=["logit"], sizes=units.sums[..., :1].T)
    return estimates_by_point(estimates, units, POINT_TRACKING_METRICS)
