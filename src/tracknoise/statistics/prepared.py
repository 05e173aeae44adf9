"""The observations and tracks of a sequence, checked and grouped once for all of its statistics.

Blocks of tracks that were born next to each other in time are resampled where there are too few scenes. The tracks of a
sequence and condition are numbered from 0 in the order of their birth. Block b of B holds those with
floor(track B / n_tracks) = b (block). The numbers of tracks in two blocks differ by at most one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import SchemaError, UnknownNameError
from tracknoise.inference.units import BLOCKS
from tracknoise.statistics.grouping import Groups, group_runs
from tracknoise.tables.enumerations import Axis, Population, Trimming
from tracknoise.tables.schema import OBSERVATIONS, ORIGIN, TRACKS, check


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
    """Block of each track, UInt8. `tracks`: only the column `track` is read."""
    n_tracks = (pl.col("track").max().cast(pl.UInt64) + 1).over("condition")
    numbered = tracks.select("track", condition=condition)
    return numbered.select(block=block_of(pl.col("track"), n_tracks)).to_series()


VISIBLE = ("valid",)
POPULATIONS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {Population.visible: VISIBLE, Population.projected: (*VISIBLE, "occluded", "out_of_image")}
)
"""Truth statuses of each population.

visible: the true position is known and was visible. projected: it is known, whether or not it was visible, which is
what the paper uses.
"""


def track_runs(track: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Where each track begins, and how many observations it has. `track`: of each observation, track by track."""
    begins = np.flatnonzero(np.diff(track, prepend=-1))
    return begins, np.diff(np.append(begins, len(track)))


def check_population(population: str) -> str:
    """Return the name of a population."""
    if population not in POPULATIONS:
        raise UnknownNameError("population", population, POPULATIONS)
    return population


def in_population(observations: pl.DataFrame, population: str) -> NDArray[np.bool_]:
    """Whether each observation belongs to a population; those that do have an error.

    Parameters
    ----------
    observations
        An observations table.
    population
        A name in `POPULATIONS`.

    Returns
    -------
    (rows,) bool

    Raises
    ------
    UnknownNameError
        If there is no such population.
    SchemaError
        If an error is missing or not finite although the true position is said to be known.
    """
    belongs = pl.col("truth").is_in(POPULATIONS[check_population(population)])
    finite = (pl.col("du_px").is_finite() & pl.col("dv_px").is_finite()).fill_null(value=False)
    chosen = observations.select(belongs=belongs, broken=belongs & ~finite)
    if chosen["broken"].any():
        first = observations.filter(chosen["broken"]).row(0, named=True)
        place = f"track {first['track']} of {first['scene']!r} in frame {first['frame']}"
        raise SchemaError(f"observations: {place} has truth {first['truth']!r} but no finite du_px, dv_px")
    return chosen["belongs"].to_numpy()


@dataclass(frozen=True, slots=True)
class PreparedObservations:
    """Columns of an observations table as arrays, rows in the order of the table."""

    conditions: pl.DataFrame  # columns of `ORIGIN`: every sequence and condition once, sorted
    condition: NDArray[np.intp]  # (rows,): row of `conditions`
    # track, frame, age: (rows,): as in the table
    track: NDArray[np.int64]
    frame: NDArray[np.int64]
    age: NDArray[np.int64]
    error_px: NDArray[np.float64]  # (rows, 2): du and dv; NaN where the true position is unknown
    # visible, projected: (rows,): whether the observation belongs to the population; all that do have an error
    visible: NDArray[np.bool_]
    projected: NDArray[np.bool_]
    kept: NDArray[np.bool_]  # (rows,): false for observations of tracks that trimming dropped
    axis: Axis  # whether errors are zero in the first frame of a feature (``age``) or in a key frame (``frame``)

    @property
    def at(self) -> NDArray[np.int64]:
        """Age or frame of each observation, (rows,)."""
        return self.age if self.axis == Axis.age else self.frame

    @property
    def speed(self) -> NDArray[np.int64]:
        """Speed of each observation's condition, (rows,)."""
        speeds: NDArray[np.int64] = self.conditions["speed"].to_numpy().astype(np.int64)
        return speeds[self.condition]

    def members(self, population: str) -> NDArray[np.bool_]:
        """Whether each observation belongs to a population, (rows,)."""
        return self.visible if population == Population.visible else self.projected

    def by_trimming(self, chosen: NDArray[np.bool_]) -> dict[Trimming, NDArray[np.bool_]]:
        """The chosen observations, (rows,) bool, and those of them that trimming kept."""
        return {Trimming.untrimmed: chosen, Trimming.trimmed: chosen & self.kept}

    def with_conditions(self, table: pl.DataFrame) -> pl.DataFrame:
        """A table with the columns of `conditions` in place of its column `condition`, which has their rows."""
        return self.conditions[table["condition"].to_numpy()].hstack(table.drop("condition"))


@dataclass(frozen=True, slots=True)
class PreparedSequence:
    """Input of all statistics of a sequence.

    Attributes
    ----------
    observations, tracks
        The tables.
    seen
        The observations as arrays.
    track_condition : (tracks,) intp
        Row of `seen.conditions` for each track.
    track_block : (tracks,) uint8
        Block of each track, see `tracknoise.statistics.prepared`.
    track_row : (rows,) intp
        Row of `tracks` for each observation.
    ordered : (rows,) intp
        Rows of the observations, sorted by condition, track and frame.
    key_frame
        Frame in which a scan makes errors zero; None if they are zero in the first frame of each feature.
    populations
        Populations that are resampled in blocks.
    slowest
        Speed at which the blocks of aspects are measured; None for all speeds.
    """

    observations: pl.DataFrame
    tracks: pl.DataFrame
    seen: PreparedObservations
    track_condition: NDArray[np.intp]
    track_block: NDArray[np.uint8]
    track_row: NDArray[np.intp]
    ordered: NDArray[np.intp]
    key_frame: int | None
    populations: tuple[str, ...] = (Population.visible,)
    slowest: int | None = None

    @property
    def true_px(self) -> NDArray[np.float64]:
        """True position of each observation, (rows, 2), px; NaN where it is unknown."""
        return self.observations.select("u_true_px", "v_true_px").to_numpy()

    @property
    def block(self) -> NDArray[np.uint8]:
        """Block of the track of each observation, (rows,)."""
        return self.track_block[self.track_row]

    @property
    def at_slowest(self) -> NDArray[np.bool_]:
        """Whether each observation was made at the speed `slowest`, (rows,); at any speed where it is None."""
        speed = self.seen.speed
        return np.ones(len(speed), dtype=bool) if self.slowest is None else speed == self.slowest

    def of_trackers(self, names: Sequence[str]) -> "PreparedSequence":
        """The same of some of the trackers."""
        tables = (table.filter(pl.col("tracker").is_in(names)) for table in (self.observations, self.tracks))
        part = prepare_sequence(*tables, key_frame=self.key_frame, axis=self.seen.axis)
        return replace(part, populations=self.populations, slowest=self.slowest)

    def ordered_where(self, chosen: NDArray[np.bool_]) -> NDArray[np.intp]:
        """The chosen rows of the observations, (rows,) bool, in the order of `ordered`."""
        return self.ordered[chosen[self.ordered]]


def prepare_observations(observations: pl.DataFrame, *, axis: Axis = Axis.age) -> PreparedObservations:
    """Check an observations table and convert it to arrays."""
    check(observations, OBSERVATIONS, "observations")
    return _as_arrays(observations, group_runs([observations], list(ORIGIN))[0], axis)


def prepare_sequence(
    observations: pl.DataFrame,
    tracks: pl.DataFrame,
    *,
    key_frame: int | None = None,
    axis: Axis | None = None,
) -> PreparedSequence:
    """Check the tables of any number of sequences and group their rows."""
    check(observations, OBSERVATIONS, "observations")
    check(tracks, TRACKS, "tracks")
    of_observations, of_tracks = group_runs([observations, tracks], list(ORIGIN))
    seen = _as_arrays(observations, of_observations, axis or (Axis.age if key_frame is None else Axis.frame))
    numbers, track_row = _rows_of_tracks(seen, tracks["track"].to_numpy().astype(np.int64), of_tracks)
    return PreparedSequence(
        observations=observations,
        tracks=tracks,
        seen=seen,
        track_condition=of_tracks.index,
        track_block=blocks_of(tracks, pl.Series(of_tracks.index)).to_numpy(),
        track_row=track_row,
        ordered=np.argsort(numbers * (seen.frame.max(initial=0) + 1) + seen.frame, kind="stable"),
        key_frame=key_frame,
    )


def _as_arrays(observations: pl.DataFrame, groups: Groups, axis: Axis) -> PreparedObservations:
    return PreparedObservations(
        conditions=groups.keys,
        condition=groups.index,
        **{name: observations[name].to_numpy().astype(np.int64) for name in ("track", "frame", "age")},
        error_px=observations.select("du_px", "dv_px").to_numpy(),
        visible=in_population(observations, Population.visible),
        projected=in_population(observations, Population.projected),
        kept=observations["kept"].to_numpy(),
        axis=axis,
    )


def _rows_of_tracks(
    seen: PreparedObservations, track: NDArray[np.int64], tracks: Groups
) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """A number for the track of each observation, in the order of conditions and tracks; and its row in the table."""
    n_tracks = np.zeros(tracks.count, dtype=np.int64)
    np.maximum.at(n_tracks, tracks.index, track + 1)
    first = np.cumsum(n_tracks) - n_tracks
    count = np.bincount(first[tracks.index] + track, minlength=1)
    numbers = first[seen.condition] + seen.track
    in_range = seen.track < n_tracks[seen.condition]
    if not in_range.all() or (count[numbers] != 1).any():
        fault = "a track number is not in the tracks table, or several times"
        raise SchemaError(f"observations: {fault}, expected once among the tracks of its condition")
    rows = np.zeros(len(count), dtype=np.intp)
    rows[first[tracks.index] + track] = np.arange(len(track))
    return numbers, rows[numbers]
