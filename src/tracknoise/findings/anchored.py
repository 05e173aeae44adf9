"""Moments by their distance from where errors are zero by construction."""

from collections.abc import Mapping

import polars as pl

from tracknoise.tables.enumerations import Axis, Population

NO_KEY_FRAMES: Mapping[str, int] = {}


def anchored(table: pl.DataFrame, key_frames: Mapping[str, int]) -> pl.DataFrame:
    """Rows of visible errors that are not zero by construction, with their distance from where errors are.

    Parameters
    ----------
    table
        Moments by age or frame: columns direction, population, axis, at and n, besides any others.
    key_frames
        Where rows are of frames: the one in which errors are zero, by direction; in others it is frame 0.

    Returns
    -------
    polars.DataFrame
        The same columns, and `since` (Int64), not 0: an age, or frames after the key frame, negative before it.
    """
    key = pl.col("direction").replace_strict(dict(key_frames), default=0, return_dtype=pl.Int64)
    since = pl.col("at").cast(pl.Int64) - pl.when(pl.col("axis") == Axis.frame).then(key).otherwise(0)
    return table.with_columns_seq(since=since).filter(
        pl.col("n") > 0, pl.col("since") != 0, population=Population.visible
    )
