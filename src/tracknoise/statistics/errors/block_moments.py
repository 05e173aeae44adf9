"""Moments of du, dv by blocks of tracks, to be resampled where there are too few scenes."""

import numpy as np
import polars as pl

from tracknoise.statistics.errors.moment_cells import SECOND, MomentCells, by_trimming, measure_cells, tabulate
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.schema import BLOCKS, check


def block_moments(sequence: PreparedSequence) -> pl.DataFrame:
    """Moments of the errors of every scene, condition and block of tracks, by trimming, and age or frame.

    Parameters
    ----------
    sequence
        Trimmed. Its `populations` are those that the table has.

    Returns
    -------
    polars.DataFrame
        Schema `BLOCKS`, sorted by its columns before `n`, with one row for each combination that has an observation.
        Pooled over the blocks of a scene they are the scene's moments.
    """
    selections: dict[tuple[str, str], MomentCells] = {}
    for population in sequence.populations:
        selections |= _of_population(sequence, population)
    table = tabulate(selections, sequence.seen.conditions, names=["block", "at"], axis=sequence.seen.axis)
    return check(table.select(*BLOCKS), BLOCKS, "blocks")


def _of_population(sequence: PreparedSequence, population: str) -> dict[tuple[str, str], MomentCells]:
    seen = sequence.seen
    chosen = seen.members(population)
    keys = (seen.condition, sequence.block, seen.at, seen.kept)
    cells = measure_cells(seen.error_px[chosen], [key[chosen] for key in keys], orders=SECOND)
    kept = cells.keys[-1].astype(bool)
    return by_trimming(cells, population, by=3, chosen=np.ones_like(kept), kept=kept)
