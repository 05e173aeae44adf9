"""Sums over observations in a second camera, of what they and those in the first camera say together.

Of the visible observations of tracks that trimming kept. Products of errors are of those that are older than 0 frames,
as errors in the first camera are 0 before; errors that are longer than `MOST_PX` in one of the cameras do not count in
them, nor in means.
"""

from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.grouping import number_combinations
from tracknoise.statistics.histograms import listed
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.schema import PAIR, PAIR_SUMS, empty, typed

Array = NDArray[np.float64]

MOST_PX, MOST_LOG = 5.0, 0.5
"""Longest error, px, and largest logarithm of a ratio of depths, that count in means and products."""
DEPTH_CELLS, LEAST_DEPTH_M, PER_OCTAVE = 22, 0.125, 2
"""Cells of depth, half an octave each, from the least depth on; what lies beyond is in the first or the last."""
LOG_UNIT = 1e-3
"""Logarithms of ratios of depths are counted in this unit, so that the bins of histograms reach small ones."""


def pair_sums(sequence: PreparedSequence) -> pl.DataFrame:
    """Sums by scene, condition, block of tracks and cell of depth. Returns schema `PAIR_SUMS`, sorted.

    `sequence`: trackers of a second camera, whose observations have `PAIR`.
    """
    seen = sequence.seen
    table = sequence.observations.select(*PAIR).to_numpy()
    rows = np.flatnonzero(seen.visible & seen.kept & np.isfinite(table).all(axis=1))
    if not len(rows):
        return empty(PAIR_SUMS)
    first, (across, along, by_pair, depth) = table[rows, :2], table[rows, 2:].T
    second, log = seen.error_px[rows], np.log(by_pair / depth)
    cell = np.clip(np.floor(PER_OCTAVE * np.log2(depth / LEAST_DEPTH_M)), 0, DEPTH_CELLS - 1).astype(np.intp)
    (condition, block, cells), index = number_combinations([seen.condition[rows], sequence.block[rows], cell])
    count = len(condition)
    short = np.maximum(*(np.linalg.norm(error, axis=1) for error in (first, second))) < MOST_PX
    later, near = short & (seen.age[rows] > 0), np.abs(log) < MOST_LOG

    def added(values: Array, chosen: NDArray[np.bool_]) -> Array:
        return np.asarray(np.bincount(index[chosen], values[chosen], count), np.float64)

    products = {"first": first * first, "second": second * second, "both": first * second}
    columns: dict[str, Any] = {
        "block": block,
        "cell": cells,
        "n": np.bincount(index, minlength=count),
        "n_short": np.bincount(index[short], minlength=count),
        "n_near": np.bincount(index[near], minlength=count),
        "n_later": np.bincount(index[later], minlength=count),
        "sum_along": added(along, short),
        "sum_log": added(log, near),
        "sum_log_depth": added(np.log(depth), np.ones(len(rows), np.bool_)),
        **{
            f"{name}_{axis}": added(of[:, place], later)
            for name, of in products.items()
            for place, axis in enumerate("uv")
        },
        "across_counts": listed(index, np.abs(across), count),
        "along_counts": listed(index, np.abs(along), count),
        "log_counts": listed(index, np.abs(log / LOG_UNIT), count),
    }
    return typed(seen.conditions[condition].with_columns(**columns), PAIR_SUMS)
