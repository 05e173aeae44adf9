"""Differences between two trackers that track the same corners, in which any error of the truth cancels.

Let two tracks begin at the same place of the same frame, and let x and y be their positions some frames later. Both
have the same true position p, whatever p is, so that

    (x - p) - (y - p) = x - y    (between)

is the difference of their errors, and p need not be known. An error of the poses, the depth, the calibration or the
clock is in neither the mean nor the covariance of this difference. What both trackers have in common is not in it
either: two trackers may share a bias.

Two tracks are of the same corner if they begin at most `SAME_CORNER_PX` apart in the same frame. What they are apart
there is subtracted. Every frame counts in which both trackers report a position, also where the point is occluded:
whether it is occluded is what the truth says, and this statistic must not depend on the truth.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial import KDTree

from tracknoise.statistics.definitions import STEPS
from tracknoise.statistics.errors.joint import measure_moments
from tracknoise.statistics.errors.moment_cells import SECOND
from tracknoise.statistics.grouping import number_combinations
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.schema import BETWEEN_TRACKERS, SEQUENCE, check, empty

SAME_CORNER_PX = 0.1
"""Largest distance between the first positions of two tracks of the same corner, px."""
_MOMENTS = ("n", "mean_u", "mean_v", "m_uu", "m_uv", "m_vv")
_KEYS = [name for name in BETWEEN_TRACKERS if name not in _MOMENTS]


def between_trackers(sequence: PreparedSequence) -> pl.DataFrame:
    """Moments of the differences of every two trackers, by (between).

    Parameters
    ----------
    sequence
        All of its tracks count, whether or not trimming kept them. Trackers are compared at the speed `slowest`, or at
        every speed.

    Returns
    -------
    polars.DataFrame
        Schema `BETWEEN_TRACKERS`, sorted by its columns before `n`, at ages of `STEPS`. Without rows where no two
        trackers have tracks of the same corner. `block` is that of the track of `tracker`.
    """
    conditions = sequence.seen.conditions.with_row_index("row")
    compared = conditions if sequence.slowest is None else conditions.filter(speed=sequence.slowest)
    together = compared.partition_by([*SEQUENCE, "speed"], maintain_order=True)
    pairs = [pair for group in together for pair in combinations(group["row"].to_list(), 2)]
    found = _Positions.of(sequence) if pairs else None
    parts = [_moments(found, *pair) for pair in pairs] if found else []
    table = pl.concat([empty(BETWEEN_TRACKERS), *parts]).sort(_KEYS)
    return check(table, BETWEEN_TRACKERS, "between trackers")


@dataclass(frozen=True, slots=True)
class _Positions:
    """Positions of tracks, from the first of each.

    Attributes
    ----------
    sequence
        Whose tracks they are.
    first : (tracks, 2) float64
        First position, px; NaN where the observation is missing.
    moved : (rows, 2) float64
        Position less that of the first frame, px.
    counted : (rows,) bool
        Whether the table has the age.
    """

    sequence: PreparedSequence
    first: NDArray[np.float64]
    moved: NDArray[np.float64]
    counted: NDArray[np.bool_]

    @classmethod
    def of(cls, sequence: PreparedSequence) -> "_Positions":
        seen = sequence.seen
        uv = sequence.observations.select("u_px", "v_px").to_numpy()
        first = np.full((sequence.tracks.height, 2), np.nan)
        born = np.flatnonzero(seen.age == 0)
        first[sequence.track_row[born]] = uv[born]
        steps, left = np.divmod(seen.age, seen.speed)
        return cls(sequence, first, uv - first[sequence.track_row], (left == 0) & np.isin(steps, STEPS))

    def of_tracks(self, tracks: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
        """Rows of the counted observations of tracks; and a number for the place of the track in `tracks` and frame."""
        place = np.full(self.sequence.tracks.height, -1, np.int64)
        place[tracks] = np.arange(len(tracks))
        mine = place[self.sequence.track_row]
        rows = np.flatnonzero((mine >= 0) & self.counted)
        frame = self.sequence.seen.frame
        return rows, mine[rows] * (frame.max(initial=0) + 1) + frame[rows]


def _moments(positions: _Positions, one: int, other: int) -> pl.DataFrame:
    """Moments of the differences of two conditions, by block and age."""
    sequence = positions.sequence
    rows, others = _same_frames(positions, *_same_corners(positions, one, other))
    (block, age), group = number_combinations([sequence.block[rows], sequence.seen.age[rows]])
    found = measure_moments(positions.moved[rows] - positions.moved[others], group, len(block), orders=SECOND)
    columns = (block, age, found.n, *found.mean.T, *found.central.T)
    values = {name: pl.Series(column) for name, column in zip(("block", "age", *_MOMENTS), columns, strict=True)}
    labels = sequence.seen.conditions[[one] * len(block)]
    named = labels.with_columns(pl.lit(sequence.seen.conditions["tracker"][other]).alias("other"), **values)
    return named.select(pl.col(name).cast(kind) for name, kind in BETWEEN_TRACKERS.items())


def _same_corners(positions: _Positions, one: int, other: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows of the tracks of two conditions that are of the same corner: each is the nearest to the other."""
    sequence = positions.sequence
    apart = sequence.tracks["first_frame"].to_numpy() * (3.0 * SAME_CORNER_PX)  # so that other frames are too far
    places = np.column_stack([apart, positions.first])
    known = np.isfinite(positions.first[:, 0])
    mine, theirs = (np.flatnonzero((sequence.track_condition == row) & known) for row in (one, other))
    if not len(mine) or not len(theirs):
        return mine[:0], theirs[:0]
    distance, nearest = KDTree(places[theirs]).query(places[mine])
    back = np.asarray(KDTree(places[mine]).query(places[theirs])[1])
    nearest = np.asarray(nearest)
    same = (distance <= SAME_CORNER_PX) & (back[nearest] == np.arange(len(mine)))
    return mine[same], theirs[nearest[same]]


def _same_frames(
    positions: _Positions, mine: NDArray[np.intp], theirs: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows of the observations of pairs of tracks in the same frames."""
    (rows, number), (others, other_number) = positions.of_tracks(mine), positions.of_tracks(theirs)
    _, at, at_other = np.intersect1d(number, other_number, assume_unique=True, return_indices=True)
    return rows[at], others[at_other]
