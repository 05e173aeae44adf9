"""A few single errors of each condition, for what moments do not hold: tails, quantiles, likelihoods.

They are chosen by a hash of track and frame. The choice therefore depends only on which observations exist, not on
trimming or the order of rows.
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.grouping import by_group, group_runs, number_combinations
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.statistics.scattered import scattered
from tracknoise.tables.schema import ORIGIN, SAMPLES, check

BANDS = ((1, 4), (5, 9), (10, 19), (20, 49), (50, 99), (100, 199), (200, 499), (500, 999))
"""First and last age (or distance from the key frame, in frames of the nominal sequence) of each band."""
MAX_TRACKS = 512
"""Largest number of tracks that are kept of a band, of each sequence and condition."""

_LOWS, _HIGHS = (np.array(bounds) for bounds in zip(*BANDS, strict=True))
_KEYS = [*ORIGIN, "age_low", "track"]


def samples(sequence: PreparedSequence, *, max_tracks: int = MAX_TRACKS) -> pl.DataFrame:
    """Single visible errors of every scene and condition, in bands of ages.

    Parameters
    ----------
    sequence
        Trimmed. With a key frame, bands are of distances from it, before or after. Otherwise they are of ages.
    max_tracks
        Largest number of tracks of a band, of each sequence and condition.

    Returns
    -------
    polars.DataFrame
        Schema `SAMPLES`, sorted by condition, band and track. Each track has one error in each band in which it was
        seen. `at` is its age, or the frame where there is a key frame. Errors that are zero by construction are in no
        band, nor are those older than the last.
    """
    seen, key_frame = sequence.seen, sequence.key_frame
    distance = seen.age if key_frame is None else np.abs(seen.frame - key_frame)
    band, inside = _band(distance)
    rows = _one_per_track(sequence, np.flatnonzero(inside & seen.visible), band)
    banded = sequence.observations.select_seq(*ORIGIN, "track", "frame", "age", "du_px", "dv_px", "kept")[rows]
    bounds = _bounds(band[rows])
    chosen = first_tracks(banded.with_columns_seq(**bounds, block=pl.Series(sequence.block[rows])), max_tracks)
    table = chosen.with_columns_seq(at="age" if key_frame is None else "frame").sort(_KEYS)
    return check(table.select_seq(pl.col(name).cast(kind) for name, kind in SAMPLES.items()), SAMPLES, "samples")


def with_bands(table: pl.DataFrame, distance: pl.Expr) -> pl.DataFrame:
    """The rows whose distance from where errors are zero is in one of `BANDS`, with `age_low` and `age_high`, UInt32.

    Parameters
    ----------
    table
        Any.
    distance
        Frames of the nominal sequence, made of its columns: an age, or the distance from a key frame.
    """
    band, inside = _band(table.select_seq(distance.cast(pl.Int64).alias("distance"))["distance"].to_numpy())
    return table.with_columns_seq(**_bounds(band)).filter(pl.Series(inside))


def first_tracks(samples: pl.DataFrame, count: int) -> pl.DataFrame:
    """At most `count` tracks of each sequence, condition and band; a larger count adds to those of a smaller.

    Parameters
    ----------
    samples
        Columns of `ORIGIN`, `age_low` and `track`, one row per track and band. Their order is kept.
    count
        Largest number of tracks.
    """
    (groups,) = group_runs([samples], [*ORIGIN, "age_low"])
    shuffled = np.argsort(scattered(samples["track"].to_numpy()))
    order = shuffled[by_group(groups.index[shuffled], groups.count)]
    sizes = np.bincount(groups.index, minlength=groups.count)
    place = np.arange(len(order)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    first = np.zeros(len(order), dtype=np.bool_)
    first[order[place < count]] = True
    return samples.filter(pl.Series(first))


def _band(distance: NDArray[np.int64]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Number of the band of each distance, and whether it is in that band."""
    band = np.clip(np.searchsorted(_LOWS, distance, side="right") - 1, 0, None)
    return band, (distance >= _LOWS[band]) & (distance <= _HIGHS[band])


def _bounds(band: NDArray[np.intp]) -> dict[str, pl.Series]:
    bounds = {"age_low": _LOWS[band], "age_high": _HIGHS[band]}
    return {name: pl.Series(values, dtype=pl.UInt32) for name, values in bounds.items()}


def _one_per_track(sequence: PreparedSequence, rows: NDArray[np.intp], band: NDArray[np.intp]) -> NDArray[np.intp]:
    """One of the rows that a track has in a band, each equally likely."""
    seen = sequence.seen
    (track, _), group = number_combinations([sequence.track_row[rows], band[rows]])
    hashed = scattered(scattered(seen.track[rows]) ^ seen.frame[rows].astype(np.uint64))
    least = np.full(len(track), np.iinfo(np.uint64).max, dtype=np.uint64)
    np.minimum.at(least, group, hashed)
    found = np.flatnonzero(hashed == least[group])
    return rows[found]
