"""What errors of the truth contribute: its floor, and differences between two truths or two trackers.

Truth floor
-----------

The floor of a condition is what `tracknoise.measurement.floors` summed up in each scene, pooled over scenes. Features
are pooled. With n features in all scenes, the floor of the second moment is the sum of the covariances of their true
positions over n. The variance of their mean error is (own + shared^2) / n^2: `own` adds up over scenes, and `shared`
does so with its sign, because the cause is the same in all scenes.

Differences between two trackers
--------------------------------

Where two trackers track the same corners, any error of the truth cancels in their difference. Let two tracks begin at
the same place of the same frame, and let x and y be their positions some frames later. Both have the same true position
p, whatever p is, so that

    (x - p) - (y - p) = x - y    (between)

is the difference of their errors, and p need not be known. An error of the poses, the depth, the calibration or the
clock is in neither the mean nor the covariance of this difference. What both trackers have in common is not in it
either: two trackers may share a bias.

Two tracks are of the same corner if they begin at most `SAME_CORNER_PX` apart in the same frame. What they are apart
there is subtracted. Every frame counts in which both trackers report a position, also where the point is occluded:
whether it is occluded is what the truth says, and this statistic must not depend on the truth.

Differences between two truths
------------------------------

With A and B the poses world_from_camera of two truths in frames i and j = i + lag, the relative poses differ by
E = (A_i^-1 A_j)^-1 (B_i^-1 B_j). It does not depend on either world frame. Its rotation vector and its translation are
those in the camera frame of frame j. (truths.poses)

The positions of two truths of the same observations give sums of their difference, and of the errors by each of them.
With x_1 and x_2 the true positions of an observation x by the first and the second truth:

- disagreement = x_2 - x_1, first = x - x_1, second = x - x_2 (truths.disagreement)
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from tracknoise.inference.units import BLOCKS
from tracknoise.statistics.definitions import NAMES, POOLED, STEPS
from tracknoise.statistics.grouping import group_rows, in_chunks, number_combinations
from tracknoise.statistics.moments import SECOND, measure_moments
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import FloorSource, Trimming, TruthQuantity
from tracknoise.tables.findings_schema import FLOOR
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import (
    BETWEEN_TRACKERS,
    FLOOR_SOURCE,
    FLOORS,
    ORIGIN,
    POSE_DIFFERENCES,
    SECOND_TRUTH,
    SEQUENCE,
    TRIMMING,
    TRUTH_DIFFERENCES,
    TRUTH_QUANTITY,
    check,
    empty,
    of_second_camera,
    typed,
)

FLOOR_COLUMNS = ("floor_u", "floor_v")
"""Columns that `with_floor` adds to curves."""
_PLACE = [*POOLED, "axis", "at"]
_POINT = [*POOLED, "source", "axis", "at"]
_NUMBERS = ["n", "n_scenes"]
_FLOOR_MOMENTS = ["sum_uu", "sum_uv", "sum_vv"]
_MEANS = ["own_uu", "own_vv", "shared_u", "shared_v"]
_UNKNOWN = "unknown"
"""Number of scenes whose mean is unknown."""


def truth_floor(floors: pl.DataFrame | Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Truth floor by condition, source, and age or frame.

    Parameters
    ----------
    floors
        Schema `FLOORS`, of any number of scenes; or any number of such tables, which are read a few at a time.

    Returns
    -------
    polars.DataFrame
        Schema `FLOOR`, sorted by its columns before `n`. The mean is null where only the second moment is known.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    of_sources = pl.DataFrame(schema=_kinds(_POINT, [*_NUMBERS, *_FLOOR_MOMENTS, *_MEANS, _UNKNOWN]))
    of_scenes = pl.DataFrame(schema=_kinds(_PLACE, _NUMBERS))
    for chunk in in_chunks(floors, FLOORS, "floors"):
        rows = chunk.with_columns(
            pl.col("n").cast(pl.Float64),
            pl.col(_MEANS).fill_null(0.0),
            n_scenes=pl.lit(1.0),
            unknown=pl.col("own_uu").is_null().cast(pl.Float64),
        )
        scenes = rows.unique([*ORIGIN, "axis", "at"], keep="first", maintain_order=True)
        of_sources = _added(pl.concat([of_sources, rows.select(of_sources.columns)]), _POINT)
        of_scenes = _added(pl.concat([of_scenes, scenes.select(of_scenes.columns)]), _PLACE)
    squared = of_sources.with_columns(var_u=_variance("u"), var_v=_variance("v"))
    together = _added(squared.select(*_PLACE, *_FLOOR_MOMENTS, "var_u", "var_v", _UNKNOWN), _PLACE).join(
        of_scenes, on=_PLACE
    )
    all_sources = together.with_columns(source=pl.lit(FloorSource.all, dtype=FLOOR_SOURCE)).with_columns(_values())
    single = squared.filter(pl.col("source") != FloorSource.all).with_columns(_values())
    parts = [typed(part, FLOOR) for part in (all_sources, single)]
    return pl.concat(parts).sort(_POINT)


def _kinds(keys: Sequence[str], sums: Sequence[str]) -> dict[str, pl.DataType | type[pl.DataType]]:
    return {**{name: FLOORS[name] for name in keys}, **dict.fromkeys(sums, pl.Float64)}


def _added(rows: pl.DataFrame, keys: list[str]) -> pl.DataFrame:
    """The rows of each group, added up in their order."""
    groups = group_rows(rows, keys)
    return groups.keys.hstack(groups.sums(rows, [name for name in rows.columns if name not in keys]))


def _variance(axis: str) -> pl.Expr:
    """Variance of the sum of all errors of a coordinate."""
    return pl.col(f"own_{axis}{axis}") + pl.col(f"shared_{axis}").pow(2)


def _values() -> list[pl.Expr]:
    n = pl.col("n")
    where_known = pl.when(pl.col(_UNKNOWN) == 0.0)
    moments = [(pl.col(f"sum_{name}") / n).alias(f"floor_{name}") for name in ("uu", "uv", "vv")]
    return [*moments, *(where_known.then(pl.col(f"var_{axis}").sqrt() / n).alias(f"mean_{axis}_px") for axis in "uv")]


def with_floor(curves: pl.DataFrame, floor: pl.DataFrame) -> pl.DataFrame:
    """Curves with the truth floor of their values in u and v.

    Parameters
    ----------
    curves
        Columns of `CURVES`.
    floor
        Schema `FLOOR`.

    Returns
    -------
    polars.DataFrame
        The same rows with columns floor_u and floor_v, in the unit of the curve: the standard deviation of the mean
        beside means, and the second moment beside second and central moments. Null beside other statistics, and where
        nothing is known of the errors of the truth.

    Raises
    ------
    SchemaError
        If `floor` has other columns.
    """
    values = {
        "mean": ("mean_u_px", "mean_v_px"),
        "second": ("floor_uu", "floor_vv"),
        "central": ("floor_uu", "floor_vv"),
    }
    floors = check(floor, FLOOR, "floor").filter(source=FloorSource.all).drop("source", "n", "n_scenes", "floor_uv")
    table = curves.join(floors, on=_PLACE, how="left", maintain_order="left")
    columns = {}
    for place, column in enumerate(FLOOR_COLUMNS):
        value = pl.lit(None, dtype=pl.Float64)
        for role, names in values.items():
            called = [name[role] for name in NAMES.values()]
            value = pl.when(pl.col("statistic").is_in(called)).then(pl.col(names[place])).otherwise(value)
        columns[column] = value
    return table.with_columns(**columns).drop("floor_uu", "floor_vv", "mean_u_px", "mean_v_px")


SAME_CORNER_PX = 0.1
"""Largest distance between the first positions of two tracks of the same corner, px."""
_DIFFERENCE_MOMENTS = ("n", "mean_u", "mean_v", "m_uu", "m_uv", "m_vv")
_KEYS = [name for name in BETWEEN_TRACKERS if name not in _DIFFERENCE_MOMENTS]


def between_trackers(sequence: PreparedSequence) -> pl.DataFrame:
    """Moments of the differences of every two trackers, by (between).

    Returns schema `BETWEEN_TRACKERS`, sorted by its columns before `n`, at ages of `STEPS`. Without rows where no two
    trackers have tracks of the same corner. `block` is that of the track of `tracker`.
    """
    conditions = sequence.seen.conditions.with_row_index("row")
    of_first = conditions.filter(~pl.col("tracker").is_in(of_second_camera(sequence.observations)))
    compared = of_first if sequence.slowest is None else of_first.filter(speed=sequence.slowest)
    together = compared.partition_by([*SEQUENCE, "speed"], maintain_order=True)
    pairs = [pair for group in together for pair in combinations(group["row"].to_list(), 2)]
    positions = _Positions.of(sequence) if pairs else None
    parts = [_moments(positions, *pair) for pair in pairs] if positions else []
    return pl.concat([empty(BETWEEN_TRACKERS), *parts]).sort(_KEYS)


@dataclass(frozen=True, slots=True)
class _Positions:
    """Positions of tracks, from the first of each."""

    sequence: PreparedSequence  # whose tracks they are
    first: NDArray[np.float64]  # (tracks, 2): first position, px; NaN where the observation is missing
    moved: NDArray[np.float64]  # (rows, 2): position less that of the first frame, px
    counted: NDArray[np.bool_]  # (rows,): whether the table has the age

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


def _moments(positions: _Positions, first: int, second: int) -> pl.DataFrame:
    """Moments of the differences of two conditions, by block and age."""
    sequence = positions.sequence
    rows, other_rows = _same_frames(positions, *_same_corners(positions, first, second))
    (block, age), group = number_combinations([sequence.block[rows], sequence.seen.age[rows]])
    moments = measure_moments(positions.moved[rows] - positions.moved[other_rows], group, len(block), orders=SECOND)
    columns = (block, age, moments.n, *moments.mean.T, *moments.central.T)
    values = {
        name: pl.Series(column) for name, column in zip(("block", "age", *_DIFFERENCE_MOMENTS), columns, strict=True)
    }
    labels = sequence.seen.conditions[[first] * len(block)]
    named = labels.with_columns(pl.lit(sequence.seen.conditions["tracker"][second]).alias("other"), **values)
    return typed(named, BETWEEN_TRACKERS)


def _same_corners(positions: _Positions, first: int, second: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows of the tracks of two conditions that are of the same corner: each is the nearest to the other."""
    sequence = positions.sequence
    apart = sequence.tracks["first_frame"].to_numpy() * (3.0 * SAME_CORNER_PX)  # so that other frames are too far
    places = np.column_stack([apart, positions.first])
    has_position = np.isfinite(positions.first[:, 0])
    mine, theirs = (np.flatnonzero((sequence.track_condition == row) & has_position) for row in (first, second))
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
    (rows, number), (other_rows, other_number) = positions.of_tracks(mine), positions.of_tracks(theirs)
    _, at, at_other = np.intersect1d(number, other_number, assume_unique=True, return_indices=True)
    return rows[at], other_rows[at_other]


LAGS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96)
"""Frames between the two frames of a pair."""
_SQUARES = ("rotation_rad2", "translation_m2")


def pose_differences(sequence: SequenceId, first: NDArray[np.float64], second: NDArray[np.float64]) -> pl.DataFrame:
    """Squared differences of relative poses, summed by lag and stretch of the sequence.

    Parameters
    ----------
    sequence
        Name of the sequence.
    first, second
        (n, 4, 4) float64: world_from_camera of the same frames; NaN for a frame without a pose.

    Returns
    -------
    polars.DataFrame
        Schema `POSE_DIFFERENCES`, sorted by its columns before `n`. A pair of frames lies in the stretch of its first
        frame.
    """
    parts = [_of_lag(first, second, lag) for lag in LAGS if lag < len(first)]
    table = pl.concat([empty(POSE_DIFFERENCES).drop(*SEQUENCE), *parts])
    names = [pl.lit(getattr(sequence, name), dtype=kind).alias(name) for name, kind in SEQUENCE.items()]
    named = table.with_columns(names).select(*POSE_DIFFERENCES).sort(*SEQUENCE, "block", "lag")
    return check(named, POSE_DIFFERENCES, "pose differences")


def relative_differences(first: NDArray[np.float64], second: NDArray[np.float64], lag: int) -> NDArray[np.float64]:
    """Rotation vectors (rad) and translations (m) of E of (truths.poses), (n - lag, 6) float64; NaN where unknown."""
    moved = [np.linalg.solve(_known(poses[:-lag]), _known(poses[lag:])) for poses in (first, second)]
    difference = np.linalg.solve(*moved)
    rotation = Rotation.from_matrix(difference[:, :3, :3]).as_rotvec()
    vectors = np.concatenate([rotation, difference[:, :3, 3]], axis=1)
    ends = (first[:-lag], first[lag:], second[:-lag], second[lag:])
    vectors[np.any([np.isnan(poses).any(axis=(1, 2)) for poses in ends], axis=0)] = np.nan
    return vectors


def _known(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Poses with the identity where there is none."""
    return np.where(np.isnan(poses), np.eye(4), poses)


def _of_lag(first: NDArray[np.float64], second: NDArray[np.float64], lag: int) -> pl.DataFrame:
    difference = relative_differences(first, second, lag)
    frames = np.flatnonzero(~np.isnan(difference).any(axis=1))
    squares = np.square(difference[frames]).reshape(-1, 2, 3).mean(axis=2)
    block = frames * BLOCKS // len(difference)
    sums = {name: np.bincount(block, squares[:, place], BLOCKS) for place, name in enumerate(_SQUARES)}
    table = pl.DataFrame({"block": np.arange(BLOCKS), "lag": [lag] * BLOCKS, "n": np.bincount(block, minlength=BLOCKS)})
    kinds = {name: kind for name, kind in POSE_DIFFERENCES.items() if name not in SEQUENCE}
    return typed(table.with_columns(**sums).filter(pl.col("n") > 0), kinds)


_SUMS = ("n", "u", "v", "uu", "uv", "vv")


def truth_differences(sequence: PreparedSequence) -> pl.DataFrame:
    """Sums of the disagreement of two truths and of the errors by each, by age.

    Returns schema `TRUTH_DIFFERENCES`, sorted by its columns before `n`. Without rows unless there is a second truth.
    """
    if not set(SECOND_TRUTH) <= set(sequence.observations.columns):
        return empty(TRUTH_DIFFERENCES)
    second_px = sequence.observations.select(*SECOND_TRUTH).to_numpy()
    compared = sequence.seen.visible & sequence.at_slowest & ~np.isnan(second_px).any(axis=1)
    parts = [
        part
        for trimming, chosen in sequence.seen.by_trimming(compared).items()
        for part in _of_trimming(sequence, second_px, np.flatnonzero(chosen), trimming)
    ]
    table = pl.concat([empty(TRUTH_DIFFERENCES), *parts])
    keys = [name for name in TRUTH_DIFFERENCES if name not in _SUMS]
    return check(table.sort(keys), TRUTH_DIFFERENCES, "truth differences")


def _of_trimming(
    sequence: PreparedSequence, second_px: NDArray[np.float64], rows: NDArray[np.intp], trimming: Trimming
) -> Iterator[pl.DataFrame]:
    first = sequence.seen.error_px[rows]
    second = sequence.observations.select("u_px", "v_px").to_numpy()[rows] - second_px[rows]
    values = {
        TruthQuantity.disagreement: first - second,
        TruthQuantity.first: first,
        TruthQuantity.second: second,
    }
    of_trimming = pl.lit(trimming, dtype=TRIMMING).alias("trimming")
    for quantity, value in values.items():
        named = pl.lit(quantity, dtype=TRUTH_QUANTITY).alias("quantity")
        yield _summed(sequence, rows, value).with_columns(named, of_trimming).select(*TRUTH_DIFFERENCES)


def _summed(sequence: PreparedSequence, rows: NDArray[np.intp], value: NDArray[np.float64]) -> pl.DataFrame:
    """Sums by condition, block and age."""
    keys = {
        "condition": sequence.seen.condition[rows],
        "block": sequence.block[rows],
        "age": sequence.seen.age[rows].astype(np.uint32),
    }
    groups = group_rows(pl.DataFrame(keys), list(keys))
    u, v = value.T
    terms = zip(_SUMS, (np.ones_like(u), u, v, u * u, u * v, v * v), strict=True)
    sums = {name: np.bincount(groups.index, term, groups.count).astype(np.float64) for name, term in terms}
    summed = sequence.seen.with_conditions(groups.keys).with_columns(**sums)
    return summed.with_columns(pl.col("n").cast(TRUTH_DIFFERENCES["n"]))
