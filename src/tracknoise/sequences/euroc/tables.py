"""The ``data.csv`` files of the ASL layout: a time in nanoseconds in the first column, names in a header or none."""

import re
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_text
from tracknoise.printable import counted

_NUMBER = re.compile(r"[0-9]{1,19}(?:\.[0-9]{0,30})?(?:[eE]\+?[0-9]{1,2})?")
_LARGEST_NS = 2**63 - 1
_POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
_USUAL = (1, 2, 3, 5, 6, 7, 4)
"""Columns of `_POSE` where a header does not name them: the scalar of the quaternion is first."""
_COLUMN = re.compile(
    r"(?:(?:.*\.)?(?:p|t|pos|position|translation)(?:_?[A-Z]+)*[_.]?)?(?P<p>[xyz])\s*(?:\[.*\])?"
    r"|(?:.*\.)?(?:q|quat|quaternion|rot|rotation|orientation)(?:_?[A-Z]+)*[_.]?(?P<q>[wxyz])\s*(?:\[.*\])?"
)
"""Names of columns of a pose: ``p_RS_R_x [m]``, ``tx``, ``x``; ``q_RS_w []``, ``qw``, ``rotation.w``."""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Rows of one file.

    Parameters
    ----------
    path
        The file.
    header
        Names of the columns; empty where there are none.
    times_ns
        (n,) int64, nanoseconds, in the order of the file.
    rows
        All fields of each row.
    places
        ``file:line`` of each row.
    """

    path: Path
    header: list[str]
    times_ns: NDArray[np.int64]
    rows: list[list[str]]
    places: list[str]


def read_table(path: Path, columns: str) -> Table:
    """Read a file of comma-separated values. Blank lines and ``#`` comments are skipped; the first may be the header.

    Parameters
    ----------
    path
        The file.
    columns
        What its rows hold, for the error.

    Raises
    ------
    DataError
        If it is missing or has no rows, or a row does not begin with a whole number of nanoseconds.
    """
    header: list[str] = []
    rows: list[list[str]] = []
    times, places = [], []
    for number, line in enumerate(read_text(path, f"rows of {columns}").splitlines(), start=1):
        fields = [field.strip() for field in line.split(",")]
        if line.lstrip().startswith("#") or (not rows and not header and _is_text(fields[0])):
            header = header or [field.lstrip("# ") for field in fields]
        elif line.strip():
            places.append(f"{path}:{number}")
            times.append(_nanoseconds(places[-1], fields[0]))
            rows.append(fields)
    if not rows:
        raise DataError(path, "no rows", f"rows of {columns}")
    return Table(path, header, np.array(times, dtype=np.int64), rows, places)


def file_names(table: Table) -> list[str]:
    """The second column of a list of images.

    Raises
    ------
    DataError
        Naming the first row without it.
    """
    for place, row in zip(table.places, table.rows, strict=True):
        if len(row) < 2 or not row[1]:
            raise DataError(place, "no name of a file", "a time and the name of an image")
    return [row[1] for row in table.rows]


def pose_rows(table: Table) -> NDArray[np.float64]:
    """Positions and quaternions, scalar last, (n, 7) float64: by the names of the columns, else ``p xyz, q wxyz``.

    Raises
    ------
    DataError
        If there are positions only, or names of a part of the columns that leave no room for the others, or naming the
        first row with too few fields or one that is not a number.
    """
    columns = _pose_columns(table.header)
    if len({*columns}) < len(columns):
        raise DataError(table.path, "names of a part of the columns of the pose", f"{', '.join(_POSE)}, or no names")
    if len(table.rows[0]) <= max(_USUAL) and len(table.rows[0]) <= max(columns):
        raise DataError(table.places[0], counted(len(table.rows[0]), "field"), "a time, a position and a quaternion")
    pairs = zip(table.places, table.rows, strict=True)
    return np.array([[_number(place, row, column) for column in columns] for place, row in pairs])


def _pose_columns(header: list[str]) -> tuple[int, ...]:
    """Columns of `_POSE`: positions and quaternions by their names, each where all of their names are there."""
    found: dict[str, int] = {}
    for column, name in enumerate(header):
        match = _COLUMN.fullmatch(name)
        if match and match.lastgroup:
            found.setdefault(match.lastgroup + match[match.lastgroup], column)
    named = {kind: all(name in found for name in _POSE if name[0] == kind) for kind in "pq"}
    pairs = zip(_POSE, _USUAL, strict=True)
    return tuple(found[name] if named[name[0]] else usual for name, usual in pairs)


def _is_text(field: str) -> bool:
    """Whether a field is a name and not a number."""
    return bool(re.match(r"[A-Za-z\"]", field)) and field.lower() not in ("nan", "inf", "infinity")


def _nanoseconds(place: str, field: str) -> int:
    """A whole number, which may be written with a point or a power of ten: 1403636579763555584.0 or 1.4e18."""
    time = Decimal(field) if _NUMBER.fullmatch(field) else Decimal(-1)
    if not 0 <= time <= _LARGEST_NS or time != int(time):
        raise DataError(place, f"a time of {field!r}", "a whole number of nanoseconds")
    return int(time)


def _number(place: str, row: list[str], column: int) -> float:
    try:
        return float(row[column])
    except (ValueError, IndexError) as error:
        found = repr(row[column]) if column < len(row) else counted(len(row), "field")
        raise DataError(place, found, "a number in each column of the pose") from error
