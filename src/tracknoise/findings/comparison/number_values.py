"""Numbers of two runs that every scene has on its own, paired by scene, from tables of the numbers."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.comparison.paired_values import PairedValues, paired

NUMBERS = {"scene": pl.String, "at": pl.Int64, "value": pl.Float64}
"""Columns of a table of numbers: null where a scene has none. `at` is null for single numbers."""


def number_values(
    first: pl.DataFrame, second: pl.DataFrame, scenes: Sequence[str], *, logarithms: bool
) -> PairedValues:
    """Changes of numbers, at every place that both runs have.

    Parameters
    ----------
    first, second
        Columns of `NUMBERS`, one row per scene and place.
    scenes
        Names of all scenes, in the order of the result.
    logarithms
        Whether logarithms are compared.
    """
    known, other = (table["at"].drop_nulls().unique().to_numpy() for table in (first, second))
    places = np.intersect1d(known, other).astype(np.int64)
    placed = bool(len(known) or len(other))
    with np.errstate(divide="ignore"):
        values = [_levels(table, places if placed else None, scenes) for table in (first, second)]
        before, after = (np.log(array) if logarithms else array for array in values)
    measured = np.stack([np.isin(scenes, table["scene"].to_numpy()) for table in (first, second)], axis=1)
    return paired((before, after), measured, places, logarithms=logarithms)


def _levels(table: pl.DataFrame, places: NDArray[np.int64] | None, scenes: Sequence[str]) -> NDArray[np.float64]:
    """Values (scenes, places), or (scenes, 1) of single numbers, which have no places; NaN where there are none."""
    values = np.full((len(scenes), 1 if places is None else max(len(places), 1)), np.nan)
    rows = table if places is None else table.filter(pl.col("at").is_in(places.tolist()))
    scene = rows["scene"].cast(pl.Enum(scenes)).to_physical().to_numpy().astype(np.intp)
    at = np.zeros(rows.height, dtype=np.intp) if places is None else np.searchsorted(places, rows["at"].to_numpy())
    values[scene, at] = rows["value"].cast(pl.Float64).fill_null(np.nan).to_numpy()
    return values
