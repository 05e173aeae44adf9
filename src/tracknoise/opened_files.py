"""Which files a piece of work reads: noted while it runs, from the audit events of Python.

Files that compiled code opens by itself raise no event. `note` is for those.
"""

import hashlib
import os
import sys
import threading
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

_WRITING = os.O_WRONLY | os.O_RDWR
_BLOCK = 1 << 18
"""Bytes that are read at a time. Files of up to one block have a SHA-256; of larger ones it would take too long."""


@dataclass(frozen=True, slots=True)
class FileState:
    """What a file held at some time.

    Parameters
    ----------
    size
        Bytes.
    mtime_ns
        Time of its last modification, nanoseconds.
    content
        Checksum of its content, as `content_of`; empty if it was not read.
    """

    size: int
    mtime_ns: int
    content: str

    @classmethod
    def of(cls, path: Path, *, most: int | None = None) -> "FileState | None":
        """The state of a regular file; None without one, or if it cannot be read, or changes meanwhile.

        Files of more than `most` bytes are not read.
        """
        before = stat_of(path)
        is_read = most is None or before is None or before[0] <= most
        content = content_of(path) if is_read else ""
        return None if before is None or content is None or stat_of(path) != before else cls(*before, content)


def absolute_path(path: str | bytes | os.PathLike[Any]) -> Path:
    """A path from the root of the file system, without ``..``. Links stay: a copy of the data may have the files."""
    return Path(os.path.abspath(os.fsdecode(path)))  # noqa: PTH100


def stat_of(path: Path) -> tuple[int, int] | None:
    """Size in bytes and time of modification in nanoseconds of a regular file; None without one."""
    if not path.is_file():
        return None
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns


def content_of(path: Path) -> str | None:
    """Hexadecimal checksum of a file's content: SHA-256 up to 256 KiB, else CRC-32. None if it cannot be read."""
    block = memoryview(bytearray(_BLOCK))
    try:
        with path.open("rb", buffering=0) as file:
            parts = (block[:count] for count in iter(lambda: file.readinto(block), 0))
            return _checksum(parts, path.stat().st_size)
    except OSError:
        return None


def _checksum(parts: Iterable[memoryview], size: int) -> str:
    if size <= _BLOCK:
        return hashlib.sha256(b"".join(parts)).hexdigest()
    crc = 0
    for part in parts:
        crc = zlib.crc32(part, crc)
    return f"{crc:08x}"


@dataclass(slots=True, eq=False)
class Opened:
    """What was read: each file with its state when it was opened first, and each folder that was listed.

    Parameters
    ----------
    counts
        Whether a path is of interest. Others are ignored.
    files
        State by absolute path. None for a file that changed while it was read.
    early
        Files opened before `started`.
    folders
        Those that were listed, or that a file was read from or looked for in.
    most
        Size of the largest file whose content is looked at, bytes. None: of any size.
    unknown
        What reads files that are not known, in a few words each.
    """

    counts: Callable[[Path], bool]
    files: dict[Path, FileState | None] = field(default_factory=dict)
    early: set[Path] = field(default_factory=set)
    folders: set[Path] = field(default_factory=set)
    most: int | None = None
    unknown: set[str] = field(default_factory=set)
    _started: bool = False

    def started(self) -> None:
        """Files that are opened first from now on are not `early`."""
        self._started = True

    def read(self, path: Path, *, most: int | None = None, state: FileState | None = None) -> None:
        """Note that a file is read, or of a folder all files in it; the content of those up to `most` bytes.

        The state of a file is found out unless it is given.
        """
        if path in self.files or not self.counts(path):
            return
        self.folders.add(path.parent)
        if path.is_dir():
            self.listed(path)
            for inner in sorted(entry for entry in path.rglob("*") if entry.is_file()):
                self.read(inner, most=most)
        elif path.is_file():
            self._keep(path, state or FileState.of(path, most=self.most if most is None else most))

    def stated(self, path: Path) -> None:
        """Note a file that is read, whether or not it counts by itself."""
        if path not in self.files and path.is_file():
            self._keep(path, FileState.of(path, most=self.most))

    def read_elsewhere(self, path: Path, state: FileState | None) -> None:
        """Note a file that another process has read, with its state then, whose content is not known."""
        if path in self.files or not self.counts(path):
            return
        now = FileState.of(path)
        is_same = state is not None and now is not None and (state.size, state.mtime_ns) == (now.size, now.mtime_ns)
        self.folders.add(path.parent)
        self._keep(path, now if is_same else None)

    def _keep(self, path: Path, state: FileState | None) -> None:
        self.files[path] = state
        if not self._started:
            self.early.add(path)

    def listed(self, folder: Path) -> None:
        """Note that the names in a folder are read."""
        if self.counts(folder):
            self.folders.add(folder)


_OF_A_DATABASE = ("", "-wal", "-journal")
"""Files of a database of SQLite, by what follows its name."""
_noting: dict[int, Opened] = {}
"""What notes at the moment, by the thread that began it."""
_busy = threading.local()
_lock = threading.Lock()
_hooked = False


@contextmanager
def noting(counts: Callable[[Path], bool], *, most: int | None = None) -> Iterator[Opened]:
    """Note what this thread reads, and what threads read that do not note themselves, such as those it starts.

    Parameters
    ----------
    counts
        Whether an absolute path is of interest.
    most
        As in `Opened`.
    """
    _install()
    opened, thread = Opened(counts, most=most), threading.get_ident()
    outer = _noting.get(thread)
    _noting[thread] = opened
    try:
        yield opened
    finally:
        if outer is None:
            del _noting[thread]
        else:
            _noting[thread] = outer


def opened_for_reading(event: str, arguments: tuple[Any, ...]) -> object:
    """What an audit event of Python says is opened for reading: a path in most cases; None of other events."""
    is_read = event == "open" and not (isinstance(arguments[2], int) and arguments[2] & _WRITING)
    return arguments[0] if is_read else None


def note(path: Path) -> None:
    """Note that a file is read, or everything in a folder: for what no audit event tells."""
    _tell(Opened.read, path)


def note_stated(path: Path) -> None:
    """Note that a file is read, wherever it lies: what a user names counts, also a program."""
    _tell(Opened.stated, path)


def note_unknown(what: str) -> None:
    """Note that something reads files that are not known."""
    _tell(lambda opened, _: opened.unknown.add(what), Path())


def note_elsewhere(files: Mapping[Path, FileState | None], folders: Iterable[Path]) -> None:
    """Note what another process has read and listed."""
    for path, state in files.items():
        _tell(partial(Opened.read_elsewhere, state=state), path)
    for folder in folders:
        _tell(Opened.listed, folder)


def read_noted(path: Path) -> bytes:
    """Content of a file, which is noted without reading it again.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    if not _noting or getattr(_busy, "now", False):
        return path.read_bytes()
    _busy.now = True
    try:
        before, content, after = stat_of(path), path.read_bytes(), stat_of(path)
    finally:
        _busy.now = False
    if before is not None and before == after:
        state = FileState(*before, _checksum([memoryview(content)], len(content)))
        _tell(partial(Opened.read, state=state), path)
    else:
        note(path)
    return content


def read_head_unnoted(path: Path, count: int) -> bytes:
    """The first bytes of a file, which is not noted: for what no number depends on.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    outer, _busy.now = getattr(_busy, "now", False), True
    try:
        with path.open("rb") as file:
            return file.read(count)
    finally:
        _busy.now = outer


def _install() -> None:
    """Begin to listen. A hook cannot be removed: it does nothing while nothing is noted."""
    global _hooked
    with _lock:
        if not _hooked:
            sys.addaudithook(_hear)
            _hooked = True


def _hear(event: str, arguments: tuple[Any, ...]) -> None:
    if not _noting:
        return
    if event == "open":
        _tell(Opened.read, opened_for_reading(event, arguments))
    elif event in ("os.listdir", "os.scandir"):
        _tell(Opened.listed, "." if arguments[0] is None else arguments[0])
    elif event == "sqlite3.connect":
        for path in _database(arguments[0]):
            _tell(Opened.read, path)


def _tell(what: Callable[[Opened, Path], None], path: object) -> None:
    """Tell what notes. Nothing that goes wrong here may become an error of the work itself."""
    if not _noting or getattr(_busy, "now", False) or not isinstance(path, str | bytes | os.PathLike):
        return
    _busy.now = True  # what is read here is no event
    try:
        absolute = absolute_path(path)
        of_this_thread = _noting.get(threading.get_ident())
        for opened in [of_this_thread] if of_this_thread is not None else list(_noting.values()):
            what(opened, absolute)
    except (OSError, ValueError):
        pass
    finally:
        _busy.now = False


def _database(name: object) -> Iterator[str]:
    """The files of a database that is given by name, or as ``file:...``."""
    if isinstance(name, bytes | str | os.PathLike):
        text = os.fsdecode(name)
        path = unquote(urlsplit(text).path) if text.startswith("file:") else text
        yield from (f"{path}{suffix}" for suffix in _OF_A_DATABASE)
