"""What positions in two cameras say together, with intervals: epipolar distances, disparities, depths, correlations.

Standard deviations are 1.4826 times the median absolute value. With that of the depth in cells of depths z, s(z), and
the mean m(z) of its error,

    s(z) = a + b z^2,    m(z) = c + d z^2    (pair.depth)

are fitted to s / z and m / z, each cell with the weight n / (s / z)^2 of its n observations.
"""

from functools import partial

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import USUAL, Sampling, condition_table, estimated, units_of
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.intervals import Method, pooled
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import Tables, by_condition
from tracknoise.statistics.histograms import LOG_HISTOGRAM_BINS, quantile
from tracknoise.statistics.pair_sums import DEPTH_CELLS, LOG_UNIT
from tracknoise.statistics.scales import PER_MEDIAN
from tracknoise.tables.findings_schema import ESTIMATE_COLUMNS
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import ESTIMATED_OF_N, OF_CONDITION, Rows, RunTable, Value
from tracknoise.tables.schema import PAIR_SUMS
from tracknoise.tables.schema import POOLED as CONDITIONS

Array = NDArray[np.float64]

_OF = "of trimmed, visible observations in the second camera"
_MEANINGS: dict[str, tuple[str, str, str]] = {
    "epipolar_core": ("px", "log", f"Core of the distances from epipolar lines {_OF}."),
    "disparity_core": ("px", "log", f"Core of the errors along epipolar lines {_OF}."),
    "disparity_mean": ("px", "linear", f"Mean error along epipolar lines {_OF}; errors up to 5 px."),
    "correlation_u": ("1", "fisher", "Correlation of the errors in u in both cameras, of those older than 0 frames."),
    "correlation_v": ("1", "fisher", "Correlation of the errors in v in both cameras, of those older than 0 frames."),
    "depth_sd_constant": ("m", "linear", "a of the standard deviation a + b z^2 of depths z by both cameras."),
    "depth_sd_square": ("1/m", "linear", "b of the standard deviation a + b z^2 of depths z by both cameras."),
    "depth_mean_constant": ("m", "linear", "c of the mean error c + d z^2 of depths z by both cameras."),
    "depth_mean_square": ("1/m", "linear", "d of the mean error c + d z^2 of depths z by both cameras."),
}
"""Unit, scale of intervals, and what is estimated."""

PAIRS = RunTable(
    "second_camera",
    {**CONDITIONS, "quantity": pl.String, "n": pl.Int64, **ESTIMATE_COLUMNS},
    Rows(
        "second camera",
        OF_CONDITION,
        [Value(f"pair_{name}", "value", {}, {"quantity": name}, ESTIMATED_OF_N) for name in _MEANINGS],
    ),
    title="what positions in two cameras say together",
    quantities={f"pair_{name}": Quantity(unit, meaning) for name, (unit, _, meaning) in _MEANINGS.items()},
)
"""Of trackers of a second camera; of others there are no rows. n counts observations."""

_SUMS = (
    "n",
    "n_short",
    "n_later",
    "sum_along",
    *(f"{name}_{axis}" for name in ("first", "second", "both") for axis in "uv"),
)
_OF_CELL = ("n", "n_near", "sum_log", "sum_log_depth")
_FEWEST_OF_CELL = 30


def pair_intervals(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Quantities of every condition of a second camera.

    `sums`: tables of all scenes, schema `PAIR_SUMS`. Returns: schema `PAIRS`, sorted. Raises as `condition_table`.
    """
    conditions = by_condition(sums, PAIR_SUMS, "pair sums")
    return condition_table(conditions, PAIRS, _rows, sampling).sort(*POOLED, "quantity")


def _rows(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per quantity of a condition."""
    wide = _wide(sums)
    columns = [name for name in wide.columns if name not in sums.columns or name in _SUMS]
    units = units_of(wide, wide, points=[], columns=columns, groups=draws.groups)
    scales = [scale for _, scale, _ in _MEANINGS.values()]
    found = pooled(units, draws.weights(units), partial(_quantities, columns), method, scales=scales)
    labels = pl.DataFrame({"quantity": list(_MEANINGS)})
    table = estimated(labels, found, units, PAIRS, value="value").with_columns(n=pl.lit(sums["n"].sum(), pl.Int64))
    return table.with_columns(pl.col("value", "low", "high").fill_nan(None)).drop_nulls("value")


def _wide(sums: pl.DataFrame) -> pl.DataFrame:
    """The sums with a column for each bin of the histograms, and for each cell of depth."""
    cell = sums["cell"].to_numpy()
    across, along, log = (
        np.array(sums[f"{name}_counts"].to_list(), np.float64).reshape(-1, LOG_HISTOGRAM_BINS)
        for name in ("across", "along", "log")
    )
    added = {f"{name}_{place}": of[:, place] for name, of in (("across", across), ("along", along)) for place in _BINS}
    for number in range(DEPTH_CELLS):
        inside = (cell == number).astype(np.float64)
        added |= {f"{name}@{number}": sums[name].to_numpy() * inside for name in _OF_CELL}
        if inside.any():
            added |= {f"log@{number}_{place}": log[:, place] * inside for place in _BINS}
    return sums.drop("across_counts", "along_counts", "log_counts").hstack(pl.DataFrame(added))


_BINS = range(LOG_HISTOGRAM_BINS)


def _quantities(names: list[str], sums: Array) -> Array:
    """(quantities, points, ...) float64 from sums (columns, points, ...), NaN where there are none."""
    column = dict(zip(names, sums, strict=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        cores = [
            PER_MEDIAN * quantile(np.stack([column[f"{name}_{place}"] for place in _BINS]), 0.5)
            for name in ("across", "along")
        ]
        mean = column["sum_along"] / column["n_short"]
        correlations = [
            column[f"both_{axis}"] / np.sqrt(column[f"first_{axis}"] * column[f"second_{axis}"]) for axis in "uv"
        ]
    return np.stack([*cores, mean, *correlations, *_laws(column, sums.shape[1:])])


def _laws(column: dict[str, Array], shape: tuple[int, ...]) -> tuple[Array, ...]:
    """a, b, c and d of (pair.depth)."""
    cells = [number for number in range(DEPTH_CELLS) if f"log@{number}_0" in column]
    weight, depth, spread, mean = (np.zeros((len(cells), *shape)) for _ in range(4))
    for place, number in enumerate(cells):
        n, n_near = column[f"n@{number}"], column[f"n_near@{number}"]
        with np.errstate(divide="ignore", invalid="ignore"):
            counts = np.stack([column[f"log@{number}_{bin}"] for bin in _BINS])
            spread[place] = PER_MEDIAN * LOG_UNIT * quantile(counts, 0.5)
            mean[place] = column[f"sum_log@{number}"] / n_near
            depth[place] = np.exp(column[f"sum_log_depth@{number}"] / n)
            weight[place] = np.where(n >= _FEWEST_OF_CELL, n / spread[place] ** 2, 0.0)
    known = np.isfinite(weight) & (weight > 0.0)
    weight, depth = np.where(known, weight, 0.0), np.where(known, depth, 1.0)
    return *_fitted(weight, depth, np.where(known, spread, 0.0)), *_fitted(weight, depth, np.where(known, mean, 0.0))


def _fitted(weight: Array, depth: Array, relative: Array) -> tuple[Array, Array]:
    """Constant and factor of z^2 that fit numbers relative to depths z; NaN where depths do not differ."""
    one, square = 1.0 / depth, depth
    a11, a12, a22 = ((weight * x * y).sum(axis=0) for x, y in ((one, one), (one, square), (square, square)))
    b1, b2 = ((weight * x * relative).sum(axis=0) for x in (one, square))
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = a11 * a22 - a12**2
        constant, factor = (a22 * b1 - a12 * b2) / determinant, (a11 * b2 - a12 * b1) / determinant
    known = (np.count_nonzero(weight, axis=0) > 1) & np.isfinite(constant) & np.isfinite(factor)
    return np.where(known, constant, np.nan), np.where(known, factor, np.nan)
