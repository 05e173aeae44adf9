"""Formats of files of tracks: which there are, how a file shows its format, and what reads it."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from pathlib import Path

from tracknoise.foreign.files import require_regular
from tracknoise.trackers.imports.colmap import read_colmap
from tracknoise.trackers.imports.events import read_events
from tracknoise.trackers.imports.pixels import PixelOrigin
from tracknoise.trackers.imports.rows import Rows
from tracknoise.trackers.imports.table import read_table
from tracknoise.trackers.imports.tap import read_tap
from tracknoise.trackers.imports.xivo import read_xivo

_BEGINNING = 4096
_LEAST_NANOSECONDS = 1e9


class TrackFormat(StrEnum):
    """Formats of files of tracks.

    table: CSV with a header, or Parquet. xivo: the dump of XIVO's tracker. events: ``id t x y`` of event trackers. tap:
    NumPy archive of a model that tracks any point. colmap: database of COLMAP.
    """

    table = "table"
    xivo = "xivo"
    events = "events"
    tap = "tap"
    colmap = "colmap"


_BY_SUFFIX: Mapping[str, TrackFormat] = {
    ".csv": TrackFormat.table,
    ".parquet": TrackFormat.table,
    ".txt": TrackFormat.events,
    ".npz": TrackFormat.tap,
    ".db": TrackFormat.colmap,
}
SUFFIXES = tuple(_BY_SUFFIX)
"""Endings of file names that show a format."""
_READERS: Mapping[TrackFormat, Callable[[Path, int | None], Rows]] = {
    TrackFormat.table: lambda path, _: read_table(path),
    TrackFormat.xivo: lambda path, _: read_xivo(path),
    TrackFormat.events: lambda path, _: read_events(path),
    TrackFormat.tap: lambda path, n_frames: read_tap(path, n_frames=n_frames),
    TrackFormat.colmap: lambda path, n_frames: read_colmap(path, n_frames=n_frames),
}


def detected(path: Path) -> TrackFormat:
    """The format that the name and the beginning of a file show.

    A text file whose first line begins with four numbers, and has a descriptor or a time in nanoseconds, is a dump of
    XIVO.

    Raises
    ------
    DataError
        If the file is missing.
    """
    require_regular(path, "a file of tracks")
    found = _BY_SUFFIX[path.suffix]
    return TrackFormat.xivo if path.suffix in (".csv", ".txt") and _is_xivo(path) else found


def read_rows(path: Path, kind: TrackFormat, *, n_frames: int | None) -> Rows:
    """Read a file of tracks.

    Parameters
    ----------
    path
        The file.
    kind
        Its format.
    n_frames
        Number of frames of the sequence; None if it is a part of the recording.

    Raises
    ------
    DataError
        If the file is missing, damaged or of another format.
    """
    return _READERS[kind](path, n_frames)


def origin_of(kind: TrackFormat) -> PixelOrigin:
    """What (0, 0) is in files of a format, if nothing else is stated."""
    return PixelOrigin.corner if kind is TrackFormat.colmap else PixelOrigin.centre


def _is_xivo(path: Path) -> bool:
    """Whether the first line has numbers only, separated by commas: a descriptor, or a time that is one in nanoseconds.

    A table without a header, track, frame, u, v, has neither.
    """
    try:
        with path.open("rb") as file:
            cells = file.readline(_BEGINNING).split(b",")
        numbers = [float(cell) for cell in cells[:4]]
        return len(numbers) == 4 and (len(cells) > 4 or numbers[0] >= _LEAST_NANOSECONDS)
    except (OSError, ValueError):
        return False
