"""A few observations of each tracker at the lowest speed, for the audit of the truth.

They are chosen by a hash of track and frame, so that the choice depends only on which observations exist.
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.errors.samples import first_tracks
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.statistics.scattered import scattered

AGES = (1, 2, 3, 4, 6, 8, 12, 16, 24)
"""Ages that are audited, in frames that the slowest trackers see."""
PER_TRACK = 2
PER_AGE = 300
"""Largest number of observations of a track, and of each tracker at one age."""
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
    seen, track = sequence.seen, sequence.track_row[rows]
    hashed = scattered(scattered(seen.track[rows]) ^ seen.frame[rows].astype(np.uint64))
    order = np.lexsort((hashed, track))
    first = np.searchsorted(track[order], track[order])
    return np.asarray(rows[order[np.arange(len(rows)) - first < PER_TRACK]])


def _with_births(sequence: PreparedSequence, rows: NDArray[np.intp], age: NDArray[np.int64]) -> pl.DataFrame:
    """Rows of the observations with what is known of the first observation of their tracks."""
    key = ["tracker", "speed", "track"]
    table = sequence.observations[rows].with_columns(
        age=pl.Series(age[rows], dtype=pl.UInt32), block=pl.Series(sequence.block[rows], dtype=pl.UInt8)
    )
    births = sequence.observations.filter(pl.col("age") == 0).select(
        *key, u_birth_px="u_true_px", v_birth_px="v_true_px"
    )
    of_tracks = sequence.tracks.select(*key, "depth_m", birth_frame="first_frame")
    joined = table.join(of_tracks, on=key, how="left").join(births, on=key, how="left")
    return joined.filter(pl.all_horizontal(pl.col("depth_m", "u_birth_px", "v_birth_px").is_not_null()))
