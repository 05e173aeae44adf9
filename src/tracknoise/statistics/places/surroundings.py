"""Errors by what surrounds a feature: its depth, the nearest depth edge, the slope it lies on, and its parallax.

A feature beside a depth edge has two surfaces in its window. A tracker that follows a mixture of both is drawn along by
the other surface. Features on the far side are also those that become occluded.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.definitions import EDGE_BOUNDS_PX, INCIDENCE_STEP_DEG
from tracknoise.statistics.places.image_motion import along_and_across, image_motion
from tracknoise.statistics.places.parallax import parallax_px
from tracknoise.statistics.places.places import at_place_ages, products, squares, summed
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import EdgeSide, Occlusion, Surrounding
from tracknoise.tables.schema import OCCLUSION, SURROUNDING, SURROUNDINGS, check

_SIGNED_BOUNDS_PX = (*(-bound for bound in reversed(EDGE_BOUNDS_PX[1:])), *EDGE_BOUNDS_PX)


@dataclass(frozen=True, slots=True)
class _Classes:
    """Classes of observations by one property.

    Attributes
    ----------
    surrounding
        The property.
    number : (n,) intp
        Class of each of the rows; -1 where it has none.
    low, high
        Bounds of each class; None where it has none.
    """

    surrounding: Surrounding
    number: NDArray[np.intp]
    low: list[float | None]
    high: list[float | None]


def surroundings(sequence: PreparedSequence) -> pl.DataFrame:
    """Sums of errors by class of each property, at the lowest speed and a few ages.

    Parameters
    ----------
    sequence
        Trimmed.

    Returns
    -------
    polars.DataFrame
        Schema `SURROUNDINGS`, sorted by its columns before n, with one row for each combination that has an error. A
        property that is unknown of all tracks has no rows.
    """
    occlusion = _occlusion(sequence)
    rows = np.flatnonzero(at_place_ages(sequence) & (occlusion >= 0))
    values = {**products(sequence.seen.error_px[rows]), **_directed(sequence, rows)}
    parts = [_of_classes(sequence, classes, rows, occlusion[rows], values) for classes in _classes(sequence, rows)]
    keys = list(SURROUNDINGS)[: list(SURROUNDINGS).index("n")]
    return check(pl.concat(parts).sort(keys), SURROUNDINGS, "surroundings")


def _of_classes(
    sequence: PreparedSequence,
    classes: _Classes,
    rows: NDArray[np.intp],
    occlusion: NDArray[np.intp],
    values: dict[str, NDArray[np.float64]],
) -> pl.DataFrame:
    known = classes.number >= 0
    keys = {"class": classes.number[known], "occlusion": occlusion[known]}
    table = summed(sequence, rows[known], keys, {name: value[known] for name, value in values.items()})
    place = table["class"].to_numpy()
    table = table.with_columns(
        pl.lit(classes.surrounding, dtype=SURROUNDING).alias("surrounding"),
        pl.Series("low", classes.low, dtype=pl.Float64).gather(place),
        pl.Series("high", classes.high, dtype=pl.Float64).gather(place),
        pl.Series("occlusion", list(Occlusion), dtype=OCCLUSION).gather(table["occlusion"].to_numpy()),
    )
    return table.select(pl.col(name).cast(kind) for name, kind in SURROUNDINGS.items())


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
    known = depth_m > 0.0
    octave = np.floor(2.0 * np.log2(np.where(known, depth_m, 1.0))).astype(np.intp)
    first = int(octave.min(initial=0))
    bounds = [2.0 ** (k / 2.0) for k in range(first, int(octave.max(initial=0)) + 2)]
    return _Classes(Surrounding.depth, np.where(known, octave - first, -1), [*bounds[:-1]], [*bounds[1:]])


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
    known = ~np.isnan(parallax)
    octave = np.floor(np.log2(np.maximum(np.where(known, parallax, 0.0), 0.5))).astype(np.intp) + 1
    bounds = [0.0, *(2.0**k for k in range(int(octave.max(initial=0)) + 1))]
    return _Classes(Surrounding.parallax, np.where(known, octave, -1), [*bounds[:-1]], [*bounds[1:]])


def _by_incidence(incidence: pl.Series) -> _Classes:
    incidence_deg = incidence.cast(pl.Float64).to_numpy()
    bounds = [float(bound) for bound in range(0, 91, INCIDENCE_STEP_DEG)]
    known = ~np.isnan(incidence_deg)
    number = np.minimum(np.where(known, incidence_deg, 0.0) // INCIDENCE_STEP_DEG, len(bounds) - 2).astype(np.intp)
    return _Classes(Surrounding.incidence, np.where(known, number, -1), [*bounds[:-1]], [*bounds[1:]])
