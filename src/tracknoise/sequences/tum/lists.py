"""Lists of image files with their times: ``rgb.txt``, ``depth.txt``, or a list of pairs."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_text
from tracknoise.printable import counted
from tracknoise.sequences.timed.order import in_order, order_notes, require_seconds

COLOUR, DEPTH = "rgb.txt", "depth.txt"
PAIRS = ("associations.txt", "associated.txt", "association.txt")
"""Names that lists of pairs have. They are read only where there is no `COLOUR`."""
SEPARATOR = ","
"""What the tools of the benchmark take between fields, besides white space."""

Rows = list[tuple[str, list[str]]]


@dataclass(frozen=True, slots=True, eq=False)
class FileList:
    """Files in order of time.

    Parameters
    ----------
    times_s
        (n,) float64, seconds, increasing.
    files
        One for each.
    notes
        What was corrected, one sentence each.
    """

    times_s: NDArray[np.float64]
    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()


NO_FILES = FileList(np.empty(0), ())


def read_lists(folder: Path) -> tuple[FileList, FileList]:
    """Read which images and depth maps a recording has.

    Returns
    -------
    images, depths : FileList
        There is at least one image; there may be no depth.

    Raises
    ------
    DataError
        If a list is missing or damaged, or holds no image.
    """
    if not (folder / COLOUR).exists():
        pairs = next((folder / name for name in PAIRS if (folder / name).exists()), folder / COLOUR)
        return _read_pairs(pairs)
    depth = folder / DEPTH
    return _read_list(folder / COLOUR), _read_list(depth) if depth.exists() else NO_FILES


def _read_list(path: Path) -> FileList:
    rows = _rows(path, "timestamp filename")
    return _file_list(path, [(place, fields[0], fields[1]) for place, fields in rows])


def _read_pairs(path: Path) -> tuple[FileList, FileList]:
    """The benchmark's script writes colour first, ICL-NUIM depth first: the names of the folders decide."""
    rows = _rows(path, "timestamp filename timestamp filename")
    depth_first = bool(rows) and Path(rows[0][1][1]).parts[0] == "depth"
    first = _file_list(path, [(place, fields[0], fields[1]) for place, fields in rows])
    second = _file_list(path, [(place, fields[2], fields[3]) for place, fields in rows])
    return (second, first) if depth_first else (first, second)


def _rows(path: Path, columns: str) -> Rows:
    """Fields of each row with its place. Blank lines and ``#`` comments are skipped."""
    rows, expected = [], len(columns.split())
    for number, line in enumerate(read_text(path, f"rows of {columns}").splitlines(), start=1):
        fields = line.replace(SEPARATOR, " ").split()
        if not fields or fields[0].startswith("#"):
            continue
        if len(fields) != expected:
            found = counted(len(fields), "field")
            raise DataError(f"{path}:{number}", found, f"{expected} ({columns})")
        rows.append((f"{path}:{number}", fields))
    return rows


def _file_list(path: Path, rows: list[tuple[str, str, str]]) -> FileList:
    if not rows:
        raise DataError(path, "no files", "rows of a timestamp and a file")
    times_s = np.array([_seconds(place, stamp) for place, stamp, _ in rows])
    require_seconds(times_s, [place for place, _, _ in rows])
    order = in_order(times_s)
    files = tuple(path.parent / rows[index][2].replace("\\", "/") for index in order)
    return FileList(times_s[order], files, order_notes(path, times_s))


def _seconds(place: str, stamp: str) -> float:
    try:
        return float(stamp)
    except ValueError as error:
        raise DataError(place, repr(stamp), "a timestamp, seconds") from error
