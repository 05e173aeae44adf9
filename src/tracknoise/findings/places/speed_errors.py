"""Mean error along and across the image motion, by how fast the image moves, with intervals."""

import polars as pl

from tracknoise.findings.intervals.condition_table import USUAL, Sampling, condition_table, estimated
from tracknoise.findings.sampling.bounds import Method, column_means, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.units import units_of
from tracknoise.statistics.conditions import Tables, by_condition
from tracknoise.statistics.definitions import POOLED
from tracknoise.tables.findings_schema import SPEED_ERRORS
from tracknoise.tables.schema import IMAGE_SPEEDS, check

_COLUMNS = ["n", "sum_along", "sum_across"]
_POINT = ["axis", "at", "class_low", "class_high"]
_COORDINATES = ("along", "across")


def speed_errors(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Mean errors along and across the image motion in every class of its speed, in every condition.

    Parameters
    ----------
    sums
        Tables of all scenes, schema `IMAGE_SPEEDS`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `SPEED_ERRORS`, sorted.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    conditions = by_condition(sums, IMAGE_SPEEDS, "image speeds")
    table = condition_table(conditions, SPEED_ERRORS, _rows, sampling)
    table = table.with_columns_seq(pl.col("mean_px", "low", "high").fill_nan(None))
    return check(table.sort(*POOLED, *_POINT, "coordinate"), SPEED_ERRORS, "speed errors")


def _rows(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per age, class of speed, and coordinate of a condition."""
    named = sums.rename({"low": "class_low", "high": "class_high"})
    units = units_of(named, named, points=_POINT, columns=_COLUMNS, groups=draws.groups)
    found = pooled(units, draws.weights(units), column_means, method)
    n = pl.Series("n", units.sums[..., 0].sum(axis=0), dtype=pl.Float64)
    points = units.points.with_columns_seq(pl.col("axis").cast(pl.String), n)
    labels = pl.DataFrame({"coordinate": _COORDINATES}).join(points, how="cross")
    return estimated(labels, found, units, SPEED_ERRORS, value="mean_px")
