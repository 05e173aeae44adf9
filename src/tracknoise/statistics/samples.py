"""A few single errors and tracks of each condition, for what moments do not hold.

They serve tails, quantiles and likelihoods, and the audit of the truth. They are chosen by a hash of track and frame:
the choice depends only on which observations exist, not on trimming or the order of rows.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.inference.bootstrap import scattered
from tracknoise.inference.units import sorting
from tracknoise.statistics.definitions import PLACE_AGES
from tracknoise.statistics.grouping import group_runs, number_combinations
from tracknoise.statistics.prepared import POPULATIONS, PreparedSequence
from tracknoise.tables.schema import ORIGIN, SAMPLES, typed

BANDS = ((1, 4), (5, 9), (10, 19), (20, 49), (50, 99), (100, 199), (200, 499), (500, 999))
"""First and last age (or distance from the key frame, in frames of the nominal sequence) of each band."""
MAX_TRACKS = 512
"""Largest number of tracks that are kept of a band, of each sequence and condition."""

_LOWS, _HIGHS = (np.array(bounds) for bounds in zip(*BANDS, strict=True))
_KEYS = [*ORIGIN, "age_low", "track"]


def samples(sequence: PreparedSequence, *, max_tracks: int = MAX_TRACKS) -> pl.DataFrame:
    """Single visible errors of every scene and condition, in bands of ages.

    Returns schema `SAMPLES`, sorted by condition, band and track. Each track has one error in each band in which it was
    seen. `at` is its age, or the frame where there is a key frame. Errors that are zero by construction are in no band,
    nor are those older than the last.
    """
    seen, key_frame = sequence.seen, sequence.key_frame
    distance = seen.age if key_frame is None else np.abs(seen.frame - key_frame)
    band, inside = _band(distance)
    rows = _one_per_track(sequence, np.flatnonzero(inside & seen.visible), band)
    banded = sequence.observations.select_seq(*ORIGIN, "track", "frame", "age", "du_px", "dv_px", "kept")[rows]
    bounds = _bounds(band[rows])
    chosen = first_tracks(banded.with_columns_seq(**bounds, block=pl.Series(sequence.block[rows])), max_tracks)
    table = chosen.with_columns_seq(at="age" if key_frame is None else "frame").sort(_KEYS)
    return typed(table, SAMPLES)


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
    order = shuffled[sorting(groups.index[shuffled])]
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
    (track, _), group = number_combinations([sequence.track_row[rows], band[rows]])
    hashed = _hashed(sequence, rows)
    least = np.full(len(track), np.iinfo(np.uint64).max, dtype=np.uint64)
    np.minimum.at(least, group, hashed)
    chosen = np.flatnonzero(hashed == least[group])
    return rows[chosen]


def _hashed(sequence: PreparedSequence, rows: NDArray[np.intp]) -> NDArray[np.uint64]:
    """Pseudo-random numbers of observations, by which one of a track is chosen."""
    seen = sequence.seen
    return scattered(scattered(seen.track[rows]) ^ seen.frame[rows].astype(np.uint64))


AGES = (1, 2, 3, 4, 6, 8, 12, 16, 24)
"""Ages that are audited, in frames that the slowest trackers see."""
PER_TRACK = 2
PER_AGE = 300
"""Largest number of observations of a track, and of each tracker at one age."""
_TRACK = ["tracker", "speed", "track"]
_ORDER = ["tracker", "track", "frame"]


def audited_observations(sequence: PreparedSequence) -> pl.DataFrame:
    """Visible observations at `AGES` at the lowest speed, with the track's depth and its true position at birth.

    Returns
    -------
    polars.DataFrame
        Columns of `tracknoise.tables.schema.OBSERVATIONS`, and block, birth_frame, depth_m, u_birth_px and v_birth_px;
        sorted by tracker, track and frame. With a key frame, ages count frames before or after it, but birth is still
        that of the track. Tracks whose depth is unknown are left out.
    """
    seen = sequence.seen
    if not len(seen.age):
        return _with_births(sequence, np.empty(0, np.intp), seen.age)
    slowest = int(seen.speed.min())
    age = seen.age if sequence.key_frame is None else np.abs(seen.frame - sequence.key_frame)
    wanted = seen.visible & (seen.speed == slowest) & np.isin(age, slowest * np.array(AGES))
    rows = _some_per_track(sequence, np.flatnonzero(wanted))
    table = _with_births(sequence, rows, age)
    chosen = first_tracks(table.with_columns(age_low="age"), PER_AGE)
    return chosen.drop("age_low").sort(_ORDER)


def _some_per_track(sequence: PreparedSequence, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """At most `PER_TRACK` of the rows of each track, each equally likely."""
    track = sequence.track_row[rows]
    order = np.lexsort((_hashed(sequence, rows), track))
    first = np.searchsorted(track[order], track[order])
    return np.asarray(rows[order[np.arange(len(rows)) - first < PER_TRACK]])


def _with_births(sequence: PreparedSequence, rows: NDArray[np.intp], age: NDArray[np.int64]) -> pl.DataFrame:
    """Rows of the observations with what is known of the first observation of their tracks."""
    table = sequence.observations[rows].with_columns(
        age=pl.Series(age[rows], dtype=pl.UInt32), block=pl.Series(sequence.block[rows], dtype=pl.UInt8)
    )
    return table.join(births_with_depth(sequence), on=_TRACK, how="inner", maintain_order="left")


def births_with_depth(sequence: PreparedSequence) -> pl.DataFrame:
    """First observations of the tracks whose position and depth there are known.

    Returns
    -------
    polars.DataFrame
        tracker, speed, track, depth_m, birth_frame, u_birth_px and v_birth_px: one row per track.
    """
    births = sequence.observations.filter(pl.col("age") == 0).select(
        *_TRACK, u_birth_px="u_true_px", v_birth_px="v_true_px"
    )
    of_tracks = sequence.tracks.select(*_TRACK, "depth_m", birth_frame="first_frame")
    return of_tracks.join(births, on=_TRACK, maintain_order="left").drop_nulls()


EACH = 8
"""Tracks of each kind, where there are enough."""
KINDS = ("worst", "median", "best")


def extreme_tracks(
    observations: pl.DataFrame, *, speed: int, population: str, key_frame: int | None
) -> Iterator[tuple[int, pl.DataFrame]]:
    """Choose tracks of every tracker at a few ages.

    Parameters
    ----------
    observations
        Schema `OBSERVATIONS`, of one sequence.
    speed
        Observations at this speed are used.
    population
        Observations whose errors are used.
    key_frame
        Frame in which errors are zero; None where this is the first frame of each track.

    Yields
    ------
    n_each : int
        Tracks of each kind.
    polars.DataFrame
        The chosen observations of one tracker and age, with columns at and anchor_frame: the worst, those around the
        median and the best.
    """
    since = pl.col("age").cast(pl.Int64) if key_frame is None else pl.col("frame").cast(pl.Int64) - key_frame
    chosen = observations.filter(
        pl.col("truth").cast(pl.String).is_in(POPULATIONS[population]), since.is_in(PLACE_AGES), speed=speed
    ).drop_nulls(["du_px", "dv_px"])
    placed = chosen.with_columns(
        at=pl.col("age" if key_frame is None else "frame"),
        anchor_frame=(pl.col("frame").cast(pl.Int64) - since).cast(pl.UInt32),
        error_px=(pl.col("du_px") ** 2 + pl.col("dv_px") ** 2).sqrt(),
    )
    for _, part in placed.sort("tracker", "at", "error_px", "track").group_by([*ORIGIN, "at"], maintain_order=True):
        n_each = min(EACH, part.height // len(KINDS))
        if n_each:
            yield n_each, part[_places(part.height, n_each)]


def _places(height: int, n_each: int) -> Sequence[int]:
    """Places of the chosen rows in a table that is sorted by error."""
    middle = (height - n_each) // 2
    return [*range(height - 1, height - 1 - n_each, -1), *range(middle, middle + n_each), *range(n_each)]
