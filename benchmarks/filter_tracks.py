"""Tracks as a filter uses them: piece by piece, at most as many frames long as it keeps poses."""

from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

CLONES = 11
"""Most frames of a piece, and most poses that the filter keeps."""
LEAST_FRAMES = 3
"""A piece of fewer is not used."""


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Whole tracks, each of consecutive frames.

    Parameters
    ----------
    first
        (tracks,) integers: first frames.
    length
        (tracks,) integers: how many observations there are.
    late
        (tracks,) integers: by how much the first piece is shorter than `CLONES`, so that tracks that began together are
        not cut together.
    uv
        (observations, 2) float64: observed positions, px, of one track after the other.
    good
        (observations,) bool: whether their errors are known to be small.
    """

    first: NDArray[np.int64]
    length: NDArray[np.int64]
    late: NDArray[np.int64]
    uv: NDArray[np.float64]
    good: NDArray[np.bool_]

    @property
    def last(self) -> NDArray[np.int64]:
        """(tracks,): last frames."""
        return self.first + self.length - 1

    def rows(self, places: NDArray[np.int64], frames: NDArray[np.int64]) -> NDArray[np.int64]:
        """Where observations of some tracks at some frames are."""
        start = np.cumsum(self.length) - self.length
        return np.asarray(start[places] + frames - self.first[places])

    def pieces(self, places: NDArray[np.int64], since: NDArray[np.int64], last: NDArray[np.int64]) -> "Pieces":
        """Observations of some tracks between two frames."""
        frames = since[:, None] + np.arange(CLONES)
        there = frames <= last[:, None]
        rows = self.rows(places[:, None], np.minimum(frames, last[:, None]))
        uv = np.where(there[:, :, None], self.uv[rows], 0.0)
        return Pieces(since, last - since + 1, uv, self.good[rows].all(axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """Consecutive observations of tracks.

    Parameters
    ----------
    first, length
        (n,) integers: first frames, and how many observations there are.
    uv
        (n, CLONES, 2) float64: observed positions, px; 0 after the last.
    good
        (n,) bool: whether the errors of all are known to be small.
    """

    first: NDArray[np.int64]
    length: NDArray[np.int64]
    uv: NDArray[np.float64]
    good: NDArray[np.bool_]

    @property
    def there(self) -> NDArray[np.bool_]:
        """(n, CLONES): whether there is an observation."""
        return np.asarray(np.arange(CLONES) < self.length[:, None])

    def chosen(self, places: NDArray[np.intp] | NDArray[np.bool_]) -> "Pieces":
        """Some of them."""
        return Pieces(self.first[places], self.length[places], self.uv[places], self.good[places])


class Unused:
    """What of the tracks a filter has not used yet."""

    def __init__(self, tracks: Tracks) -> None:
        self._tracks = tracks
        self._since = tracks.first - tracks.late  # the first frame that was not used
        self._in_state = np.zeros(len(tracks.first), dtype=np.bool_)

    def lost(self, frame: int) -> NDArray[np.int64]:
        """Tracks that ended in the frame before, with enough unused observations."""
        begun = np.maximum(self._since, self._tracks.first)
        return np.flatnonzero((self._tracks.last == frame - 1) & ~self._in_state & (frame - begun >= LEAST_FRAMES))

    def full(self, frame: int) -> NDArray[np.int64]:
        """Tracks whose next piece is as long as it may be."""
        here = (self._tracks.first <= frame) & (frame <= self._tracks.last) & ~self._in_state
        return np.flatnonzero(here & (frame - self._since == CLONES - 1))

    def whole(self, places: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether full pieces have `CLONES` frames: only a first one has fewer."""
        return np.asarray(self._since[places] >= self._tracks.first[places])

    def taken(self, places: NDArray[np.int64], frame: int) -> Pieces:
        """Unused observations up to a frame, which are used now."""
        since = np.maximum(self._since, self._tracks.first)[places]
        self._since[places] = frame + 1
        return self._tracks.pieces(places, since, np.minimum(self._tracks.last[places], frame))

    def put(self, places: NDArray[np.int64], frame: int, *, in_state: bool) -> None:
        """Tracks become features of the state at a frame, or are none any more."""
        self._in_state[places] = in_state
        self._since[places] = frame + 1


def whole_tracks(observations: pl.DataFrame) -> Tracks:
    """Tracks of a table with columns track, frame, u_px, v_px and good, cut where a frame is missing."""
    step = pl.col("frame").cast(pl.Int64).diff().over("track").fill_null(0)
    placed = observations.sort("track", "frame").with_columns(stretch=(step != 1).cast(pl.Int64).cum_sum())
    found = placed.group_by("stretch", maintain_order=True).agg(
        pl.col("frame").cast(pl.Int64).first(),
        pl.len().cast(pl.Int64),
        late=pl.col("track").cast(pl.Int64).first() % (CLONES - LEAST_FRAMES + 1),
    )
    first, length, late = (found[name].to_numpy() for name in ("frame", "len", "late"))
    uv = placed.select(pl.col("u_px", "v_px").cast(pl.Float64)).to_numpy()
    return Tracks(first, length, late, uv, placed["good"].to_numpy())
