"""Errors by cell of the image.

The image is divided into `MAP_COLUMNS` x `MAP_ROWS` cells of equal size. The cell of an observation is that of its true
position. Images of any size have the same cells, so that scenes add up.
"""

import numpy as np
import polars as pl

from tracknoise.statistics.definitions import MAP_COLUMNS, MAP_ROWS
from tracknoise.statistics.places.places import at_place_ages, products, summed
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.schema import IMAGE_MAP, check


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
    true_px = sequence.observations.select("u_true_px", "v_true_px").to_numpy()[rows]
    cells = (true_px + 0.5) / (width, height) * (MAP_COLUMNS, MAP_ROWS)
    column, row = np.clip(cells.astype(np.intp), 0, (MAP_COLUMNS - 1, MAP_ROWS - 1)).T
    table = summed(sequence, rows, {"column": column, "row": row}, products(sequence.seen.error_px[rows]))
    return check(table.select(pl.col(name).cast(kind) for name, kind in IMAGE_MAP.items()), IMAGE_MAP, "image map")
