"""Moments of errors seen in other ways, and of their changes, by blocks of tracks: resampled where scenes are few."""

from collections.abc import Iterator

import polars as pl

from tracknoise.statistics import block_moments
from tracknoise.statistics.aspects import SELECTIONS, aspect_cells
from tracknoise.statistics.block_moments import CELL
from tracknoise.statistics.blocks import with_blocks
from tracknoise.statistics.grouping import group_rows
from tracknoise.statistics.increments import CHANGE, changes_of
from tracknoise.statistics.moments import measure_cells, unite_cells
from tracknoise.statistics.populations import measured
from tracknoise.tables.schema import ASPECT_BLOCKS, OBSERVATIONS, ORIGIN, check

KEYS = ["aspect", *block_moments.KEYS]


def aspect_blocks(observations: pl.DataFrame, tracks: pl.DataFrame, *, axis: str = "age") -> pl.DataFrame:
    """Moments of every aspect, and of the changes of errors, by scene, condition, block, trimming, and age or frame.

    Parameters
    ----------
    observations, tracks, axis
        As in `tracknoise.statistics.aspects.scene_aspects`. Changes are by age whatever the axis.

    Returns
    -------
    polars.DataFrame
        Schema `ASPECT_BLOCKS`, sorted by the columns of `KEYS`: a row for each combination that has an error. Pooled
        over the blocks of a scene they are the scene's moments.

    Raises
    ------
    SchemaError
        If a table has other columns, or a track is not in `tracks`.
    """
    check(observations, OBSERVATIONS, "observations")
    blocked = with_blocks(observations, tracks)
    parts = [
        unite_cells(cells, SELECTIONS, axis=along, by=CELL).with_columns(aspect=pl.lit(aspect))
        for aspect, cells, along in _cells(blocked, tracks, axis)
    ]
    return check(pl.concat(parts).select(*ASPECT_BLOCKS).sort(KEYS), ASPECT_BLOCKS, "blocks of aspects")


def _cells(blocked: pl.DataFrame, tracks: pl.DataFrame, axis: str) -> Iterator[tuple[str, pl.DataFrame, str]]:
    """Each aspect, its moments by block, and what they run along."""
    by = [*CELL, "kept"]
    for aspect, cells in aspect_cells(blocked.with_columns(at=axis), tracks, by=by):
        yield aspect, cells, axis
    seen = measured(blocked, population="visible")
    condition = pl.Series(group_rows(seen, list(ORIGIN)).index)
    yield CHANGE, measure_cells(changes_of(seen.with_columns(condition=condition, at="age")), by=by), "age"
