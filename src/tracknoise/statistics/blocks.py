"""Blocks of tracks that were born next to each other in time: what is resampled where scenes are too few.

The tracks of a sequence and condition are numbered from 0 in the order of their birth; block b of B holds those with
floor(track B / n_tracks) = b (block), so that blocks hold as many tracks as each other, give or take one.
"""

import polars as pl

from tracknoise.exceptions import SchemaError
from tracknoise.tables.schema import ORIGIN

BLOCKS = 16
"""How many blocks the tracks of a sequence and condition make; fewer where there are fewer tracks."""

_KEYS = list(ORIGIN)


def block_of(track: pl.Expr, n_tracks: pl.Expr) -> pl.Expr:
    """Block of a track, from 0 to `BLOCKS` - 1, UInt8, by (block).

    Parameters
    ----------
    track
        Its number, from 0 in the order of birth, among those of its sequence and condition.
    n_tracks
        How many these are.
    """
    return (track.cast(pl.UInt64) * BLOCKS // n_tracks.cast(pl.UInt64)).cast(pl.UInt8)


def with_blocks(table: pl.DataFrame, tracks: pl.DataFrame) -> pl.DataFrame:
    """Return `table` with a last column `block`, its rows as they were.

    Parameters
    ----------
    table
        Columns of `ORIGIN` and `track` (a number from 0 in the order of birth), besides any others: tracks,
        observations, or what was made of them.
    tracks
        The tracks of the same sequences and conditions, all of them; only these columns are read.

    Raises
    ------
    SchemaError
        If a row belongs to none of these tracks.
    """
    sizes = tracks.group_by(_KEYS).agg((pl.col("track").max().cast(pl.UInt64) + 1).alias("tracks of the condition"))
    joined = table.join(sizes, on=_KEYS, how="left", maintain_order="left")
    n_tracks = pl.col("tracks of the condition")
    if not joined.select(known=(pl.col("track") < n_tracks).fill_null(value=False).all()).item():
        raise SchemaError("blocks: a track number is not in the tracks table, expected one of its condition")
    return joined.with_columns(block=block_of(pl.col("track"), n_tracks)).drop("tracks of the condition")
