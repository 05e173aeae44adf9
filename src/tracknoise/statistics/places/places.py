"""Sums of errors by place, at a few ages: what the statistics of places in the image share.

The sums are of untrimmed errors at the lowest speed, because trimming removes just the tracks that such places explain.
They add up over scenes and blocks. Blocks are pairs of those of `tracknoise.statistics.blocks`, to keep tables small.
"""

from collections.abc import Mapping

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.definitions import PLACE_AGES
from tracknoise.statistics.grouping import number_combinations
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.schema import AXIS

_BLOCKS_TOGETHER = 2


def at_place_ages(sequence: PreparedSequence) -> NDArray[np.bool_]:
    """Whether each observation is at the lowest speed and one of the ages of places, (rows,).

    These are `PLACE_AGES`, or the largest ages below them at which the speed has observations. With a key frame, they
    count frames after it.
    """
    speed, since = sequence.seen.speed, sequence.seen.at - (sequence.key_frame or 0)
    chosen = np.zeros(len(since), dtype=bool)
    for age in PLACE_AGES:
        chosen |= since == np.maximum(age // speed, 1) * speed
    return chosen & sequence.at_slowest


def summed(
    sequence: PreparedSequence,
    rows: NDArray[np.intp],
    keys: Mapping[str, NDArray[np.intp]],
    values: Mapping[str, NDArray[np.float64]],
) -> pl.DataFrame:
    """Sums of values over the rows that agree in scene, condition, block, age and keys.

    Parameters
    ----------
    sequence
        Trimmed.
    rows : (n,) intp
        Rows of the observations.
    keys
        Name and values of each key, (n,) from 0.
    values
        Name and values of what is summed, (n,).

    Returns
    -------
    polars.DataFrame
        Columns of `ORIGIN`, block, axis, at, the keys, n, and the sums; sorted by the columns before n.
    """
    seen, block = sequence.seen, sequence.block[rows] // _BLOCKS_TOGETHER
    found, index = number_combinations([seen.condition[rows], block, seen.at[rows], *keys.values()])
    condition, *others = found
    columns = dict(zip(("block", "at", *keys), others, strict=True))
    columns |= {"n": np.bincount(index, minlength=len(condition))}
    columns |= {name: np.bincount(index, value, len(condition)) for name, value in values.items()}
    return seen.conditions[condition].with_columns(pl.lit(seen.axis, dtype=AXIS).alias("axis"), **columns)


def products(error_px: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """du, dv and their products of errors (n, 2), by the names of their sums."""
    du, dv = error_px.T
    return {"sum_u": du, "sum_v": dv, "sum_uu": du * du, "sum_uv": du * dv, "sum_vv": dv * dv}


def squares(error_px: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Errors along and across, (n, 2), and their squares, by the names of their sums."""
    along, across = error_px.T
    return {"sum_along": along, "sum_across": across, "sum_along_2": along * along, "sum_across_2": across * across}
