"""Killed at any instruction and started again, a run ends as if nothing had happened.

`python -m benchmarks.attack kills` does this to whole programs with workers, at random moments and many times.
"""

import json
import shutil
import subprocess
import sys
from contextlib import nullcontext

import pytest
from tests.lean import with_findings, with_models

from tracknoise.exceptions import SettingsError
from tracknoise.experiments.execute import execute
from tracknoise.experiments.load import load_experiment
from tracknoise.tables.store import RunFolder

KILLER = '''
"""Run an experiment in new folders, killed before its first change on disk, before the ..., until it gets through."""
import os, shutil, signal, sys
from pathlib import Path
from tracknoise.experiments import execute as execution
from tracknoise.experiments.execute import execute
from tracknoise.experiments.load import load_experiment
from tracknoise.tables.store import RunFolder
from tracknoise.topics.catalogue import by_table

class Silent:
    def __getattr__(self, name):
        return lambda *arguments: None

def in_child(run, before):
    pid = os.fork()
    if pid == 0:
        def hook(event, arguments):
            nonlocal before
            changes = event in ("os.rename", "os.remove", "os.rmdir", "os.mkdir", "os.truncate") or (
                event == "open" and arguments[2] & (os.O_WRONLY | os.O_RDWR)
            )
            if changes and (str(arguments[0]).startswith(str(run.path)) or not os.path.isabs(str(arguments[0]))):
                before -= 1
                if before == 0:
                    os.kill(os.getpid(), signal.SIGKILL)
        if before:
            sys.addaudithook(hook)
        execute(experiment, run, listener=Silent(), fresh=fresh)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])

experiment, folder, there = load_experiment(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3])
step, fresh = int(sys.argv[4]), there.exists()
if sys.argv[5] == "unfound":
    execution.compute_findings = lambda run, _, statistics, **others: run.write_statistics(by_table(statistics))
before = 1
while True:
    run = RunFolder(folder / f"before-{before:03d}")
    if fresh:
        shutil.copytree(there, run.path)
    status = in_child(run, before)
    if status == 0:
        break
    assert status == -signal.SIGKILL, status
    assert run.lock_path.exists() or before < 3, "it was killed in the middle"
    assert in_child(run, None) == 0, before
    before += 1 if before < 3 else step
'''


@pytest.mark.parametrize(
    ("over", "scenes", "step", "kind"), [("nothing", 2, 200, "unfound"), ("another run", 1, 300, "found")]
)
def test_killed_before_any_change_on_disk_and_started_again(
    over, scenes, step, kind, shared_file, tmp_path, told, files
):
    """Once without findings, which are written to one folder with the statistics, and once with all that a run has."""
    data, file = shared_file(scenes), tmp_path / "x.toml"
    file.write_text(data.read_text().replace('poses = "stated"', "").replace('"data"', f'"{data.parent / "data"}"'))
    whole, there = RunFolder(tmp_path / "whole"), RunFolder(tmp_path / "there")
    experiment = load_experiment(file)
    assert experiment.truth.poses == "refined"
    with with_findings() if kind == "found" else nullcontext(), with_models():  # as in the processes that are killed
        execute(experiment, whole, listener=told())
    if over == "another run":
        execute(experiment.with_limits(scenes=None, frames=3), there, listener=told())
    command = [sys.executable, "-c", KILLER, file, tmp_path / "killed", there.path, str(step), kind]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    runs = [RunFolder(folder) for folder in sorted((tmp_path / "killed").iterdir())]
    assert len(runs) > 4
    for run in runs:
        assert files(run) == files(whole), run.path
        assert same(run) == same(whole), run.path
        names = {item.name for item in run.path.rglob("*") if item.is_file() and item.name.startswith(".")}
        assert not names, (run.path, names)


def same(run: RunFolder) -> dict:
    """The manifest without what is of the clock."""
    document = json.loads((run.path / "manifest.json").read_text())
    return {**document, "sequences": {key: {**e, "seconds": 0} for key, e in document["sequences"].items()}}


@pytest.mark.parametrize("name", ["observations", "moments", "snapshots", "statistics"])
def test_a_damaged_bit_is_repaired_by_the_next_start(name, finished, told, files):
    """A damaged sequence is measured again, and that one alone; damaged statistics are computed again."""
    experiment, run = finished(2)
    before = files(run)
    path = sorted((run.path / name).iterdir())[0]
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 8
    path.write_bytes(content)
    listener = told()
    execute(experiment, run, listener=listener)
    assert listener.keys == ([] if name == "statistics" else [path.stem])
    assert files(run) == before


def test_a_run_goes_on_with_the_libraries_it_was_begun_with(finished, told):
    experiment, run = finished(2)
    manifest = run.manifest()
    manifest.versions["polars"] = "1.0"
    run.write_manifest(manifest)
    execute(experiment, run, listener=told())  # nothing is to be measured
    shutil.rmtree(run.path / "moments")
    execute(experiment, run, listener=told())  # nothing is kept
    manifest.versions["polars"] = "1.0"
    run.write_manifest(manifest)
    (run.path / "moments" / "seq-01@default.parquet").unlink()
    with pytest.raises(SettingsError, match=r"run: polars 2.* is installed, expected 1.0 as the run was begun with"):
        execute(experiment, run, listener=told())


def test_what_a_worker_left_that_died_while_it_wrote_is_removed_in_the_same_run(
    finished, shared_file, tmp_path, told, files
):
    class Dying(type(told())):
        """Of the first sequence a worker has begun to write a table again."""

        def measured(self, key, entry):
            left = run.path / "increments" / f".{key}.parquet.30007.085d80dde0a8b2bb.tracknoise-unfinished"
            left.write_bytes(b"PAR1")
            super().measured(key, entry)

    (experiment, whole), run = finished(2), RunFolder(tmp_path / "run")
    execute(experiment, run, listener=Dying())
    assert not list(run.path.rglob(".*unfinished"))
    assert files(run) == files(whole)
