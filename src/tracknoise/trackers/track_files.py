"""Files of tracks that other front ends write, and how a file shows its format.

- Text files with one row of numbers per observation.
- Tracks of event cameras: text with ``id t x y`` in each line, as the evaluation of RPG's event trackers reads it.
- Tracks of XIVO: what its script ``pyxivo_tracker_only.py`` writes in the mode ``dumpTracker``. Each line has the time
  of the image in nanoseconds, the id of the feature, u, v, and its descriptor. Commas separate them, and there is no
  header. The format is that of ``TrackerDumpModeSaver`` in ``scripts/savers.py`` of
  https://github.com/ucla-vision/xivo.
- Tables of tracks: CSV files with a header, and Parquet files.
- Tracks of models that track any point (TAP): NumPy archives with the positions of all points in all frames.
- Tracks from a COLMAP database: keypoints, chained over consecutive images by verified matches. Tables and encodings:
  https://colmap.github.io/database.html.

Tracks in bags are read by `tracknoise.trackers.bag_tracks`.
"""

import codecs
import csv
import sqlite3
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, one_line
from tracknoise.foreign_files import MIB, damage_reported, is_number, natural_order, number_in, require_regular
from tracknoise.parsing_child import call_in_child
from tracknoise.tables.schema import QUALITY_NAME, QUALITY_PREFIX
from tracknoise.text import counted
from tracknoise.time_units import TimeUnit
from tracknoise.trackers.image_names import is_image_name
from tracknoise.trackers.imported_rows import IN_FLOAT32, LARGEST, PixelOrigin, Rows, whole_numbers
from tracknoise.trackers.track_columns import (
    IMAGES,
    PLAIN,
    TIMES,
    Moment,
    Selection,
    has_meaning,
    key,
    known_name,
    meant,
    renamed,
    unused_notes,
)
from tracknoise.trackers.tracker import is_quality_name

_MOST_BYTES = 4096 * MIB
_LONGEST_LINE = 1 << 16
_LARGEST_TIME = 2**62
_COMPRESSED = {b"\x1f\x8b": "gzip", b"PK\x03\x04": "zip"}
"""How files begin that programs compress, and what they are."""


def read_numbers(path: Path, separator: str | None, names: tuple[str, ...]) -> "_Numbers":
    """The first numbers of each line, without empty lines and comments that start with ``#``.

    `separator`: None for white space. `names`: of the columns that are read, for errors.
    """
    require_regular(path, "a file of tracks", most=_MOST_BYTES)
    values, lines, more = array("d"), [], _More()
    try:
        _require_text(path)
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            for line, text in _lines(path, file):
                cells = text.split(separator, len(names))
                values.extend(_numbers(f"{path}:{line}", cells, names))
                lines.append(line)
                more.add("".join(cells[len(names) :]), separator)
    except OSError as error:
        raise DataError(path, f"unreadable ({error.strerror})", "a file of tracks") from error
    if not lines:
        raise DataError(path, "no track", "at least one row")
    return _Numbers(np.array(values).reshape(-1, len(names)), lines, more)


@dataclass(slots=True)
class _More:
    """Columns without a name behind those that are read: how many, and which of them have had no cell but 0 and 1."""

    count: int = 0
    flags: dict[int, set[str]] = field(default_factory=dict)

    def add(self, rest: str, separator: str | None) -> None:
        """Take what follows in a line. A descriptor, which has many columns, is not looked at."""
        if not rest or self.count >= _LEAST_DESCRIPTOR:
            return
        cells = rest.split(separator)
        if not self.count:
            self.flags = {place: set() for place in range(len(cells))}
        self.count = max(self.count, len(cells))
        for place in [place for place in self.flags if place < len(cells)]:
            flags = {"0", "1"} & {cells[place].strip().removesuffix(".0")}
            if flags:
                self.flags[place] |= flags
            else:
                del self.flags[place]

    def notes(self, path: Path, first: int, header: str) -> tuple[str, ...]:
        """A sentence about columns without a name; refuses one that seems to say which features were seen."""
        if not 0 < self.count < _LEAST_DESCRIPTOR:
            return ()
        flag = next((place for place, values in self.flags.items() if len(values) > 1), None)
        if flag is not None:
            found = f"column {first + flag + 1} without a name, of 0 and 1"
            raise DataError(path, found, f"a first line that names all columns, such as: {header}")
        return unused_notes(path, [f"number {first + place + 1}" for place in range(self.count)])


@dataclass(frozen=True, slots=True, eq=False)
class _Numbers:
    """The numbers of a text file."""

    values: NDArray[np.float64]  # (n, columns): finite
    lines: list[int]  # (n,): the line of each row
    more: _More  # columns behind these


def _lines(path: Path, file: TextIO) -> Iterator[tuple[int, str]]:
    """Lines that are neither empty nor comments, with their numbers. A long line is not read as a whole at first."""
    number = 0
    while text := file.readline(_LONGEST_LINE):
        number += 1
        if len(text) == _LONGEST_LINE:
            raise DataError(f"{path}:{number}", f"a line of {_LONGEST_LINE} characters or more", "a shorter line")
        text = text.strip()
        if text and not text.startswith("#"):
            yield number, text


def _numbers(place: str, cells: list[str], names: tuple[str, ...]) -> list[float]:
    if len(cells) < len(names):
        raise DataError(place, counted(len(cells), "column"), f"at least {len(names)}: {', '.join(names)}")
    return [_number(place, cell, name) for cell, name in zip(cells, names, strict=False)]


def _number(place: str, cell: str, name: str) -> float:
    value = number_in(cell)
    if not np.isfinite(value):
        raise DataError(place, f"{name} {one_line(cell)!r}", "a finite number")
    return value


_EVENTS, _XIVO = ("id", "t", "x", "y"), ("timestamp", "id", "u", "v")


def read_events(path: Path, chosen: Selection) -> Rows:
    """Read lines with the number of a track, a time in seconds, u and v, separated by white space.

    A first line or comment that names the columns may give them another order, and further ones.
    """
    names, is_row = _named_columns(path)
    if names and (is_row or not _are_events(names)):
        return _rows(path, _split_table(path, names), chosen)
    numbers = read_numbers(path, None, _EVENTS)
    track = whole_numbers(lambda row: f"{path}:{numbers.lines[row]}", numbers.values[:, 0], "id")
    time_s = numbers.values[:, 1] / (chosen.time_unit or TimeUnit.s).per_second
    notes = numbers.more.notes(path, len(_EVENTS), "# id t x y visible")
    return Rows(path, track, numbers.values[:, 2:].copy(), time_s=time_s, line=np.array(numbers.lines), notes=notes)


def _are_events(names: tuple[str, ...]) -> bool:
    """Whether columns are those of events in their order, and their times in seconds."""
    columns = [known_name(name) for name in names]
    return (
        len(columns) == len(_EVENTS)
        and columns[0::2] == ["track", "u_px"]
        and columns[3] == "v_px"
        and (TIMES.get(key(columns[1]), TimeUnit.ns) in (None, TimeUnit.s))
    )


def _named_columns(path: Path) -> tuple[tuple[str, ...], bool]:
    """The names that a line before the first number gives the columns of a text file, and whether it is no comment.

    Without such a line there are no names.
    """
    require_regular(path, "a file of tracks", most=_MOST_BYTES)
    column_names: tuple[str, ...] = ()
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        while text := file.readline(_BEGINNING):
            names = tuple(_plain_name(name) for name in text.strip().lstrip("#").split())
            is_row = bool(text.strip()) and not text.lstrip().startswith("#")
            column_names = names if _are_columns(names) else column_names
            if is_row:
                return column_names, column_names == names
    return column_names, False


def _are_columns(names: Iterable[str]) -> bool:
    """Whether words name a track and its position."""
    return {"track", "u_px", "v_px"} <= {known_name(name) for name in names}


def _split_table(path: Path, names: tuple[str, ...]) -> "_Table":
    """A text file with columns of these names, separated by white space, as a table of text."""
    rows: list[list[str]] = []
    lines: list[int] = []
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        for line, text in _lines(path, file):
            cells = text.split()
            if not lines and tuple(map(_plain_name, cells)) == names:
                continue
            if len(cells) != len(names):
                found = counted(len(cells), "column")
                raise DataError(f"{path}:{line}", found, f"{len(names)}: {', '.join(names)}")
            rows.append(cells)
            lines.append(line)
    table = pl.DataFrame(rows, schema=dict.fromkeys(names, pl.String), orient="row").rename(renamed(names))
    _require_columns(path, table.schema)
    return _Table.of(table, np.array(lines, dtype=np.int64))


def read_xivo(path: Path, chosen: Selection) -> Rows:
    """Read a dump of XIVO's tracker. Descriptors are ignored."""
    numbers = read_numbers(path, ",", _XIVO)
    values, lines = numbers.values, numbers.lines
    track = whole_numbers(lambda row: f"{path}:{lines[row]}", values[:, 1], "id")
    time_ns = whole_numbers(lambda row: f"{path}:{lines[row]}", np.rint(values[:, 0]), "timestamp", most=_LARGEST_TIME)
    if chosen.time_unit is not None:
        time_ns *= TimeUnit.ns.per_second // chosen.time_unit.per_second
    between = np.diff(np.unique(time_ns))
    if len(between) and np.median(between) < _LEAST_BETWEEN_NS:
        first = ", ".join(map(str, np.unique(time_ns)[:3]))
        raise DataError(path, f"no header line, and times {first}, ... ns", _HEADER)
    notes = numbers.more.notes(path, len(_XIVO), "timestamp_ns,id,u,v,visible")
    return Rows(path, track, values[:, 2:4].copy(), time_ns=time_ns, line=np.array(lines), notes=notes)


_COLUMNS: dict[str, type[pl.DataType]] = {"track": pl.Int64, "frame": pl.Int64, "u_px": pl.Float64, "v_px": pl.Float64}
_NO_NUMBER = ("", "nan", "null", "none", "na")
_HEADER = f"{', '.join(_COLUMNS)} in a header line"
_COVARIANCE = ("cov_uu", "cov_uv", "cov_vv")
"""Columns that are kept as if their names started with `QUALITY_PREFIX`."""
_RESPONSE = "response"
_USED = {*_COLUMNS, *_COVARIANCE, _RESPONSE}
_OPENSFM = "OPENSFM_TRACKS_VERSION"
_OF_OPENSFM = (
    "a table with the columns image, track, u_px = x max(width, height) + width / 2 - 0.5, and v_px of y and height"
)
_TABLE_LEAST_NANOSECONDS = 1e14
"""Whole timestamps from here on are nanoseconds: as seconds they would be 3 million years."""
_MOST_NANOSECONDS = 4.1e18
_SEPARATORS = ",;\t"
_MOST_ROWS, _MOST_COLUMNS = 1 << 20, 1000


def read_table(path: Path, chosen: Selection) -> Rows:
    """Read a CSV file with a header, or a Parquet file; see `tracknoise.trackers.imported.Imported`.

    Rows without a position, such as blank lines, are frames in which the track was not observed.
    """
    return _rows(path, _read_table(path), chosen)


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """The columns of a file that are used, those that are not, and the line or number of each row."""

    columns: pl.DataFrame
    unused: tuple[str, ...]
    line: NDArray[np.int64]

    @classmethod
    def of(cls, table: pl.DataFrame, line: NDArray[np.int64]) -> "_Table":
        used = _used(table.columns)
        return cls(table.select(used), tuple(name for name in table.columns if name not in used), line)


def _rows(path: Path, table: _Table, chosen: Selection) -> Rows:
    """The rows of a table that are of one camera: observations, and what says that a track was not observed."""
    empty = [_is_empty(table.columns[name]) for name in ("u_px", "v_px")]
    has_position = (~(empty[0] & empty[1])).to_numpy()
    of_frame = [name for name in table.columns.columns if name == "frame" or key(name) in TIMES or key(name) in IMAGES]
    stated = [~_is_empty(table.columns[name]).to_numpy() for name in ("track", *of_frame[:1])]
    observed = _Observed(path, table.columns, table.line).filtered(has_position | np.logical_and.reduce(stated))
    columns = {name: observed.table[name] for name in observed.table.columns if _says(name)}
    meaning = meant(path, columns, len(observed.line), chosen, observed.place)
    mine = observed.filtered(meaning.mine)
    seen = ~np.logical_and.reduce([_is_empty(mine.table[name]).to_numpy() for name in ("u_px", "v_px")])
    if meaning.seen is not None:
        seen &= meaning.seen[meaning.mine]
    if not len(mine.line) or not seen.any():
        raise DataError(
            path, "no row with a feature that was seen" if len(mine.line) else "no track", "at least one row"
        )
    when, names = _when(mine, seen, chosen)
    unused = [*table.unused, *(name for name in of_frame if name not in names.values()), *meaning.unused]
    return Rows(
        path,
        mine.numbers("track", pl.Int64),
        np.column_stack([mine.numbers(name, pl.Float64, among=seen) for name in ("u_px", "v_px")]),
        **when,
        line=mine.line,
        has_lines=mine.has_lines,
        response=_optional(mine, _RESPONSE) if _RESPONSE in mine.table.columns else None,
        quality=_quality(mine),
        seen=None if seen.all() else seen,
        names=names,
        notes=(*meaning.notes, *unused_notes(path, unused)),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Observed:
    """Rows of a table, and their lines or numbers in the file."""

    path: Path
    table: pl.DataFrame
    line: NDArray[np.int64]

    @property
    def has_lines(self) -> bool:
        return self.path.suffix != ".parquet"

    def filtered(self, kept: NDArray[np.bool_]) -> "_Observed":
        return _Observed(self.path, self.table.filter(pl.Series(kept, dtype=pl.Boolean)), self.line[kept])

    def place(self, row: int) -> str:
        return f"{self.path}:{self.line[row]}" if self.has_lines else f"{self.path}: row {self.line[row]}"

    def numbers(
        self, name: str, kind: type[pl.DataType], *, optional: bool = False, among: NDArray[np.bool_] | None = None
    ) -> NDArray[Any]:
        """The finite numbers of a column, NaN where they may be missing; an error shows the first that is none.

        `among`: the rows that must have one.
        """
        column = self.table[name]
        text = _stripped(column)
        cast = _whole(text) if kind is pl.Int64 else text.cast(kind, strict=False)
        bad = cast.is_null() if kind is pl.Int64 else ~cast.is_finite().fill_null(value=False)
        if kind is pl.Int64:
            number = text.cast(pl.Float64, strict=False)
            large = bad & ((number.abs() >= LARGEST) & number.is_finite()).fill_null(value=False)
            self.refuse(large.to_numpy(), name, f"{_expected(kind)} of at most {LARGEST}")
        wrong = (bad & ~_is_empty(column) if optional else bad).to_numpy()
        self.refuse(wrong if among is None else wrong & among, name, _expected(kind))
        return cast.to_numpy() if kind is pl.Int64 else cast.fill_null(np.nan).to_numpy()

    def refuse(self, bad: NDArray[np.bool_], name: str, expected: str) -> None:
        rows = np.flatnonzero(bad)
        if len(rows):
            row = int(rows[0])
            raise DataError(self.place(row), f"{name} {self.table[name][row]!r}", expected)


def _is_empty(column: pl.Series) -> pl.Series:
    """Whether cells are empty, or say that there is no number."""
    if column.dtype == pl.String:
        return column.str.strip_chars().str.to_lowercase().is_in(_NO_NUMBER).fill_null(value=True)
    return column.is_null() | (column.is_nan() if column.dtype.is_float() else False)


def _when(observed: _Observed, seen: NDArray[np.bool_], chosen: Selection) -> tuple[dict[str, Any], dict[Moment, str]]:
    """Frames, times and images, by the names that `Rows` has for them, and the names that the file has for them."""
    columns = observed.table.columns
    when: dict[str, NDArray[Any]] = {}
    names: dict[Moment, str] = {}
    images = [name for name in ("frame", *columns) if name in columns and (name == "frame" or key(name) in IMAGES)]
    is_alone = "frame" not in columns and not any(key(name) in TIMES for name in columns)
    for name in images:
        texts = observed.table[name].cast(pl.String).fill_null("").to_list()
        is_named = str.strip if is_alone else is_image_name  # names may have no ending
        if all(is_named(text) for text, is_seen in zip(texts, seen, strict=True) if is_seen):
            when["image"], names[Moment.image] = np.array(texts, dtype=np.str_), name
            break
    if "frame" in columns and names.get(Moment.image) != "frame" and chosen.frames_by in (None, Moment.frame):
        when["frame"], names[Moment.frame] = observed.numbers("frame", pl.Int64), "frame"
    times = sorted((name for name in columns if key(name) in TIMES), key=lambda name: [*TIMES].index(key(name)))
    if times and chosen.frames_by in (None, Moment.time):
        beside, named = bool(when) and chosen.frames_by is None, TIMES[key(times[0])]
        if None not in (named, chosen.time_unit) and named != chosen.time_unit:
            stated = f"column {times[0]} with time_unit = {str(chosen.time_unit)!r}"
            raise DataError(observed.path, stated, "no time_unit where the column names its unit")
        when |= _times(observed, times[0], named or chosen.time_unit, beside=beside)
        names[Moment.time] = times[0]
    return when, names


def _times(observed: _Observed, name: str, unit: TimeUnit | None, *, beside: bool) -> dict[str, NDArray[Any]]:
    """The times of a column. Whole numbers of 15 digits or more are nanoseconds, where no unit is stated.

    `beside`: whether frames are known too, so that a time that is no number is unknown.
    """
    if beside:
        text = _stripped(observed.table[name])
        times = text.cast(pl.Float64, strict=False).fill_null(np.nan).to_numpy().copy()
        times[~np.isfinite(times)] = np.nan
    else:
        times = observed.numbers(name, pl.Float64)
    integers = _whole(_stripped(observed.table[name]))
    are_whole = not integers.null_count()
    if unit is None and are_whole and np.abs(times).min() >= _TABLE_LEAST_NANOSECONDS:
        unit = TimeUnit.ns
    if unit in (None, TimeUnit.s) or not are_whole:
        return {"time_s": times / (unit or TimeUnit.s).per_second}
    factor = TimeUnit.ns.per_second // unit.per_second
    observed.refuse(factor * np.abs(times) > _MOST_NANOSECONDS, name, "a time before the year 2100")
    return {"time_ns": factor * integers.to_numpy()}


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
    observed.refuse(np.abs(values) > np.finfo(np.float32).max, name, IN_FLOAT32)
    narrow: NDArray[np.float32] = values.astype(np.float32)
    return narrow


def _read_table(path: Path) -> _Table:
    """The columns that are used, without spaces around their names.

    Polars ends the whole process on some damaged files, and panics on others. Therefore a child process reads them.
    """
    expected = f"a {path.suffix} file of tracks"
    size = require_regular(path, "a file of tracks", most=_MOST_BYTES)
    with damage_reported(path, "not readable", expected, with_reason=True):
        return call_in_child(_read_parquet if path.suffix == ".parquet" else _read_csv, path, size, size=size)


def _read_csv(path: Path, size: int) -> _Table:
    """All columns are read as text, so that errors can show the cell. The header shows what separates them."""
    _require_text(path)
    _require_no_null(path)
    with path.open("rb") as file:
        header = file.readline(MIB).decode("utf-8-sig", errors="replace").rstrip("\r\n")
    separator = max(_SEPARATORS, key=header.count)
    names = [_plain_name(name) for name in header.split(separator)]
    _require_header(path, header, names)
    try:
        table = pl.read_csv(path, infer_schema=False, glob=False, separator=separator)
    except pl.exceptions.PolarsError:
        _require_whole_rows(path, separator, len(names))
        raise
    if table.to_series(-1).null_count():  # where a row ends early, Polars fills its last columns
        _require_whole_rows(path, separator, table.width)
    table = table.rename(_plain_name)
    table = table.rename(renamed(table.columns))
    _require_columns(path, table.schema)
    return _Table.of(table, 2 + np.arange(table.height))


def _require_text(path: Path) -> None:
    with path.open("rb") as file:
        start = file.read(4)
    compression = next((kind for signature, kind in _COMPRESSED.items() if start.startswith(signature)), None)
    if compression is not None:
        raise DataError(path, f"a {compression} file", f"a {path.suffix} file of tracks, not compressed")


def _require_no_null(path: Path) -> None:
    line = 1
    with path.open("rb") as file:
        while piece := file.read(MIB):
            before, null, _ = piece.partition(b"\0")
            line += before.count(b"\n")
            if null:
                raise DataError(f"{path}:{line}", "a null character", "a .csv file of tracks in UTF-8, not UTF-16")


def _require_header(path: Path, header: str, names: list[str]) -> None:
    """Check the first line before Polars does: its errors name no line, and it gives equal columns other names."""
    place, expected = f"{path}:1", f"a header with the columns {', '.join(_COLUMNS)}, each once"
    if "\r" in header:
        raise DataError(place, "a carriage return within the line", "lines that end with a line feed")
    if len(names) > _MOST_COLUMNS:
        raise DataError(path, f"{len(names)} columns", f"at most {_MOST_COLUMNS}")
    if header.startswith(_OPENSFM):
        raise DataError(path, "tracks of OpenSfM, whose x and y are shares of the longer side", _OF_OPENSFM)
    if sum(is_number(name) for name in names) > 1 and not _are_columns(names):
        raise DataError(place, "no header line", _HEADER)
    if header.startswith("#") and not {*_COLUMNS} & {*names, *renamed(names).values()}:
        raise DataError(place, "a comment", expected)
    if twice := next((name for name in names if _is_used(name) and names.count(name) > 1), None):
        raise DataError(place, f"column {twice} twice", expected)


def _require_whole_rows(path: Path, separator: str, columns: int) -> None:
    """Name the first row that is no row of the table. Blank lines are allowed."""
    expected, first = f"a row of {counted(columns, 'column')}, as in line 1, with all quotes closed", 1
    with path.open("rb") as file:
        rows = csv.reader((line.decode() for line in file), delimiter=separator, strict=True)
        try:
            for row in rows:
                if len(row) != columns and "".join(row).strip():
                    raise DataError(f"{path}:{first}", counted(len(row), "column"), expected)
                first = rows.line_num + 1
        except csv.Error as error:
            raise DataError(f"{path}:{first}", f"no whole row ({error})", expected) from error
        except UnicodeDecodeError as error:
            raise DataError(f"{path}:{rows.line_num + 1}", "not UTF-8", "a .csv file of tracks in UTF-8") from error


def _plain_name(column: str) -> str:
    """The name of a column without spaces, quotes, and the ``#`` with which NumPy begins a header."""
    return column.strip().removeprefix("#").strip(' "')


def _read_parquet(path: Path, size: int) -> _Table:
    """The number of rows is limited by the size of the file: a column of one repeated value takes almost no space."""
    file = pl.scan_parquet(path, glob=False).rename(str.strip)
    file = file.rename(renamed(file.collect_schema()))
    _require_columns(path, file.collect_schema())
    rows = file.select(pl.len()).collect().item()
    if rows > max(_MOST_ROWS, size):
        raise DataError(path, f"{rows} rows in {size} bytes", "at most one row per byte")
    schema = file.collect_schema()
    used = _used(schema)
    table = file.select(used).collect()
    return _Table(table, tuple(name for name in schema if name not in used), 1 + np.arange(table.height))


def _require_columns(path: Path, columns: pl.Schema) -> None:
    """Check that the columns that are needed are there, and that all that are used may contain what they should."""
    has_moment = any(key(name) in TIMES or key(name) in IMAGES for name in columns)
    missing = [name for name in _COLUMNS if name not in columns and not (name == "frame" and has_moment)]
    if missing:
        raise DataError(path, f"no column {', '.join(missing)} among {', '.join(columns)}", ", ".join(_COLUMNS))
    for name, dtype in columns.items():
        plain = dtype.is_integer() or dtype.is_float() or dtype in (pl.String, pl.Null)
        words = dtype in (pl.Boolean, pl.Categorical, pl.Enum) and (_says(name) or key(name) in IMAGES)
        if _is_used(name) and not (plain or words):
            raise DataError(path, f"column {name} of type {dtype}", f"{_expected(_COLUMNS.get(name))} in each row")


def _used(columns: Iterable[str]) -> list[str]:
    return [column for column in columns if _is_used(column)]


def _is_used(column: str) -> bool:
    named = column in _USED or column.startswith(QUALITY_PREFIX)
    return named or key(column) in TIMES or key(column) in IMAGES or has_meaning(column)


def _says(column: str) -> bool:
    """Whether a column says of its rows what `meant` reads."""
    return has_meaning(column) and column not in _USED and not column.startswith(QUALITY_PREFIX)


def _expected(kind: type[pl.DataType] | None) -> str:
    return f"a {'whole ' if kind is pl.Int64 else 'finite '}number"


def _stripped(column: pl.Series) -> pl.Series:
    return column.str.strip_chars() if column.dtype == pl.String else column


def _whole(text: pl.Series) -> pl.Series:
    """Whole numbers, also those written as ``7.0``; null where there is none. Long ones are not rounded to floats."""
    number = text.cast(pl.Float64, strict=False)
    truncated = text.cast(pl.Int64, strict=False).fill_null(number.cast(pl.Int64, strict=False))
    return truncated.set(truncated != number, None)


_TAP_MOST_BYTES = 1024 * MIB
_TAP_EXPECTED = "a .npz file with the arrays tracks and occluded"
_FRAMES_FIRST = "pred_tracks"
"""The name of positions of shape (frames, points, 2), which are those of CoTracker."""
_NAMES: Mapping[str, tuple[str, ...]] = {
    "positions": ("tracks", "points", "target_points", _FRAMES_FIRST),
    "queries": ("query_points", "queries"),
}
"""Names that models and data sets give the arrays, by what they hold."""
_AXES = {"positions": 3, "queries": 2}
_Arrays = Mapping[str, tuple[str, NDArray[Any]]]
"""Arrays with their names, by what they hold."""
_NOT_OF_POINTS = ("video", "frames", "images", "intrinsics", "fps", "size", "height", "width")
"""Arrays that say nothing of single observations."""


def read_tap(path: Path, chosen: Selection, *, n_frames: int | None) -> Rows:
    """Read an archive with ``tracks``, (points, frames, 2): u and v, and ``occluded``, (points, frames).

    ``visible`` and others can replace ``occluded``: see `tracknoise.trackers.track_columns`. With ``query_points``,
    (points, 3), whose first column is the frame, the frames before that of the query are left out. Each point is a
    track with one row per frame. `_NAMES` has further names. An additional first axis of length 1 is ignored.
    ``pred_tracks`` have frames before points, and so has what states where these are seen.
    """
    size = require_regular(path, _TAP_EXPECTED, most=_TAP_MOST_BYTES)
    with damage_reported(path, "not readable", _TAP_EXPECTED, with_reason=True):
        arrays, stated, unused = call_in_child(_read_tap, path, size=size)
    tracks = _positions(path, arrays, n_frames)
    evaluated = np.ones(tracks.shape[:2], dtype=np.bool_)
    if "queries" in arrays:
        first = _query_frames(path, *arrays["queries"], len(tracks))
        evaluated &= np.arange(tracks.shape[1]) >= first[:, None]
    track, frame = np.nonzero(evaluated)
    uv = tracks[track, frame]
    columns = {name: pl.Series(values[track, frame]) for name, values in _stated(path, arrays, stated).items()}
    meaning = meant(path, columns, len(track), chosen, lambda row: f"{path}: point {track[row]}, frame {frame[row]}")
    seen = meaning.mine if meaning.seen is None else meaning.mine & meaning.seen
    bad = seen & ~np.isfinite(uv).all(axis=1)
    if bad.any():
        place = int(np.flatnonzero(bad)[0])
        found = f"tracks of point {track[place]} in frame {frame[place]} are {uv[place].tolist()}"
        raise DataError(path, found, "finite positions where a point is not occluded")
    if not seen.any():
        raise DataError(path, "no visible point", "at least one")
    return Rows(
        path,
        track.astype(np.int64),
        uv,
        frame=frame.astype(np.int64),
        seen=seen,
        states_all=True,
        notes=unused_notes(path, (*meaning.unused, *unused)),
    )


def _read_tap(path: Path) -> tuple[dict[str, tuple[str, NDArray[Any]]], dict[str, NDArray[Any]], tuple[str, ...]]:
    """Arrays by what they hold, arrays that may say where points are seen, and names of others."""
    with np.load(path, allow_pickle=False) as archive:
        present = {role: next((name for name in names if name in archive), None) for role, names in _NAMES.items()}
        arrays = {role: (name, archive[name]) for role, name in present.items() if name is not None}
        stated = {name: _without_batch(archive[name], 2) for name in archive.files if has_meaning(name)}
        used = {*stated, *_NOT_OF_POINTS, *(name for name, _ in arrays.values())}
        unused = tuple(name for name in archive.files if name not in used)
    return (
        {role: (name, _without_batch(values, _AXES[role])) for role, (name, values) in arrays.items()},
        stated,
        unused,
    )


def _without_batch(values: NDArray[Any], axes: int) -> NDArray[Any]:
    """The array without axes of length 1 that are too many: the first ones, then the last ones."""
    while values.ndim > axes and len(values) == 1:
        values = values[0]
    while values.ndim > axes and values.shape[-1] == 1:
        values = values[..., 0]
    return values


def _positions(path: Path, arrays: _Arrays, n_frames: int | None) -> NDArray[np.float64]:
    """The array of positions as float64, (points, frames, 2)."""
    if "positions" not in arrays:
        raise DataError(path, "no array tracks", _TAP_EXPECTED)
    name, tracks = arrays["positions"]
    if tracks.ndim != 3 or tracks.shape[2] != 2 or tracks.dtype.kind not in "fiu":
        found = f"{name} of shape {tracks.shape} and type {tracks.dtype}"
        raise DataError(path, found, "numbers of shape (points, frames, 2)")
    if name == _FRAMES_FIRST:
        return np.asarray(tracks.swapaxes(0, 1), dtype=np.float64)
    if n_frames is not None and _are_frames_first(tracks.shape[0], tracks.shape[1], n_frames):
        found = f"{name} of shape {tracks.shape} for {counted(n_frames, 'frame')}"
        raise DataError(path, found, "shape (points, frames, 2): transpose the first two axes")
    return np.asarray(tracks, dtype=np.float64)


def _are_frames_first(first: int, second: int, n_frames: int) -> bool:
    """Whether the lengths of two axes show that the first one is that of frames."""
    return first == n_frames != second or first <= n_frames < second


def _stated(path: Path, arrays: _Arrays, stated: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """What arrays state of each point and frame, (points, frames) each."""
    if not stated:
        raise DataError(path, "no array occluded or visible", _TAP_EXPECTED)
    positions_name, positions = arrays["positions"]
    expected = positions.shape[:2]
    for name, values in stated.items():
        if values.shape != expected or values.dtype.kind not in "buif":
            found = f"{name} of shape {values.shape} and type {values.dtype}"
            raise DataError(path, found, f"true or false, of shape {expected}")
    return {name: values.T if positions_name == _FRAMES_FIRST else values for name, values in stated.items()}


def _query_frames(path: Path, name: str, queries: NDArray[Any], count: int) -> NDArray[np.float64]:
    """The frame of each query."""
    if queries.shape != (count, 3) or queries.dtype.kind not in "fiu" or not np.isfinite(queries).all():
        found = f"{name} of shape {queries.shape} and type {queries.dtype}"
        raise DataError(path, found, f"finite numbers of shape ({count}, 3): frame, v and u of each point")
    return np.rint(np.asarray(queries[:, 0], dtype=np.float64))


_COLMAP_EXPECTED = "a COLMAP database"
_PAIR_BASE = 2**31 - 1
"""A pair of images i < j has the number i * _PAIR_BASE + j."""
_Keypoints = list[NDArray[np.float64]]
_Matches = list[NDArray[np.int64]]


def read_colmap(path: Path, *, n_frames: int | None) -> Rows:
    """Read the keypoints of all images, and chain them to tracks by the inlier matches of consecutive images.

    Frames are images in the order of their names, in which numbers count as numbers. A keypoint without a match in the
    next image is the last of its track. The positions are those of the file, whose origin is the corner of the first
    pixel.
    """
    size = require_regular(path, _COLMAP_EXPECTED, most=_MOST_BYTES)
    _require_closed(path)
    with damage_reported(path, "not readable", _COLMAP_EXPECTED, with_reason=True):
        keypoints, matches = call_in_child(_read_colmap, path, size=size)
    if n_frames not in (None, len(keypoints)):
        frames = counted(n_frames or 0, "frame")
        raise DataError(path, counted(len(keypoints), "image"), f"one for each of the {frames}")
    counts = [len(points) for points in keypoints]
    if not sum(counts):
        raise DataError(path, "no keypoint", "at least one")
    frame = np.repeat(np.arange(len(counts)), counts)
    return Rows(path, _chained(counts, matches), np.concatenate(keypoints), frame=frame, states_all=True)


def _require_closed(path: Path) -> None:
    """Refuse a database whose last changes are in a file beside it: reading them would write there."""
    log = path.with_name(f"{path.name}-wal")
    if log.is_file() and log.stat().st_size:
        raise DataError(path, f"changes that are in {log.name} alone", "a database that no program has open")


def _read_colmap(path: Path) -> tuple[_Keypoints, _Matches]:
    """Keypoints of each image, and matches (k, 2) of each image with the next; images in the order of their names."""
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as database:
        numbers = {str(name): int(image) for image, name in database.execute("SELECT image_id, name FROM images")}
        images = [numbers[name] for name in natural_order(numbers)]
        points = {row[0]: row[1:] for row in database.execute("SELECT image_id, rows, cols, data FROM keypoints")}
        pairs = {
            row[0]: row[1:] for row in database.execute("SELECT pair_id, rows, cols, data FROM two_view_geometries")
        }
        keypoints = [_keypoints(path, points.get(image)) for image in images]
        counts = [len(of_image) for of_image in keypoints]
        matches = [_between(path, pairs, images[k : k + 2], counts[k : k + 2]) for k in range(len(images) - 1)]
    return keypoints, matches


def _keypoints(path: Path, stored: tuple[int, int, bytes | None] | None) -> NDArray[np.float64]:
    if stored is None or not stored[0]:
        return np.empty((0, 2))
    table = _matrix(path, stored, np.dtype("<f4"), "keypoints")
    if table.shape[1] < 2 or not np.isfinite(table[:, :2]).all():
        raise DataError(path, f"keypoints of shape {table.shape}", "finite positions in the first two columns")
    return table[:, :2].astype(np.float64)


def _between(
    path: Path, pairs: dict[int, tuple[int, int, bytes | None]], images: list[int], counts: list[int]
) -> NDArray[np.int64]:
    """Matches (k, 2) from the first of two images to the second, in this order; each keypoint at most once."""
    low, high = sorted(images)
    stored = pairs.get(low * _PAIR_BASE + high)
    if stored is None or not stored[0]:
        return np.empty((0, 2), np.int64)
    matches = _matrix(path, stored, np.dtype("<u4"), "matches").astype(np.int64)
    if images[0] != low:
        matches = matches[:, ::-1]
    if matches.shape[1] != 2 or (matches >= counts).any():
        raise DataError(path, f"matches of images {images[0]} and {images[1]}", "two numbers of keypoints that exist")
    for column in (0, 1):
        matches = matches[np.sort(np.unique(matches[:, column], return_index=True)[1])]
    return matches


def _matrix(
    path: Path, stored: tuple[int, int, bytes | None], dtype: np.dtype[np.generic], what: str
) -> NDArray[np.generic]:
    rows, columns, data = stored
    if data is None or rows < 0 or columns < 1 or len(data) != rows * columns * dtype.itemsize:
        found = f"{what} of {rows} x {columns} numbers in {counted(len(data or b''), 'byte')}"
        raise DataError(path, found, f"{dtype.itemsize} bytes for each number")
    return np.frombuffer(data, dtype).reshape(rows, columns)


def _chained(counts: list[int], matches: _Matches) -> NDArray[np.int64]:
    """The number of the track of each keypoint, images one after another."""
    tracks: list[NDArray[np.int64]] = []
    n_tracks = 0
    for index, count in enumerate(counts):
        track = np.full(count, -1)
        if index:
            before, after = matches[index - 1].T
            track[after] = tracks[-1][before]
        new = np.flatnonzero(track < 0)
        track[new] = n_tracks + np.arange(len(new))
        n_tracks += len(new)
        tracks.append(track)
    return np.concatenate(tracks)


_BEGINNING = 4096
_FORMAT_LEAST_NANOSECONDS = 1e9
_LEAST_DESCRIPTOR = 8
"""Columns of numbers behind the position from which on they are a descriptor."""
_LEAST_BETWEEN_NS = 1e5
"""Between two images, as no camera takes 10,000 per second."""


class TrackFormat(StrEnum):
    """Formats of files of tracks.

    table: CSV with a header, or Parquet. xivo: the dump of XIVO's tracker. events: ``id t x y`` of event trackers. tap:
    NumPy archive of a model that tracks any point. colmap: database of COLMAP. bag: topic of a bag of ROS 1 or ROS 2.
    """

    table = "table"
    xivo = "xivo"
    events = "events"
    tap = "tap"
    colmap = "colmap"
    bag = "bag"


_BY_SUFFIX: Mapping[str, TrackFormat] = {
    ".csv": TrackFormat.table,
    ".tsv": TrackFormat.table,
    ".parquet": TrackFormat.table,
    ".txt": TrackFormat.events,
    ".npz": TrackFormat.tap,
    ".db": TrackFormat.colmap,
    **dict.fromkeys((".bag", ".db3", ".mcap", ".zstd"), TrackFormat.bag),
}
SUFFIXES = tuple(_BY_SUFFIX)
"""Endings of file names that show a format."""


def _read_bag(path: Path, chosen: Selection) -> Rows:
    from tracknoise.trackers.bag_tracks import read_bag  # the library of bags takes a quarter of a second

    return read_bag(path, chosen)


_READERS: Mapping[TrackFormat, Callable[[Path, int | None, Selection], Rows]] = {
    TrackFormat.table: lambda path, _, chosen: read_table(path, chosen),
    TrackFormat.xivo: lambda path, _, chosen: read_xivo(path, chosen),
    TrackFormat.events: lambda path, _, chosen: read_events(path, chosen),
    TrackFormat.tap: lambda path, n_frames, chosen: read_tap(path, chosen, n_frames=n_frames),
    TrackFormat.colmap: lambda path, n_frames, _: read_colmap(path, n_frames=n_frames),
    TrackFormat.bag: lambda path, _, chosen: _read_bag(path, chosen),
}


def detected(path: Path) -> TrackFormat:
    """The format that the name and the beginning of a file show.

    A text file without a header whose first line has a whole time in nanoseconds, or a descriptor, is a dump of XIVO.

    Raises
    ------
    DataError
        If the file is missing.
    """
    require_regular(path, "a file of tracks")
    kind = _BY_SUFFIX[path.suffix]
    if kind is TrackFormat.events and _is_table(path):
        return TrackFormat.table
    return TrackFormat.xivo if path.suffix in (".csv", ".txt") and _is_xivo(path) else kind


def read_rows(path: Path, kind: TrackFormat, *, n_frames: int | None, chosen: Selection = PLAIN) -> Rows:
    """Read a file of tracks.

    Parameters
    ----------
    path
        The file.
    kind
        Its format.
    n_frames
        Number of frames of the sequence; None if it is a part of the recording.
    chosen
        Which rows are read, where the file has several kinds of rows.

    Raises
    ------
    DataError
        If the file is missing, damaged or of another format.
    """
    return _READERS[kind](path, n_frames, chosen)


def origin_of(kind: TrackFormat) -> PixelOrigin:
    """What (0, 0) is in files of a format, if nothing else is stated."""
    return PixelOrigin.corner if kind is TrackFormat.colmap else PixelOrigin.centre


def _is_xivo(path: Path) -> bool:
    """Whether the first line has numbers only, separated by commas: a time that is one in nanoseconds, or a descriptor.

    A table without a header, such as track, frame, u, v, score, has neither.
    """
    try:
        cells = _first_line(path).split(",")
        numbers = [float(cell) for cell in cells[:4]]
        described = len(cells) >= len(numbers) + _LEAST_DESCRIPTOR
        stamped = numbers[0] >= _FORMAT_LEAST_NANOSECONDS and numbers[0].is_integer()
        return len(numbers) == 4 and (described or stamped)
    except (OSError, ValueError, IndexError):
        return False


def _is_table(path: Path) -> bool:
    """Whether the first line of a text file names columns that commas or semicolons separate."""
    try:
        first = _first_line(path)
    except OSError:
        return False
    return any(_are_columns(map(_plain_name, first.split(separator))) for separator in ",;")


def _first_line(path: Path) -> str:
    with path.open("rb") as file:
        return file.readline(_BEGINNING).removeprefix(codecs.BOM_UTF8).decode(errors="replace")
