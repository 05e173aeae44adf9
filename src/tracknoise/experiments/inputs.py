"""Files that the numbers of a sequence depend on: a change in them makes its measurement stale.

While a sequence is measured, every file that is read is recorded with a checksum of its content, and so are the source
files of plug-ins. Before a run is resumed, the files are compared with what was recorded. Where a program reads files
that are not known, the sequence is measured again. Paths below the folder of the
data are relative to it, so that data can be moved.
"""

import hashlib
import os
import sys
import sysconfig
import tempfile
from collections.abc import Iterable, Iterator
from collections.abc import Sequence as Items
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import polars as pl

from tracknoise.exceptions import TracknoiseError
from tracknoise.experiments.load import option_paths, tracker_paths
from tracknoise.experiments.plan import Task, open_batch
from tracknoise.experiments.settings import Experiment
from tracknoise.measurement.tracking import Progress
from tracknoise.opened_files import FileState, Opened, absolute_path, content_of, noting, stat_of
from tracknoise.options import PathTemplate
from tracknoise.plugins import CODE, Plugins
from tracknoise.sequences.reader_registry import READERS
from tracknoise.sequences.sequence import Sequence, files_of
from tracknoise.tables.enumerations import InputKind
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.schema import INPUTS
from tracknoise.tables.store import RunFolder
from tracknoise.text import counted
from tracknoise.trackers.tracker_registry import TRACKERS
from tracknoise.truth.truth_registry import TRUTHS

_SMALL_BYTES = 1 << 20
"""Largest size of a file that is always compared by content."""
_CODE, _PACKAGED = CODE, (".dist-info", ".egg-info")
_WRITTEN_BY_READERS = ("-shm", ".pyc")
"""How files end in which SQLite notes who reads a database, and Python what it has compiled; they hold no data."""
_SYSTEM = ("/proc", "/sys", "/dev", "/etc", "/usr")


@dataclass(slots=True)
class InputRecorder:
    """Records what a batch reads, while it is measured."""

    opened: Opened  # what was read so far
    # number of frames of each sequence as its reader opened it
    frames: dict[SequenceId, int] = field(default_factory=dict)
    stated: set[Path] = field(default_factory=set)  # files that the sequences state

    def recorded(self, sequence: Sequence) -> Sequence:
        """Note a sequence as its reader opened it, and return it."""
        self.frames[sequence.id] = len(sequence)
        self.stated |= {absolute_path(path) for path in files_of(sequence)}
        return sequence

    def following(self, progress: Progress | None) -> Progress:
        """Report progress as `progress` does, and note that the first frame was read."""

        def follow(done: int, total: int) -> None:
            self.opened.started()
            if progress is not None:
                progress(done, total)

        return follow


@contextmanager
def recording(batch: list[Task], run: RunFolder) -> Iterator[InputRecorder]:
    """Record what this thread reads, for the tasks of a batch, and the files that their options name."""
    sources = _sources(batch[0].experiment)  # refuses code that is not what was loaded
    named = {absolute_path(path) for path in _expanded(batch, option_paths(batch[0].experiment))}
    of_trackers = _tracker_folders(batch)
    with noting(_Counts(_root(batch[0]), named, of_trackers, absolute_path(run.path))) as opened:
        for path in sorted(named):
            if path.is_file() or (path.is_dir() and (sources or path in of_trackers)):
                opened.read(path)  # compiled code, such as that of a plug-in, may read it
        yield InputRecorder(opened)


def input_tables(batch: list[Task], recorder: InputRecorder, sequences: Items[Sequence]) -> list[pl.DataFrame]:
    """The table `INPUTS` of each task of a batch that was measured.

    Compiled code, such as that of OpenCV, opens files that are not noted. If reading a frame of another package's
    reader notes no file, all files of its folders count, unless the sequence states its files.
    """
    opened, root, experiment = recorder.opened, _root(batch[0]), batch[0].experiment
    unseen = (
        bool(READERS.sources(experiment.dataset.reader)) and not recorder.stated and _reads_unseen(sequences[0], opened)
    )
    for path in sorted(recorder.stated):
        opened.read(path)
    if unseen and root is not None:
        _read_unseen(opened, root)
    rows = [_file_row(path, state, root, always=path in opened.early) for path, state in opened.files.items()]
    listed = [folder for folder in (root, *_tracker_folders(batch)) if folder is not None]
    watched = {path.parent for path in opened.files if any(path.parent.is_relative_to(folder) for folder in listed)}
    rows += [_row(InputKind.unknown, Path(what), None) for what in sorted(opened.unknown)]
    rows += [_row(InputKind.folder, path, root, content=_names(path)) for path in watched]
    rows += [_row(InputKind.code, name, None, content=content) for name, content in _sources(experiment)]
    return [
        pl.DataFrame(
            [*rows, _row(InputKind.frames, Path(), None, size=recorder.frames.get(task.recorded, 0))],
            schema=dict(INPUTS),
            orient="row",
        ).sort("kind", "in_data", "path")
        for task in batch
    ]


def digest_of(table: pl.DataFrame) -> str:
    """Hexadecimal SHA-256 of what a sequence was measured from: paths and contents, without times and folders."""
    kept = table.filter(pl.col("kind") != InputKind.folder).drop("mtime_ns")
    return hashlib.sha256(repr(kept.rows()).encode()).hexdigest()


@dataclass(slots=True)
class InputCheck:
    """Compares the files of measured sequences with what was recorded.

    Files are compared by size and time of modification, and by content where the time differs. Small files that are
    read before the second frame, such as poses and cameras, are always compared by content.
    """

    run: RunFolder  # the run folder
    verify: bool = False  # compare all files by content
    _contents: dict[Path, str | None] = field(default_factory=dict)
    _sources: list[tuple[Path, str]] | None = None

    def change(self, task: Task, entry: SequenceEntry) -> str | None:
        """What changed since a sequence was measured, in a few words; None if nothing did.

        Times of modification and names in folders that differ, although the same is read, are recorded anew.
        """
        table = self.run.inputs(task.key)
        if table is None or digest_of(table) != entry.inputs:
            return "the files that it was measured from are not recorded"
        root = _root(task)
        changed: list[str] = []
        now = []
        for row in table.iter_rows(named=True):
            path = _path_of(row, root)
            if row["kind"] == InputKind.file:
                row["mtime_ns"] = self._unchanged_since(path, row)
                if row["mtime_ns"] is None:
                    changed.append(f"{path} {'changed' if path.is_file() else 'is missing'}")
            elif row["kind"] == InputKind.folder:
                row["content"] = _names(path)
            elif row["kind"] == InputKind.unknown:
                changed.append(f"which files {path} reads is not known; its `inputs` can state them")
            elif row["kind"] == InputKind.code and (path, row["content"]) not in self._sources_of(task):
                changed.append(f"the source file {path} of a plug-in changed")
            now.append(tuple(row.values()))
        if changed:
            return changed[0] + _further(len(changed) - 1)
        current = pl.DataFrame(now, schema=dict(INPUTS), orient="row")
        if current.equals(table):
            return None
        are_folders = pl.col("kind") == InputKind.folder
        if not current.filter(are_folders).equals(table.filter(are_folders)):
            difference = self._difference(task, table)
            if difference is not None:
                return difference
        self.run.write_inputs(task.key, current)
        return None

    def _difference(self, task: Task, table: pl.DataFrame) -> str | None:
        """What a sequence reads now beside what is recorded, or how many more frames it has; None if nothing."""
        try:
            with recording([task], self.run) as reads:
                open_batch([task], change=reads.recorded)
        except TracknoiseError as error:
            return str(error)
        root = _root(task)
        recorded = {_path_of(row, root) for row in table.iter_rows(named=True) if row["kind"] == InputKind.file}
        added = sorted(reads.opened.files.keys() - recorded)
        if added:
            return f"{added[0]} was added{_further(len(added) - 1)}"
        before = table.filter(pl.col("kind") == InputKind.frames)["size"].item()
        frames = reads.frames.get(task.recorded, 0)
        return None if frames == before else f"it has {counted(frames, 'frame')}, not {before}"

    def _sources_of(self, task: Task) -> list[tuple[Path, str]]:
        """Source files of plug-ins, and their hashes; the same for all tasks of an experiment."""
        if self._sources is None:
            self._sources = _sources(task.experiment)
        return self._sources

    def _unchanged_since(self, path: Path, row: dict[str, Any]) -> int | None:
        """When a file was last modified, nanoseconds, if it has the recorded content; None if not."""
        status = stat_of(path)
        if status is None or status[0] != row["size"]:
            return None
        is_same = status[1] == row["mtime_ns"] and not row["always"] and not (self.verify and row["content"])
        return status[1] if is_same or self._content(path) == row["content"] else None

    def _content(self, path: Path) -> str | None:
        """Hash of a file, which is read once however many sequences depend on it."""
        if path not in self._contents:
            self._contents[path] = content_of(path)
        return self._contents[path]


@dataclass(frozen=True, slots=True)
class _Counts:
    """Which files count: those of the data and of options, others that belong neither to a program nor the system."""

    root: Path | None  # folder of the data
    named: set[Path]  # files and folders that options name
    of_trackers: set[Path]  # folders that options of trackers name: code in them counts too
    run: Path  # the run folder

    def __call__(self, path: Path) -> bool:
        if path in self.named:  # a script that an option names too
            return True
        if path.is_relative_to(self.run) or path.name.endswith(_WRITTEN_BY_READERS):
            return False
        if any(path.is_relative_to(folder) for folder in self.of_trackers):
            return True
        if path.suffix in _CODE or path.parent.suffix in _PACKAGED:
            return False
        if any(path.is_relative_to(place) for place in (self.root, *self.named) if place is not None):
            return True
        return not any(path.is_relative_to(place) for place in _not_data())


@cache
def _not_data() -> tuple[Path, ...]:
    """Folders of programs, of the system and of temporary files."""
    settings = (str(Path.home() / name) for name in (".cache", ".config", ".local"))
    programs = (sys.prefix, sys.base_prefix, *sysconfig.get_paths().values(), str(Path(__file__).parents[1]))
    folders = (*_SYSTEM, *programs, *settings, tempfile.gettempdir())
    return tuple(dict.fromkeys(absolute_path(folder) for folder in folders))


def _reads_unseen(sequence: Sequence, opened: Opened) -> bool:
    """Whether the image or the depth of a frame comes from no file that can be noted."""
    for read in (sequence.image, sequence.depth):
        with noting(opened.counts) as again:
            content = read(0)
        if content is not None and not again.files:
            return True
    return False


def _read_unseen(opened: Opened, root: Path) -> None:
    """Note all files in the folders that were listed or read from, and below them, except below that of all data."""
    folders = {folder for folder in opened.folders if folder.is_relative_to(root)}
    if folders <= {root}:
        opened.read(root, most=_SMALL_BYTES)
        return
    for folder in sorted(folders - {root}):
        opened.read(folder, most=_SMALL_BYTES)
    for path in sorted(root.iterdir()):
        if path.is_file():
            opened.read(path, most=_SMALL_BYTES)


def _tracker_folders(batch: list[Task]) -> set[Path]:
    """Folders that options of the trackers name, such as of tracks, all of whose files count."""
    paths = map(absolute_path, _expanded(batch, tracker_paths(batch[0].experiment)))
    return {path for path in paths if path.is_dir()}


def _expanded(batch: list[Task], paths: Iterable[Path | PathTemplate]) -> Iterator[Path]:
    """Paths among the options; of a template, the file of each speed."""
    for path in paths:
        if isinstance(path, Path):
            yield path
        else:
            yield from (task.sequence.expand(path, speed=speed) for task in batch for speed in task.speeds)


def _root(task: Task) -> Path | None:
    root = task.experiment.dataset.root
    return None if root is None else absolute_path(root)


def _plugins(experiment: Experiment) -> Iterator[tuple[Plugins[Any], str]]:
    """Everything that another package may offer, by its registry and name."""
    yield READERS, experiment.dataset.reader
    yield from ((TRACKERS, choice.kind) for choice in experiment.trackers)
    if experiment.truth.kind:
        yield TRUTHS, experiment.truth.kind


def _sources(experiment: Experiment) -> list[tuple[Path, str]]:
    """Source files of plug-ins: path from the folder of the package, and hash."""
    sources = {
        path.relative_to(folder): content or ""
        for plugins, name in _plugins(experiment)
        for folder, hashes in plugins.sources(name).items()
        for path, content in hashes.items()
    }
    return sorted(sources.items())


def _file_row(path: Path, state: FileState | None, root: Path | None, *, always: bool) -> tuple[Any, ...]:
    """Row of a file; of one that changed while it was read, a row that no file fits."""
    if state is None:
        return _row(InputKind.file, path, root, always=True)
    small = state.size <= _SMALL_BYTES
    return _row(
        InputKind.file,
        path,
        root,
        always=always and small,
        size=state.size,
        mtime_ns=state.mtime_ns,
        content=state.content,
    )


def _row(
    kind: InputKind,
    path: Path,
    root: Path | None,
    *,
    always: bool = False,
    size: int = -1,
    mtime_ns: int | None = None,
    content: str = "",
) -> tuple[Any, ...]:
    """Row of the table `INPUTS`."""
    in_data = root is not None and path.is_relative_to(root)
    kept = path.relative_to(root) if root is not None and in_data else path
    return kind, in_data, os.fsencode(kept), always, size, mtime_ns, content


def _path_of(row: dict[str, Any], root: Path | None) -> Path:
    path = Path(os.fsdecode(row["path"]))
    return root / path if row["in_data"] and root is not None else path


def _names(folder: Path) -> str:
    """Hexadecimal SHA-256 of the names in a folder; empty if it cannot be listed."""
    try:
        names = sorted(os.fsencode(name) for name in os.listdir(folder))  # noqa: PTH208 (names alone)
    except OSError:
        return ""
    return hashlib.sha256(b"\0".join(names)).hexdigest()


def _further(count: int) -> str:
    return f", and {counted(count, 'other file')}" if count else ""
