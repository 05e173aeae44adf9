"""Errors by aspect: along and across the motion or the gradient, of long-lived tracks, and changes of errors.

With e = (du, dv) and a unit vector d in the image,

- along = d . e, across = (-d_v, d_u) . e: to the right of d, since v points down

`motion`: d is the direction in which the true position moved since the previous frame that the tracker saw. If that
direction turns, an error along it averages out in u and v, but not along d. `gradient`: d is the
dominant gradient in the first frame of the feature. It is an axis without a sign: absolute errors and second moments
along it are defined, mean errors are not.

`long_lived`: errors in image axes of the tracks that were seen at the age `at_least` or later. If they are smaller than
the errors of all tracks at the same age, there is survivorship bias: tracks with large errors are lost earlier.

`change`: changes of the errors of every track, in image axes, by the age at which they end.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.changes import changes
from tracknoise.statistics.definitions import LONG_LIVED_AGES
from tracknoise.statistics.moments import FOURTH, SECOND, MomentCells, Order, by_trimming, measure_cells, tabulate
from tracknoise.statistics.places import along_and_across, image_motion
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import Aspect, Axis, Population
from tracknoise.tables.schema import ASPECT, ASPECT_BLOCKS, ASPECTS, check


@dataclass(frozen=True, slots=True)
class _Errors:
    """Errors of some observations of a sequence."""

    rows: NDArray[np.intp]  # (errors,): rows of the observations
    error_px: NDArray[np.float64]  # (errors, 2): in u and v, or along and across


@dataclass(frozen=True, slots=True)
class _Keys:
    """Columns by which errors are grouped, besides condition and trimming."""

    columns: Mapping[str, NDArray[np.int64] | NDArray[np.uint8]]  # name and values, (rows,), of each key
    axis: str  # what ``at`` is
    orders: Sequence[Order]  # which central power sums are measured


def aspects(sequence: PreparedSequence) -> pl.DataFrame:
    """Moments of visible errors along and across motion and gradient, and of long-lived tracks.

    Returns schema `ASPECTS`, sorted by its columns before `n`, with one row for each combination that has an
    observation.
    """
    keys = _Keys({"at": sequence.seen.at}, sequence.seen.axis, FOURTH)
    parts = _of_errors(sequence, keys, np.ones(sequence.observations.height, dtype=bool))
    return check(pl.concat(part.select(*ASPECTS) for part in parts), ASPECTS, "aspects")


def aspect_blocks(sequence: PreparedSequence) -> pl.DataFrame:
    """Moments of every aspect and of the changes of errors, by scene, condition, block, trimming, and age or frame.

    Returns schema `ASPECT_BLOCKS`, sorted by its columns before `n`, with one row for each combination that has an
    error. Pooled over the blocks of a scene they are the scene's moments.
    """
    seen, block = sequence.seen, sequence.block
    by_age = _Keys({"block": block, "at": seen.age}, Axis.age, SECOND)
    changed = _moments(sequence, _changes(sequence, sequence.at_slowest), by_age, Aspect.change)
    by_place = _Keys({"block": block, "at": seen.at}, seen.axis, SECOND)
    parts = (changed, *_of_errors(sequence, by_place, sequence.at_slowest))
    return check(pl.concat(part.select(*ASPECT_BLOCKS) for part in parts), ASPECT_BLOCKS, "blocks of aspects")


def _of_errors(sequence: PreparedSequence, keys: _Keys, chosen: NDArray[np.bool_]) -> Iterator[pl.DataFrame]:
    """Tables of all aspects of errors themselves, in the order of `Aspect`."""
    yield _moments(sequence, _along_gradient(sequence, chosen), keys, Aspect.gradient)
    yield from _long_lived(sequence, keys, chosen)
    yield _moments(sequence, _along_motion(sequence, chosen), keys, Aspect.motion)


def _moments(sequence: PreparedSequence, errors: _Errors, keys: _Keys, aspect: Aspect) -> pl.DataFrame:
    seen, rows = sequence.seen, errors.rows
    values = (seen.condition, *keys.columns.values(), seen.kept)
    cells = measure_cells(errors.error_px, [value[rows] for value in values], orders=keys.orders)
    kept = cells.keys[-1].astype(bool)
    return _table(sequence, keys, cells, np.ones_like(kept), kept, aspect)


def _long_lived(sequence: PreparedSequence, keys: _Keys, chosen: NDArray[np.bool_]) -> Iterator[pl.DataFrame]:
    """Tables of the tracks that reach each age: unions of the cells of tracks that end between two of these ages."""
    seen, rows = sequence.seen, np.flatnonzero(sequence.seen.visible & chosen)
    oldest = np.zeros(sequence.tracks.height, dtype=np.int64)
    np.maximum.at(oldest, sequence.track_row, seen.age)
    reached = np.searchsorted(LONG_LIVED_AGES, oldest, side="right")[sequence.track_row]
    values = (seen.condition, *keys.columns.values(), seen.kept, reached)
    cells = measure_cells(seen.error_px[rows], [value[rows] for value in values], orders=keys.orders)
    for place, age in enumerate(LONG_LIVED_AGES):
        lived = cells.keys[-1] > place
        yield _table(sequence, keys, cells, lived, cells.keys[-2].astype(bool), Aspect.long_lived, at_least=age)


def _table(
    sequence: PreparedSequence,
    keys: _Keys,
    cells: MomentCells,
    chosen: NDArray[np.bool_],
    kept: NDArray[np.bool_],
    aspect: Aspect,
    *,
    at_least: int | None = None,
) -> pl.DataFrame:
    """Moments of an aspect from chosen cells, all and kept."""
    selections = by_trimming(cells, Population.visible, by=1 + len(keys.columns), chosen=chosen, kept=kept)
    table = tabulate(selections, sequence.seen.conditions, names=[*keys.columns], axis=keys.axis)
    return table.with_columns(aspect=pl.lit(aspect, dtype=ASPECT), at_least=pl.lit(at_least, dtype=pl.UInt32))


def _along_motion(sequence: PreparedSequence, chosen: NDArray[np.bool_]) -> _Errors:
    """Visible errors along and across the motion of the true position, where it has a direction."""
    moved = image_motion(sequence, chosen)
    return _Errors(moved.rows, along_and_across(sequence, moved.rows, moved.direction))


def _along_gradient(sequence: PreparedSequence, chosen: NDArray[np.bool_]) -> _Errors:
    """Visible errors along and across the gradient, of tracks that have one."""
    angle = pl.col("gradient_rad").cast(pl.Float64)
    track = sequence.tracks.select(known=angle.is_not_null(), u=angle.cos(), v=angle.sin())
    rows = np.flatnonzero(sequence.seen.visible & chosen & track["known"].to_numpy()[sequence.track_row])
    direction = track.select("u", "v").to_numpy()[sequence.track_row[rows]]
    return _Errors(rows, along_and_across(sequence, rows, direction))


def _changes(sequence: PreparedSequence, chosen: NDArray[np.bool_]) -> _Errors:
    """Changes of visible errors, at the observations at their ends."""
    seen = sequence.seen
    rows = sequence.ordered_where(seen.visible & chosen)
    late, change_px = changes(seen.error_px[rows], sequence.track_row[rows], seen.frame[rows], seen.speed[rows])
    return _Errors(rows[late], change_px)
