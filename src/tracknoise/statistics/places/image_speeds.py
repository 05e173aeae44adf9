"""Errors along and across the image motion, by how fast the image moves.

A clock that is wrong by t shifts true positions by t times the image velocity: such errors lie along the motion, and
grow with its speed. Classes of speed are half octaves, from 2^(k/2) to 2^((k+1)/2) px per frame of the sequence.
"""

import numpy as np
import polars as pl

from tracknoise.statistics.places.image_motion import along_and_across, image_motion
from tracknoise.statistics.places.places import at_place_ages, squares, summed
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.schema import IMAGE_SPEEDS, check

_LOWEST = -40
"""The class of all speeds below 1e-6 px per frame."""


def image_speeds(sequence: PreparedSequence) -> pl.DataFrame:
    """Sums of visible errors by speed of the image, at the lowest speed of play and a few ages.

    Parameters
    ----------
    sequence
        Trimmed.

    Returns
    -------
    polars.DataFrame
        Schema `IMAGE_SPEEDS`, sorted by its columns before n, with one row for each combination that has an error.
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
    return check(
        table.select(pl.col(name).cast(kind) for name, kind in IMAGE_SPEEDS.items()), IMAGE_SPEEDS, "image speeds"
    )
