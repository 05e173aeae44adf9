"""Tracks of event cameras: text with ``id t x y`` in each line, as the evaluation of RPG's event trackers reads it."""

from pathlib import Path

import numpy as np

from tracknoise.trackers.imports.numbers_file import read_numbers, whole_numbers
from tracknoise.trackers.imports.rows import Rows


def read_events(path: Path) -> Rows:
    """Read lines with the number of a track, a time in seconds, u and v, separated by white space.

    Raises
    ------
    DataError
        If the file is missing or a line is not of this form. The error names the line.
    """
    values, lines = read_numbers(path, None, ("id", "t", "x", "y"))
    track = whole_numbers(path, lines, values[:, 0], "id")
    return Rows(path, track, values[:, 2:].copy(), time_s=values[:, 1].copy(), line=np.array(lines))
