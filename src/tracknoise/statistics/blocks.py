"""Blocks of tracks that were born next to each other in time, to be resampled where there are too few scenes.

The tracks of a sequence and condition are numbered from 0 in the order of their birth. Block b of B holds those with
floor(track B / n_tracks) = b (block). The numbers of tracks in two blocks differ by at most one.
"""

import polars as pl

BLOCKS = 16
"""Number of blocks of a sequence and condition; smaller where there are fewer tracks."""


def block_of(track: pl.Expr, n_tracks: pl.Expr) -> pl.Expr:
    """Block of a track, from 0 to `BLOCKS` - 1, UInt8, by (block).

    Parameters
    ----------
    track
        Its number, from 0 in the order of birth, among those of its sequence and condition.
    n_tracks
        Number of these tracks.
    """
    return (track.cast(pl.UInt64) * BLOCKS // n_tracks.cast(pl.UInt64)).cast(pl.UInt8)


def blocks_of(tracks: pl.DataFrame, condition: pl.Series) -> pl.Series:
    """Block of each track, UInt8.

    Parameters
    ----------
    tracks
        All tracks of some sequences and conditions; only the column `track` is read.
    condition
        Number of the sequence and condition of each track.
    """
    n_tracks = (pl.col("track").max().cast(pl.UInt64) + 1).over("condition")
    numbered = tracks.select("track", condition=condition)
    return numbered.select(block=block_of(pl.col("track"), n_tracks)).to_series()
