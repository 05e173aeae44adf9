"""Moments of du, dv by age or frame, measured from the observations of a scene.

All other statistics of errors are computed from these tables. Scenes can therefore be pooled, resampled and added later
without reading the observations again.
"""

import numpy as np
import polars as pl

from tracknoise.statistics.errors.moment_cells import by_trimming, measure_cells, tabulate
from tracknoise.statistics.prepared import PreparedObservations
from tracknoise.tables.enumerations import Population
from tracknoise.tables.schema import MOMENTS, check


def scene_moments(seen: PreparedObservations) -> pl.DataFrame:
    """Moments of the errors of every scene and condition, by population, trimming, and age or frame.

    Parameters
    ----------
    seen
        Observations of any number of scenes, trimmed.

    Returns
    -------
    polars.DataFrame
        Schema `MOMENTS`, sorted by its columns before `n`, with one row for each combination that has an observation.
        `untrimmed` counts every observation, `trimmed` those of tracks that were kept.
    """
    known = seen.projected
    keys = (seen.condition, seen.at, seen.visible, seen.kept)
    cells = measure_cells(seen.error_px[known], [key[known] for key in keys])
    visible, kept = (key.astype(bool) for key in cells.keys[2:])
    selections = {
        **by_trimming(cells, Population.visible, by=2, chosen=visible, kept=kept),
        **by_trimming(cells, Population.projected, by=2, chosen=np.ones_like(kept), kept=kept),
    }
    table = tabulate(selections, seen.conditions, names=["at"], axis=seen.axis)
    return check(table.select(*MOMENTS), MOMENTS, "moments")
