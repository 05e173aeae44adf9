"""Ratios of two sums over features, with intervals over scenes: see `tracknoise.statistics.ratios`."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import USUAL, Sampling, condition_table, estimated, units_of
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.intervals import Method, pooled
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import Tables, by_condition
from tracknoise.tables.findings_schema import RATIO_VALUES
from tracknoise.tables.quantities import QUANTITIES, ComparedBy
from tracknoise.tables.schema import RATIOS, check

_POINT = ["quantity", "trimming", "axis", "at"]


def ratio_intervals(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Every ratio at every age, features pooled.

    Parameters
    ----------
    sums
        Tables of all scenes, schema `RATIOS`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `RATIO_VALUES`, sorted.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    table = condition_table(by_condition(sums, RATIOS, "ratio sums"), RATIO_VALUES, _rows, sampling)
    return check(table.sort(*POOLED, *_POINT), RATIO_VALUES, "ratios")


def _rows(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per ratio, trimming and age of a condition."""
    parts = []
    for (name,), part in sums.partition_by("quantity", as_dict=True, maintain_order=True).items():
        units = units_of(part, part, points=_POINT, columns=["n", "sum"], groups=draws.groups)
        found = pooled(units, draws.weights(units), _ratio, method, scales=[_scale(str(name))])
        n = pl.Series("n", units.sums[..., 0].sum(axis=0).astype(np.int64))
        parts.append(estimated(units.points, found, units, RATIO_VALUES, value="value").with_columns(n))
    return pl.concat(parts).with_columns(pl.col("value", "low", "high").fill_nan(None)).drop_nulls("value")


def _ratio(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """(ratio), of sums (2, ...)."""
    return np.asarray(sums[1:] / np.where(sums[:1] > 0.0, sums[:1], np.nan))


def _scale(name: str) -> str:
    """Scale of the intervals of a ratio."""
    if QUANTITIES[name].unit == "share":
        return "logit"
    return "log" if QUANTITIES[name].compared == ComparedBy.ratio else "linear"
