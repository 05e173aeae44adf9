"""Tables of tracks: CSV files with a header, and Parquet files."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.child import call_in_child
from tracknoise.foreign.files import MIB, require_regular
from tracknoise.foreign.parsing import damage_reported
from tracknoise.tables.schema import QUALITY_NAME, QUALITY_PREFIX
from tracknoise.trackers.imports.rows import Rows
from tracknoise.trackers.quality import is_quality_name

_COLUMNS: dict[str, type[pl.DataType]] = {"track": pl.Int64, "frame": pl.Int64, "u_px": pl.Float64, "v_px": pl.Float64}
_SYNONYMS: Mapping[str, tuple[str, ...]] = {
    "track": ("track_id", "feature_id", "point_id", "feature", "id"),
    "frame": ("frame_id", "frame_index", "frame_number", "image_id", "image_index"),
    "u_px": ("u", "x", "x_px"),
    "v_px": ("v", "y", "y_px"),
}
"""Other names of columns, for files that lack the first; ``id`` comes last, as it may count rows. Upper and lower case
are the same."""
_NO_NUMBER = ("", "nan", "null", "none", "na")
_TIMES = ("time_s", "time", "timestamp")
"""Columns that can replace ``frame``."""
_COVARIANCE = ("cov_uu", "cov_uv", "cov_vv")
"""Columns that are kept as if their names started with `QUALITY_PREFIX`."""
_RESPONSE = "response"
_USED = {*_COLUMNS, *_TIMES, *_COVARIANCE, _RESPONSE}
_LEAST_NANOSECONDS = 1e14
"""Whole timestamps from here on are nanoseconds: as seconds they would be 3 million years."""
_MOST_NANOSECONDS = 4.1e18
_SEPARATORS = ",;\t"
_MOST_BYTES, _MOST_ROWS, _MOST_COLUMNS = 4096 * MIB, 1 << 20, 1000


def read_table(path: Path) -> Rows:
    """Read a CSV file with a header, or a Parquet file; see `tracknoise.trackers.imported.Imported`.

    Rows without a position, such as blank lines, are frames in which the track was not observed.

    Raises
    ------
    DataError
        If it is missing or damaged, lacks a column, holds no row, or something that is not a number. The error names
        the file and, where it has one, the line or row.
    """
    observed = _Observed.of(path, _read(path))
    if observed.table.is_empty():
        raise DataError(path, "no track", "at least one row")
    return Rows(
        path,
        observed.numbers("track", pl.Int64),
        np.column_stack([observed.numbers(name, pl.Float64) for name in ("u_px", "v_px")]),
        **_when(observed),
        line=observed.line,
        has_lines=observed.has_lines,
        response=_optional(observed, _RESPONSE) if _RESPONSE in observed.table.columns else None,
        quality=_quality(observed),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Observed:
    """The rows of a table that have a position, and their lines or numbers in the file."""

    path: Path
    table: pl.DataFrame
    line: NDArray[np.int64]

    @classmethod
    def of(cls, path: Path, table: pl.DataFrame) -> "_Observed":
        first = 2 if path.suffix == ".csv" else 1
        empty = [_is_empty(table[name]) for name in ("u_px", "v_px")]
        there = ~(empty[0] & empty[1])
        return cls(path, table.filter(there), first + np.flatnonzero(there.to_numpy()))

    @property
    def has_lines(self) -> bool:
        return self.path.suffix == ".csv"

    def numbers(self, name: str, kind: type[pl.DataType], *, optional: bool = False) -> NDArray[Any]:
        """The finite numbers of a column, NaN where they may be missing; an error shows the first that is none."""
        column = self.table[name]
        text = _stripped(column)
        cast = _whole(text) if kind is pl.Int64 else text.cast(kind, strict=False)
        bad = cast.is_null() if kind is pl.Int64 else ~cast.is_finite().fill_null(value=False)
        self.refuse((bad & column.is_not_null()).to_numpy() if optional else bad.to_numpy(), name, _expected(kind))
        return cast.fill_null(np.nan).to_numpy() if optional else cast.to_numpy()

    def refuse(self, bad: NDArray[np.bool_], name: str, expected: str) -> None:
        rows = np.flatnonzero(bad)
        if len(rows):
            row = int(rows[0])
            place = f"{self.path}:{self.line[row]}" if self.has_lines else f"{self.path}: row {self.line[row]}"
            raise DataError(place, f"{name} {self.table[name][row]!r}", expected)


def _is_empty(column: pl.Series) -> pl.Series:
    """Whether cells are empty, or say that there is no number."""
    if column.dtype == pl.String:
        return column.str.strip_chars().str.to_lowercase().is_in(_NO_NUMBER).fill_null(value=True)
    return column.is_null() | (column.is_nan() if column.dtype.is_float() else False)


def _when(observed: _Observed) -> dict[str, NDArray[Any]]:
    """The frames or times, by the name that `Rows` has for them. Whole numbers of 15 digits or more are nanoseconds."""
    if "frame" in observed.table.columns:
        return {"frame": observed.numbers("frame", pl.Int64)}
    name = next(name for name in _TIMES if name in observed.table.columns)
    seconds = observed.numbers(name, pl.Float64)
    whole = _whole(_stripped(observed.table[name]))
    if name == "time_s" or whole.null_count() or np.abs(seconds).min() < _LEAST_NANOSECONDS:
        return {"time_s": seconds}
    observed.refuse(np.abs(seconds) > _MOST_NANOSECONDS, name, "a time before the year 2100")
    return {"time_ns": whole.to_numpy()}


def _quality(observed: _Observed) -> dict[str, NDArray[np.float32]]:
    """The columns ``quality_<name>`` and the covariance, by name."""
    columns = [column for column in observed.table.columns if column.startswith(QUALITY_PREFIX)]
    for column in columns:
        if not is_quality_name(column.removeprefix(QUALITY_PREFIX)):
            raise DataError(observed.path, f"column {column}", f"a name of the form {QUALITY_PREFIX}{QUALITY_NAME}")
    columns += [column for column in _COVARIANCE if column in observed.table.columns]
    return {column.removeprefix(QUALITY_PREFIX): _optional(observed, column) for column in columns}


def _optional(observed: _Observed, name: str) -> NDArray[np.float32]:
    """The numbers of a column that may have empty cells, NaN there."""
    values = observed.numbers(name, pl.Float64, optional=True)
    observed.refuse(np.abs(values) > np.finfo(np.float32).max, name, "a number within the range of float32")
    narrow: NDArray[np.float32] = values.astype(np.float32)
    return narrow


def _read(path: Path) -> pl.DataFrame:
    """The columns that are used, without spaces around their names.

    Polars ends the whole process on some damaged files, and panics on others. Therefore a child process reads them.
    """
    expected = f"a {path.suffix} file of tracks"
    size = require_regular(path, "a file of tracks", most=_MOST_BYTES)
    with damage_reported(path, "not readable", expected, with_reason=True):
        return call_in_child(_read_parquet if path.suffix == ".parquet" else _read_csv, path, size, size=size)


def _read_csv(path: Path, size: int) -> pl.DataFrame:
    """All columns are read as text, so that errors can show the cell. The header shows what separates them."""
    with path.open("rb") as file:
        header = file.readline(MIB).decode(errors="replace")
    if "\0" in header:
        raise DataError(path, "null characters in line 1", "a .csv file of tracks in UTF-8, not UTF-16")
    separator = max(_SEPARATORS, key=header.count)
    columns = header.count(separator) + 1
    if columns > _MOST_COLUMNS:
        raise DataError(path, f"{columns} columns", f"at most {_MOST_COLUMNS}")
    table = pl.read_csv(path, infer_schema=False, glob=False, separator=separator).rename(_plain_name)
    table = table.rename(_known_names(table.columns))
    _require_columns(path, table.schema)
    return table.select(_used(table.columns))


def _plain_name(column: str) -> str:
    """The name of a column without spaces, quotes, and the ``#`` with which NumPy begins a header."""
    return column.strip().removeprefix("#").strip(' "')


def _known_names(columns: Iterable[str]) -> dict[str, str]:
    """New names of the columns that have another one of `_SYNONYMS`."""
    found = {column.lower(): column for column in reversed([*columns])}
    renamed = {}
    for name, others in _SYNONYMS.items():
        used = next((found[other] for other in (name, *others) if other in found), name)
        if used != name:
            renamed[used] = name
    return renamed


def _read_parquet(path: Path, size: int) -> pl.DataFrame:
    """The number of rows is limited by the size of the file: a column of one repeated value takes almost no space."""
    file = pl.scan_parquet(path, glob=False).rename(str.strip)
    file = file.rename(_known_names(file.collect_schema()))
    _require_columns(path, file.collect_schema())
    rows = file.select(pl.len()).collect().item()
    if rows > max(_MOST_ROWS, size):
        raise DataError(path, f"{rows} rows in {size} bytes", "at most one row per byte")
    return file.select(_used(file.collect_schema())).collect()


def _require_columns(path: Path, columns: pl.Schema) -> None:
    """Check that the columns that are needed are there, and that all that are used may contain numbers."""
    has_time = any(name in columns for name in _TIMES)
    missing = [name for name in _COLUMNS if name not in columns and not (name == "frame" and has_time)]
    if missing:
        raise DataError(path, f"no column {', '.join(missing)} among {', '.join(columns)}", ", ".join(_COLUMNS))
    for name, dtype in columns.items():
        if _is_used(name) and not (dtype.is_integer() or dtype.is_float() or dtype in (pl.String, pl.Null)):
            raise DataError(path, f"column {name} of type {dtype}", f"{_expected(_COLUMNS.get(name))} in each row")


def _used(columns: Iterable[str]) -> list[str]:
    return [column for column in columns if _is_used(column)]


def _is_used(column: str) -> bool:
    return column in _USED or column.startswith(QUALITY_PREFIX)


def _expected(kind: type[pl.DataType] | None) -> str:
    return f"a {'whole ' if kind is pl.Int64 else 'finite '}number"


def _stripped(column: pl.Series) -> pl.Series:
    return column.str.strip_chars() if column.dtype == pl.String else column


def _whole(text: pl.Series) -> pl.Series:
    """Whole numbers, also those written as ``7.0``; null where there is none. Long ones are not rounded to floats."""
    number = text.cast(pl.Float64, strict=False)
    truncated = text.cast(pl.Int64, strict=False).fill_null(number.cast(pl.Int64, strict=False))
    return truncated.set(truncated != number, None)
