"""Errors by where and how features move: places in the image, speed, parallax, depth edges.

All statistics are sums of errors by place, at a few ages. The sums are of untrimmed errors at the lowest speed, because
trimming removes just the tracks that such places explain. They add up over scenes and blocks. Blocks are pairs of those
of `tracknoise.statistics.prepared`, to keep tables small. The places are:

- Cells of the image. The image is divided into `MAP_COLUMNS` x `MAP_ROWS` cells of equal size. The cell of an
  observation is that of its true position. Images of any size have the same cells, so that scenes add up.
- Speed of the image, for errors along and across the image motion. A clock that is wrong by t shifts true positions by
  t times the image velocity: such errors lie along the motion, and grow with its speed. Classes of speed are half
  octaves, from 2^(k/2) to 2^((k+1)/2) px per frame of the sequence.
- What surrounds a feature: its depth, the nearest depth edge, the slope it lies on, and its parallax. A feature beside
  a depth edge has two surfaces in its window. A tracker that follows a mixture of both is drawn along by the other
  surface. Features on the far side are also those that become occluded.

Parallax in the image is how far true positions move relative to the median of all features. A rotation of the camera
moves all features nearly alike. What is left after the median is subtracted comes from translation, and differs with
depth.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.changes import followers
from tracknoise.statistics.definitions import (
    EDGE_BOUNDS_PX,
    INCIDENCE_STEP_DEG,
    LEAST_MOTION_PX,
    MAP_COLUMNS,
    MAP_ROWS,
    PLACE_AGES,
)
from tracknoise.statistics.grouping import number_combinations
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import EdgeSide, Occlusion, Surrounding
from tracknoise.tables.schema import AXIS, IMAGE_MAP, IMAGE_SPEEDS, OCCLUSION, SURROUNDING, SURROUNDINGS, typed


@dataclass(frozen=True, slots=True)
class ImageMotion:
    """Visible observations whose true position has moved since the frame before, by `LEAST_MOTION_PX` or more."""

    rows: NDArray[np.intp]  # (n,): rows of the observations
    direction: NDArray[np.float64]  # (n, 2): unit vector of the motion
    length_px: NDArray[np.float64]  # (n,): length of the motion between two frames that the tracker saw


def image_motion(sequence: PreparedSequence, chosen: NDArray[np.bool_]) -> ImageMotion:
    """Motion of the true positions of chosen observations, (rows,) bool, whose predecessors are chosen too."""
    seen = sequence.seen
    true_px = sequence.true_px
    rows = sequence.ordered_where(chosen & ~np.isnan(true_px).any(axis=1))
    late = followers(sequence.track_row[rows], seen.frame[rows], seen.speed[rows], 1)
    step = true_px[rows[late]] - true_px[rows[late - 1]]
    length = np.sqrt(step[:, 0] ** 2 + step[:, 1] ** 2)
    directed = (length >= LEAST_MOTION_PX) & seen.visible[rows[late]]
    return ImageMotion(rows[late][directed], step[directed] / length[directed, None], length[directed])


def along_and_across(
    sequence: PreparedSequence, rows: NDArray[np.intp], direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Errors of observations along unit vectors (n, 2) and across them, to the right, (n, 2)."""
    (du, dv), (d_u, d_v) = sequence.seen.error_px[rows].T, direction.T
    return np.column_stack([d_u * du + d_v * dv, d_u * dv - d_v * du])


_BLOCKS_TOGETHER = 2


def at_place_ages(sequence: PreparedSequence) -> NDArray[np.bool_]:
    """Whether each observation is at the lowest speed and one of the ages of places, (rows,).

    These are `PLACE_AGES`, or the largest ages below them at which the speed has observations. With a key frame, they
    count frames after it.
    """
    speed, since = sequence.seen.speed, sequence.seen.at - (sequence.key_frame or 0)
    chosen = np.zeros(len(since), dtype=bool)
    for age in PLACE_AGES:
        chosen |= since == np.maximum(age // speed, 1) * speed
    return chosen & sequence.at_slowest


def summed(
    sequence: PreparedSequence,
    rows: NDArray[np.intp],
    keys: Mapping[str, NDArray[np.intp]],
    values: Mapping[str, NDArray[np.float64]],
) -> pl.DataFrame:
    """Sums of values over the rows that agree in scene, condition, block, age and keys.

    Returns: columns of `ORIGIN`, block, axis, at, the keys, n, and the sums; sorted by the columns before n.
    """
    seen, block = sequence.seen, sequence.block[rows] // _BLOCKS_TOGETHER
    combined, index = number_combinations([seen.condition[rows], block, seen.at[rows], *keys.values()])
    condition, *other_keys = combined
    columns = dict(zip(("block", "at", *keys), other_keys, strict=True))
    columns |= {"n": np.bincount(index, minlength=len(condition))}
    columns |= {name: np.bincount(index, value, len(condition)) for name, value in values.items()}
    return seen.conditions[condition].with_columns(pl.lit(seen.axis, dtype=AXIS).alias("axis"), **columns)


def products(error_px: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """du, dv and their products of errors (n, 2), by the names of their sums."""
    du, dv = error_px.T
    return {"sum_u": du, "sum_v": dv, "sum_uu": du * du, "sum_uv": du * dv, "sum_vv": dv * dv}


def squares(error_px: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Errors along and across, (n, 2), and their squares, by the names of their sums."""
    along, across = error_px.T
    return {"sum_along": along, "sum_across": across, "sum_along_2": along * along, "sum_across_2": across * across}


def image_map(sequence: PreparedSequence, *, width: int, height: int) -> pl.DataFrame:
    """Sums of visible errors by cell, at the lowest speed and a few ages.

    Parameters
    ----------
    sequence
        Trimmed.
    width, height
        Of the images, px.

    Returns
    -------
    polars.DataFrame
        Schema `IMAGE_MAP`, sorted by its columns before n, with one row for each combination that has an error.
    """
    rows = np.flatnonzero(at_place_ages(sequence) & sequence.seen.visible)
    cells = (sequence.true_px[rows] + 0.5) / (width, height) * (MAP_COLUMNS, MAP_ROWS)
    column, row = np.clip(cells.astype(np.intp), 0, (MAP_COLUMNS - 1, MAP_ROWS - 1)).T
    table = summed(sequence, rows, {"column": column, "row": row}, products(sequence.seen.error_px[rows]))
    return typed(table, IMAGE_MAP)


_LOWEST = -40
"""The class of all speeds below 1e-6 px per frame."""


def image_speeds(sequence: PreparedSequence) -> pl.DataFrame:
    """Sums of visible errors by speed of the image, at the lowest speed of play and a few ages.

    Returns schema `IMAGE_SPEEDS`, sorted by its columns before n, with one row for each combination that has an error.
    """
    moved = image_motion(sequence, sequence.at_slowest)
    chosen = at_place_ages(sequence)[moved.rows]
    rows, direction = moved.rows[chosen], moved.direction[chosen]
    per_frame = moved.length_px[chosen] / sequence.seen.speed[rows]
    octave = np.maximum(np.floor(2.0 * np.log2(per_frame)).astype(np.intp), _LOWEST)
    values = squares(along_and_across(sequence, rows, direction))
    table = summed(sequence, rows, {"octave": octave - _LOWEST}, values)
    bound = (pl.col("octave").cast(pl.Float64) + _LOWEST) / 2.0
    table = table.with_columns(low=2.0**bound, high=2.0 ** (bound + 0.5))
    return typed(table, IMAGE_SPEEDS)


_FEWEST = 10
"""The median motion of fewer features than this is not used."""
_KEYS = ["condition", "frame"]


def parallax_px(sequence: PreparedSequence, rows: NDArray[np.intp]) -> NDArray[np.float64]:
    """Motion of true positions since errors were zero, less the median of all features over the same frames.

    Returns (n,) px. Lengths, px. NaN where the true position in either frame is unknown, or too few others are known.
    """
    seen = sequence.seen
    since = seen.at[rows] - (sequence.key_frame or 0)
    true, lengths = _true_positions(sequence), np.full(len(seen.track), np.nan)
    for age in np.unique(since):
        motion = _over(true, int(age))
        of_age = np.full(len(lengths), np.nan)
        of_age[motion["row"].to_numpy()] = motion["length"].to_numpy()
        lengths[rows[since == age]] = of_age[rows[since == age]]
    return lengths[rows]


def _over(table: pl.DataFrame, age: int) -> pl.DataFrame:
    """Columns row and length: motion over as many frames, less the median."""
    earlier = table.with_columns(frame=pl.col("frame") + age).select("condition", "track", "frame", u0="u", v0="v")
    moved = table.join(earlier, on=["condition", "track", "frame"])
    moved = moved.select("row", *_KEYS, u=pl.col("u") - pl.col("u0"), v=pl.col("v") - pl.col("v0"))
    medians = moved.group_by(_KEYS).agg(pl.col("u", "v").median().name.suffix("_median"), n=pl.len())
    with_medians = moved.join(medians.filter(pl.col("n") >= _FEWEST), on=_KEYS)
    length = ((pl.col("u") - pl.col("u_median")).pow(2) + (pl.col("v") - pl.col("v_median")).pow(2)).sqrt()
    return with_medians.select("row", length=length)


def _true_positions(sequence: PreparedSequence) -> pl.DataFrame:
    """Columns row, condition, track, frame, u and v of observations at the lowest speed with a true position."""
    seen = sequence.seen
    columns = {"condition": seen.condition, "track": seen.track, "frame": seen.frame}
    true = sequence.observations.select(u="u_true_px", v="v_true_px")
    table = true.with_row_index("row").with_columns(**{name: pl.Series(values) for name, values in columns.items()})
    return table.filter(pl.Series(sequence.at_slowest)).drop_nulls(["u", "v"])


_SIGNED_BOUNDS_PX = (*(-bound for bound in reversed(EDGE_BOUNDS_PX[1:])), *EDGE_BOUNDS_PX)


@dataclass(frozen=True, slots=True)
class _Classes:
    """Classes of observations by one property."""

    surrounding: Surrounding  # the property
    number: NDArray[np.intp]  # (n,): class of each of the rows; -1 where it has none
    # low, high: bounds of each class; None where it has none
    low: list[float | None]
    high: list[float | None]


def surroundings(sequence: PreparedSequence) -> pl.DataFrame:
    """Sums of errors by class of each property, at the lowest speed and a few ages.

    Returns schema `SURROUNDINGS`, sorted by its columns before n, with one row for each combination that has an error.
    A property that is unknown of all tracks has no rows.
    """
    occlusion = _occlusion(sequence)
    rows = np.flatnonzero(at_place_ages(sequence) & (occlusion >= 0))
    values = {**products(sequence.seen.error_px[rows]), **_directed(sequence, rows)}
    parts = [_of_classes(sequence, classes, rows, occlusion[rows], values) for classes in _classes(sequence, rows)]
    keys = list(SURROUNDINGS)[: list(SURROUNDINGS).index("n")]
    return pl.concat(parts).sort(keys)


def _of_classes(
    sequence: PreparedSequence,
    classes: _Classes,
    rows: NDArray[np.intp],
    occlusion: NDArray[np.intp],
    values: dict[str, NDArray[np.float64]],
) -> pl.DataFrame:
    has_class = classes.number >= 0
    keys = {"class": classes.number[has_class], "occlusion": occlusion[has_class]}
    table = summed(sequence, rows[has_class], keys, {name: value[has_class] for name, value in values.items()})
    place = table["class"].to_numpy()
    table = table.with_columns(
        pl.lit(classes.surrounding, dtype=SURROUNDING).alias("surrounding"),
        pl.Series("low", classes.low, dtype=pl.Float64).gather(place),
        pl.Series("high", classes.high, dtype=pl.Float64).gather(place),
        pl.Series("occlusion", list(Occlusion), dtype=OCCLUSION).gather(table["occlusion"].to_numpy()),
    )
    return typed(table, SURROUNDINGS)


def _occlusion(sequence: PreparedSequence) -> NDArray[np.intp]:
    """Place in `Occlusion` of each observation, (rows,); -1 where its error is unknown or it is out of the image."""
    seen = sequence.seen
    hidden = (sequence.observations["truth"] == "occluded").to_numpy()
    last = np.full(sequence.tracks.height, -1, dtype=np.int64)
    np.maximum.at(last, sequence.track_row[hidden], seen.frame[hidden])
    later = seen.frame < last[sequence.track_row]
    never, to_come, now = range(len(Occlusion))
    return np.select([hidden & seen.projected, seen.visible & later, seen.visible], [now, to_come, never], default=-1)


def _directed(sequence: PreparedSequence, rows: NDArray[np.intp]) -> dict[str, NDArray[np.float64]]:
    """Whether each of the rows has a direction of motion, and its errors along and across it, 0 where it has none."""
    moved = image_motion(sequence, sequence.at_slowest)
    turned = np.zeros((sequence.observations.height, 2))
    directed = np.zeros(len(turned))
    turned[moved.rows] = along_and_across(sequence, moved.rows, moved.direction)
    directed[moved.rows] = 1.0
    return {"n_directed": directed[rows], **squares(turned[rows])}


def _classes(sequence: PreparedSequence, rows: NDArray[np.intp]) -> Iterator[_Classes]:
    tracks = sequence.tracks
    of_tracks = _by_depth(tracks["depth_m"]), _by_edge(tracks), _by_incidence(tracks["incidence_deg"])
    for classes in of_tracks:
        yield replace(classes, number=classes.number[sequence.track_row[rows]])
    depth_known = tracks["depth_m"].is_not_null().to_numpy()[sequence.track_row[rows]]
    yield _by_parallax(np.where(depth_known, parallax_px(sequence, rows), np.nan))


def _by_depth(depth: pl.Series) -> _Classes:
    """Half octaves: from 2^(k/2) to 2^((k+1)/2) m."""
    depth_m = depth.to_numpy()
    is_known = depth_m > 0.0
    octave = np.floor(2.0 * np.log2(np.where(is_known, depth_m, 1.0))).astype(np.intp)
    first = int(octave.min(initial=0))
    bounds = [2.0 ** (k / 2.0) for k in range(first, int(octave.max(initial=0)) + 2)]
    return _Classes(Surrounding.depth, np.where(is_known, octave - first, -1), [*bounds[:-1]], [*bounds[1:]])


def _by_edge(tracks: pl.DataFrame) -> _Classes:
    """Between successive bounds of the signed distance; the last class has no edge in reach."""
    edge_px = tracks["edge_px"].cast(pl.Float64).to_numpy()
    number = np.searchsorted(_SIGNED_BOUNDS_PX, edge_px, side="right") - 1
    last = len(_SIGNED_BOUNDS_PX) - 1
    none = (tracks["edge_side"] == EdgeSide.none).fill_null(value=False).to_numpy()
    number = np.where(none, last, np.where(np.isnan(edge_px), -1, np.clip(number, 0, last - 1)))
    return _Classes(Surrounding.edge, number, [*_SIGNED_BOUNDS_PX[:-1], None], [*_SIGNED_BOUNDS_PX[1:], None])


def _by_parallax(parallax: NDArray[np.float64]) -> _Classes:
    """Octaves from 1 px: from 0 to 1 px, from 1 to 2 px, from 2 to 4 px."""
    is_known = ~np.isnan(parallax)
    octave = np.floor(np.log2(np.maximum(np.where(is_known, parallax, 0.0), 0.5))).astype(np.intp) + 1
    bounds = [0.0, *(2.0**k for k in range(int(octave.max(initial=0)) + 1))]
    return _Classes(Surrounding.parallax, np.where(is_known, octave, -1), [*bounds[:-1]], [*bounds[1:]])


def _by_incidence(incidence: pl.Series) -> _Classes:
    incidence_deg = incidence.cast(pl.Float64).to_numpy()
    bounds = [float(bound) for bound in range(0, 91, INCIDENCE_STEP_DEG)]
    is_known = ~np.isnan(incidence_deg)
    number = np.minimum(np.where(is_known, incidence_deg, 0.0) // INCIDENCE_STEP_DEG, len(bounds) - 2).astype(np.intp)
    return _Classes(Surrounding.incidence, np.where(is_known, number, -1), [*bounds[:-1]], [*bounds[1:]])
