"""Tracks with the largest, middle and smallest errors at an age, to look at."""

from collections.abc import Iterator, Sequence

import polars as pl

from tracknoise.statistics.definitions import PLACE_AGES
from tracknoise.statistics.populations import POPULATIONS
from tracknoise.tables.schema import ORIGIN

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
