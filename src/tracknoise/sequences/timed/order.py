"""Rows of a file in the order of their times, each time once."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.printable import counted_of

_LATEST_S = 1e11
"""No clock of seconds shows more: it is more than 3000 years. Stamps in milliseconds or finer do."""


def require_seconds(times_s: NDArray[np.float64], places: Sequence[str]) -> None:
    """Check that times can be seconds.

    Parameters
    ----------
    times_s
        (n,) float64.
    places
        n times ``file:line``.

    Raises
    ------
    DataError
        Naming the first place with NaN, infinity or a number that only a finer unit can have.
    """
    for index in np.flatnonzero(~(np.abs(times_s) <= _LATEST_S))[:1]:
        expected = f"seconds, up to {_LATEST_S:g} (milliseconds and nanoseconds must be converted)"
        raise DataError(places[index], f"a timestamp of {times_s[index]:g}", expected)


def in_order(times: NDArray[np.float64] | NDArray[np.int64]) -> NDArray[np.intp]:
    """(k,) intp: indices of rows in order of time; of rows that have the same time, the first."""
    indices: NDArray[np.intp] = np.unique(times, return_index=True)[1]
    return indices


def order_notes(path: Path, times: NDArray[np.float64] | NDArray[np.int64]) -> tuple[str, ...]:
    """Sentences on rows that `in_order` moves or leaves out.

    Parameters
    ----------
    path
        File of the rows.
    times
        (n,) in the order of the file.
    """
    repeated = len(times) - len(np.unique(times))
    notes = []
    if np.any(np.diff(times) < 0):
        notes.append(f"{path}: the rows are not in order of time, so they were sorted")
    if repeated:
        repeat = counted_of(repeated, len(times), "row", "repeats", "repeat")
        are = "is" if repeated == 1 else "are"
        notes.append(f"{path}: {repeat} the time of an earlier row and {are} ignored")
    return tuple(notes)
