"""A few single errors of each condition, for what moments cannot tell: tails, quantiles, likelihoods.

Which are chosen is decided by numbers that look random and are always the same (a hash of track and frame), so that it
depends on nothing but what there is to choose from: not on trimming, nor on the order of rows.
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.blocks import with_blocks
from tracknoise.statistics.grouping import group_rows
from tracknoise.statistics.populations import measured
from tracknoise.tables.schema import OBSERVATIONS, ORIGIN, SAMPLES, check

BANDS = ((1, 4), (5, 9), (10, 19), (20, 49), (50, 99), (100, 199), (200, 499), (500, 999))
"""First and last age (or distance from the key frame, in frames of the nominal sequence) of each band."""
MAX_TRACKS = 512
"""At most so many tracks of a band are kept, of each sequence and condition."""

_LOWS, _HIGHS = (np.array(bounds) for bounds in zip(*BANDS, strict=True))
_READ = [*ORIGIN, "track", "frame", "age", "du_px", "dv_px", "kept"]
_KEYS = [*ORIGIN, "age_low", "track"]


def samples(
    observations: pl.DataFrame,
    tracks: pl.DataFrame,
    *,
    key_frame: int | None = None,
    max_tracks: int = MAX_TRACKS,
) -> pl.DataFrame:
    """Single visible errors of every scene and condition, in bands of ages.

    Parameters
    ----------
    observations
        An observations table, trimmed (`tracknoise.statistics.trimming.trim`).
    tracks
        The tracks of the same scenes and conditions, all of them.
    key_frame
        Where a scan makes errors zero in one frame: bands are then of distances from it, before or after. By default
        errors are zero at a track's birth, and bands are of ages.
    max_tracks
        How many tracks of a band to take at most, of each sequence and condition.

    Returns
    -------
    polars.DataFrame
        Schema `SAMPLES`, sorted by condition, band and track. Of a track there is one error in each band in which it
        was seen; `at` is its age, or the frame where a key frame is given. Errors that are zero by construction are in
        no band, nor are those older than the last.

    Raises
    ------
    SchemaError
        If a table has other columns, or an observation belongs to no track.
    """
    seen = measured(check(observations, OBSERVATIONS, "observations"), population="visible").select(_READ)
    frame = pl.col("frame").cast(pl.Int64)
    banded = with_bands(seen, pl.col("age") if key_frame is None else (frame - key_frame).abs())
    chosen = first_tracks(_one_a_track(banded), max_tracks)
    table = with_blocks(chosen, tracks).with_columns(at="age" if key_frame is None else "frame").sort(_KEYS)
    return check(table.select(pl.col(name).cast(kind) for name, kind in SAMPLES.items()), SAMPLES, "samples")


def with_bands(table: pl.DataFrame, distance: pl.Expr) -> pl.DataFrame:
    """The rows whose distance from where errors are zero is in one of `BANDS`, with `age_low` and `age_high`, UInt32.

    Parameters
    ----------
    table
        Any.
    distance
        Frames of the nominal sequence, made of its columns: an age, or the distance from a key frame.
    """
    away = table.select(distance.cast(pl.Int64).alias("distance"))["distance"].to_numpy()
    band = np.clip(np.searchsorted(_LOWS, away, side="right") - 1, 0, None)
    low, high = _LOWS[band], _HIGHS[band]
    bounds = {name: pl.Series(values, dtype=pl.UInt32) for name, values in (("age_low", low), ("age_high", high))}
    return table.with_columns(**bounds).filter(pl.Series((away >= low) & (away <= high)))


def first_tracks(samples: pl.DataFrame, count: int) -> pl.DataFrame:
    """At most so many tracks of each sequence, condition and band, in the same order: fewer of the same choice.

    Parameters
    ----------
    samples
        Columns of `ORIGIN`, `age_low` and `track`, a row a track.
    count
        How many tracks.
    """
    groups = group_rows(samples, [*ORIGIN, "age_low"])
    track = samples["track"].to_numpy()
    order = np.lexsort((track, _scattered(track), groups.index))
    starts = np.searchsorted(groups.index[order], np.arange(groups.count))
    place = np.empty(len(track), dtype=np.intp)
    place[order] = np.arange(len(track)) - starts[groups.index[order]]
    return samples.filter(pl.Series(place < count))


def _one_a_track(banded: pl.DataFrame) -> pl.DataFrame:
    """One of the observations that a track has in a band, each as likely."""
    track, frame = (banded[name].to_numpy() for name in ("track", "frame"))
    group = group_rows(banded, [*ORIGIN, "age_low"]).index
    order = np.lexsort((frame, _scattered(_scattered(track) ^ frame), track, group))
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(group[order]) != 0) | (np.diff(track[order].astype(np.int64)) != 0)
    return banded[order[first]]


def _scattered(numbers: NDArray[np.uint32] | NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Numbers that look random, of which no two are the same: the finaliser of SplitMix64 (Steele et al. 2014)."""
    mixed = numbers.astype(np.uint64) + np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    return mixed ^ (mixed >> np.uint64(31))
