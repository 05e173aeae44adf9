"""Moments of du, dv by blocks of tracks: what is resampled where scenes are too few to be."""

from collections.abc import Sequence

import polars as pl

from tracknoise.statistics.blocks import with_blocks
from tracknoise.statistics.moments import measure_cells, unite_cells
from tracknoise.statistics.populations import measured
from tracknoise.tables.schema import BLOCKS, OBSERVATIONS, ORIGIN, check

KEYS = [*ORIGIN, "block", "population", "trimming", "axis", "at"]
CELL = [*ORIGIN, "block", "at"]


def block_moments(
    observations: pl.DataFrame, tracks: pl.DataFrame, *, axis: str = "age", populations: Sequence[str] = ("visible",)
) -> pl.DataFrame:
    """Moments of the errors of every scene, condition and block of tracks, by trimming, and age or frame.

    Parameters
    ----------
    observations
        An observations table of any number of scenes, trimmed (`tracknoise.statistics.trimming.trim`).
    tracks
        All tracks of these scenes and conditions.
    axis
        ``age`` or ``frame``, as in `tracknoise.statistics.moments.scene_moments`.
    populations
        Which observations: any of `visible` and `projected`.

    Returns
    -------
    polars.DataFrame
        Schema `BLOCKS`, sorted by the columns of `KEYS`: a row for each combination that has an observation. Pooled
        over the blocks of a scene they are the scene's moments.

    Raises
    ------
    SchemaError
        If the table has other columns, an error is missing where the true position is known, or a track is not in
        `tracks`.
    """
    check(observations, OBSERVATIONS, "observations")
    parts = [_of_population(observations, tracks, axis, population) for population in populations]
    return check(pl.concat(parts).select(*BLOCKS).sort(KEYS), BLOCKS, "blocks")


def _of_population(observations: pl.DataFrame, tracks: pl.DataFrame, axis: str, population: str) -> pl.DataFrame:
    known = measured(observations, population=population)
    cells = measure_cells(with_blocks(known.with_columns(at=axis), tracks), by=[*CELL, "kept"])
    selections = {(population, "untrimmed"): pl.lit(value=True), (population, "trimmed"): pl.col("kept")}
    return unite_cells(cells, selections, axis=axis, by=CELL)
