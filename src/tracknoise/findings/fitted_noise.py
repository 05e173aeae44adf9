"""Noise of tracks with triangulated truth, (noise.triangulated) and (noise.epipolar), with intervals."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.intervals.condition_table import USUAL, Sampling, condition_table, estimated
from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.units import units_of
from tracknoise.statistics.conditions import Tables, by_condition
from tracknoise.statistics.definitions import LENGTHS, POOLED
from tracknoise.tables.findings_schema import TRIANGULATED_NOISE
from tracknoise.tables.schema import FITTED_NOISE, check

_SUMS = ["n", "squares_u", "freedom_u", "squares_v", "freedom_v", "squares", "freedom"]
_COORDINATES = ("u", "v", "both")
_POINT = ["measure", "trimming", "length_low"]


def fitted_noise_table(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Standard deviation of the noise of one coordinate, by length of the track and for all lengths together.

    Parameters
    ----------
    sums
        Tables of all scenes, schema `FITTED_NOISE`.
    sampling
        How scenes are resampled.

    Returns
    -------
    polars.DataFrame
        Schema `TRIANGULATED_NOISE`, sorted. Without rows unless true positions are triangulated.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    conditions = by_condition(sums, FITTED_NOISE, "fitted noise")
    table = condition_table(conditions, TRIANGULATED_NOISE, _rows, sampling)
    order = [*POOLED, "measure", "trimming", "length_low", "coordinate"]
    return check(table.sort(order), TRIANGULATED_NOISE, "triangulated noise")


def _rows(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per measure, trimming, class of lengths and coordinate of a condition."""
    together = sums.with_columns_seq(length_low=pl.lit(0, dtype=pl.UInt32))  # sorts before all classes
    both = pl.concat([together, sums])
    units = units_of(both, both, points=_POINT, columns=_SUMS, groups=draws.groups)
    sizes = np.stack([units.sums[..., place].T for place in (2, 4, 6)])
    found = pooled(units, draws.weights(units), _deviations, method, scales=["log"] * len(_COORDINATES), sizes=sizes)
    labels = pl.DataFrame({"coordinate": _COORDINATES}).join(units.points, how="cross")
    n = np.tile(units.sums[..., 0].sum(axis=0), len(_COORDINATES))
    table = estimated(labels, found, units, TRIANGULATED_NOISE, value="sigma_px").with_columns_seq(
        _lengths(), pl.Series("n", n, dtype=pl.Float64)
    )
    return table.with_columns_seq(
        pl.col("sigma_px", "low", "high").fill_nan(None), length_low=pl.col("length_low").replace({0: None})
    ).drop_nulls("sigma_px")


def _lengths() -> pl.Expr:
    highest = {low: high for low, high in LENGTHS if high is not None}
    return pl.col("length_low").replace_strict(highest, default=None, return_dtype=pl.Int64).alias("length_high")


def _deviations(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviations in u, in v and of both, (3, points, ...), NaN where there are no degrees of freedom."""
    squares, freedom = sums[1::2], sums[2::2]
    return np.asarray(np.sqrt(squares / np.where(freedom > 0, freedom, np.nan)))
