"""Errors of each class of features by what surrounds them, and what would be left without the class.

With n features, sum s of their errors and sum q of the squares in a class, and N, S and Q in all classes together:

- mean s / n and second moment q / n of the class, and its share n / N of the features
- shares of the whole: s / S of the sum of errors, and q / Q of the sum of squares
- without the class: the mean (S - s) / (N - n), and the share of the second moment that is removed,
  1 - (Q - q) N / (Q (N - n))                                                              (places.excluded)
- with nothing but the class: the share of the second moment that is removed, 1 - q N / (Q n)
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.intervals.condition_table import USUAL, Sampling, condition_table, estimated
from tracknoise.findings.places.classes import POINT, WITHIN_ALL, class_sums
from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.units import units_of
from tracknoise.statistics.conditions import Tables, by_condition
from tracknoise.statistics.definitions import POOLED
from tracknoise.tables.findings_schema import SURROUNDING_ERRORS
from tracknoise.tables.schema import SURROUNDINGS, check, empty

_STATISTICS = {
    "mean": ("px", "linear"),
    "second": ("px^2", "log"),
    "share": ("share", "logit"),
    "share_of_mean": ("share", "linear"),
    "share_of_second": ("share", "logit"),
    "mean_without": ("px", "linear"),
    "second_removed": ("share", "linear"),
    "second_removed_by_others": ("share", "linear"),
}
"""Unit of each statistic, and the scale on which its intervals are made."""


def surrounding_errors(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Statistics of every class of every property, in every condition.

    Parameters
    ----------
    sums
        Tables of all scenes, schema `SURROUNDINGS`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `SURROUNDING_ERRORS`, sorted.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    conditions = by_condition(sums, SURROUNDINGS, "surroundings")
    table = condition_table(conditions, SURROUNDING_ERRORS, _rows, sampling)
    order = [*POOLED, *POINT, "statistic"]
    table = table.with_columns_seq(pl.col("value", "low", "high").fill_nan(None)).drop_nulls("value")
    return check(table.sort(order), SURROUNDING_ERRORS, "surrounding errors")


def _rows(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per property, class, age, coordinate and statistic of a condition."""
    classes = class_sums(sums)
    if classes.is_empty():
        return empty(SURROUNDING_ERRORS)
    units = units_of(classes, classes, points=POINT, columns=WITHIN_ALL, groups=draws.groups)
    n, of_all = units.sums[..., 0].T, units.sums[..., 3].T
    sizes = np.stack([n, n, of_all, of_all, of_all, of_all - n, of_all - n, n])
    scales = [scale for _, scale in _STATISTICS.values()]
    found = pooled(units, draws.weights(units), _statistics, method, scales=scales, sizes=sizes)
    points = units.points.with_columns_seq(pl.Series("n", n.sum(axis=1), dtype=pl.Float64))
    kinds = pl.DataFrame({"statistic": list(_STATISTICS), "unit": [unit for unit, _ in _STATISTICS.values()]})
    return estimated(kinds.join(points, how="cross"), found, units, SURROUNDING_ERRORS, value="value")


def _statistics(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values of `_STATISTICS`, (8, points, ...), NaN where they are not defined."""
    n, s, q, all_n, all_s, all_q = sums
    without = _over(all_q - q, all_n - n)
    return np.stack(
        [
            _over(s, n),
            _over(q, n),
            _over(n, all_n),
            _over(s, all_s),
            _over(q, all_q),
            _over(all_s - s, all_n - n),
            1.0 - _over(without * all_n, all_q),
            1.0 - _over(_over(q, n) * all_n, all_q),
        ]
    )


def _over(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(one / np.where(other != 0, other, np.nan))
