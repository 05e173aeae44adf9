"""Moments by their distance from where errors are zero by construction."""

from collections.abc import Iterable, Mapping

import polars as pl

from tracknoise.statistics.grouping import reduce_each
from tracknoise.tables.schema import Schema

NO_KEY_FRAMES: Mapping[str, int] = {}


def anchored(
    tables: pl.DataFrame | Iterable[pl.DataFrame], schema: Schema, name: str, key_frames: Mapping[str, int]
) -> pl.DataFrame:
    """Rows of visible errors that are not zero by construction, with their distance from where errors are.

    Parameters
    ----------
    tables
        One table of moments by age or frame, or any number of them, read one at a time.
    schema, name
        What each must be, and what to call it where it is not.
    key_frames
        Where rows are of frames: the one in which errors are zero, by direction; in others it is frame 0.

    Returns
    -------
    polars.DataFrame
        The same columns, and `since` (Int64), not 0: an age, or frames after the key frame, negative before it.

    Raises
    ------
    SchemaError
        If a table does not have the columns of `schema`.
    """
    key = pl.col("direction").replace_strict(dict(key_frames), default=0, return_dtype=pl.Int64)
    since = pl.col("at").cast(pl.Int64) - pl.when(pl.col("axis") == "frame").then(key).otherwise(0)
    visible = pl.col("population") == "visible" if "population" in schema else pl.lit(value=True)
    chosen = visible & (pl.col("n") > 0) & (pl.col("since") != 0)
    return reduce_each(tables, schema, name, lambda table: table.with_columns(since=since).filter(chosen))
