"""Tracks of XIVO: what its script ``pyxivo_tracker_only.py`` writes in the mode ``dumpTracker``.

Each line has the time of the image in nanoseconds, the id of the feature, u, v, and its descriptor. Commas separate
them, and there is no header. The format is that of ``TrackerDumpModeSaver`` in ``scripts/savers.py`` of
https://github.com/ucla-vision/xivo.
"""

from pathlib import Path

import numpy as np

from tracknoise.trackers.imports.numbers_file import read_numbers, whole_numbers
from tracknoise.trackers.imports.rows import Rows


def read_xivo(path: Path) -> Rows:
    """Read a dump of XIVO's tracker. Descriptors are ignored.

    Raises
    ------
    DataError
        If the file is missing or a line is not of this form. The error names the line.
    """
    values, lines = read_numbers(path, ",", ("timestamp", "id", "u", "v"))
    track = whole_numbers(path, lines, values[:, 1], "id")
    time_ns = whole_numbers(path, lines, np.rint(values[:, 0]), "timestamp")
    return Rows(path, track, values[:, 2:4].copy(), time_ns=time_ns, line=np.array(lines))
