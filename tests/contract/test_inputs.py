"""What every reader's measurements depend on: each file that is read, and nothing else.

Each file of a kind (by folder and extension, without numbers) is changed in one byte. Data sets are those of
`tests.contract.test_sequences`.
"""

import os
import re
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from tests.contract.test_sequences import LAYOUTS

from tracknoise.experiments.inputs import InputCheck, digest_of, input_tables, recording
from tracknoise.experiments.plan import Task, open_batch, plan
from tracknoise.experiments.settings import parse_experiment
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import RunFolder

WITH_FILES = sorted(set(LAYOUTS) - {"simulated", "tape"})
"""Readers of files. That of another package is in `tests/test_plugins.py`."""
NOT_READ = {"colmap": {f"scene/sparse/#/{name}.bin" for name in ("points#D", "frames", "rigs")}}
"""Kinds of files that a reader has no use for."""


@dataclass
class Measured:
    """A data set, and the record of what was read from it."""

    root: Path
    run: RunFolder
    task: Task
    entry: SequenceEntry

    def change(self, *, verify: bool = False, root: Path | None = None) -> str | None:
        task = replace(self.task, experiment=self.task.experiment.with_root(root or self.root))
        return InputCheck(self.run, verify=verify).change(task, self.entry)


def read_all(task: Task, run: RunFolder) -> SequenceEntry:
    """Read everything of a sequence, as measuring does."""
    with recording([task], run) as recorder:
        progress = recorder.following(None)
        (sequence,) = open_batch([task], change=recorder.recorded)
        assert sequence.scan is None or len(sequence.scan.points_world)
        for index in range(len(sequence)):
            sequence.image(index)
            sequence.depth(index)
            progress(index + 1, len(sequence))
        (table,) = input_tables([task], recorder, [sequence])
    run.write_inputs(task.key, table)
    entry = SequenceEntry(task.sequence, len(sequence), 1, 1, "birth", 0, 0.0)
    return replace(entry, inputs=digest_of(table))


@pytest.fixture(scope="module", params=WITH_FILES)
def measured(request, tmp_path_factory) -> Measured:
    root = tmp_path_factory.mktemp("data") / "set"
    root.mkdir()
    written = LAYOUTS[request.param](root, 3)
    text = f'name = "x"\n[dataset]\nreader = "{request.param}"\nroot = "{root}"\n[[trackers]]\nkind = "lucas-kanade"\n'
    tasks = [task for task in plan(parse_experiment(text, place="x")) if task.sequence.lighting == written.lighting]
    run = RunFolder(tmp_path_factory.mktemp("run"))
    return Measured(root, run, tasks[0], read_all(tasks[0], run))


def files_of_kinds(root: Path) -> dict[str, list[Path]]:
    kinds: dict[str, list[Path]] = {}
    for path in sorted(item for item in root.rglob("*") if item.is_file()):
        kinds.setdefault(re.sub(r"\d+", "#", str(path.relative_to(root))), []).append(path)
    return kinds


def flip(path: Path, *, keep_time: bool) -> bytes:
    """Change a byte in the middle of a file, and return what was there."""
    before, status = path.read_bytes(), path.stat()
    middle = len(before) // 2
    path.write_bytes(before[:middle] + bytes([before[middle] ^ 1]) + before[middle + 1 :])
    if keep_time:
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    return before


def test_a_byte_of_any_kind_of_file_is_noticed_and_the_file_named(measured):
    assert measured.change() is None
    for kind, paths in files_of_kinds(measured.root).items():
        noticed = set()
        for path in dict.fromkeys((paths[0], paths[len(paths) // 2], paths[-1])):
            before = flip(path, keep_time=False)
            change = measured.change()
            path.write_bytes(before)
            if change is not None:
                assert change == f"{path} changed"
                noticed.add(path)
        assert noticed or kind in NOT_READ.get(measured.task.experiment.dataset.reader, ()), kind
        assert measured.change() is None


def test_small_files_read_before_the_frames_are_compared_by_content(measured):
    """Images and depth maps only if asked."""
    table = measured.run.inputs(measured.task.key)
    always = {bytes(row["path"]).decode() for row in table.filter("always").iter_rows(named=True)}
    frames = {bytes(row["path"]).decode() for row in table.filter(kind="file", always=False).iter_rows(named=True)}
    assert always
    for name in (min(always), max(always)):
        before = flip(measured.root / name, keep_time=True)
        assert measured.change() == f"{measured.root / name} changed"
        (measured.root / name).write_bytes(before)
    for name in sorted(frames)[:2]:
        before = flip(measured.root / name, keep_time=True)
        assert measured.change() is None
        assert measured.change(verify=True) == f"{measured.root / name} changed"
        (measured.root / name).write_bytes(before)
    assert measured.change(verify=True) is None


def test_touched_copied_and_further_files_change_nothing(measured, tmp_path):
    for path in measured.root.rglob("*"):
        os.utime(path)
    assert measured.change() is None
    copy = tmp_path / "elsewhere" / "set"
    shutil.copytree(measured.root, copy, copy_function=shutil.copyfile)
    assert measured.change(root=copy) is None
    for folder in [measured.root, *(path for path in measured.root.rglob("*") if path.is_dir())]:
        (folder / "README.md").write_text("nothing that is read")
    assert measured.change() is None
    for path in measured.root.rglob("README.md"):
        path.unlink()
    assert measured.change() is None


def test_a_removed_file_is_named(measured):
    table = measured.run.inputs(measured.task.key)
    names = [bytes(path).decode() for path in table.filter(kind="file")["path"]]
    for name in (names[0], names[-1]):
        path = measured.root / name
        before = path.read_bytes()
        path.unlink()
        assert measured.change() == f"{path} is missing"
        path.write_bytes(before)
    assert measured.change() is None
