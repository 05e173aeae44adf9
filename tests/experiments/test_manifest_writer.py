"""The manifest of a run in progress."""

import json
from dataclasses import replace

import pytest

from tracknoise.exceptions import StoreError
from tracknoise.experiments import run_lock as ledger_module
from tracknoise.experiments.failures import Failure, FailureKind
from tracknoise.experiments.run_lock import ManifestWriter
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.manifest import Manifest, SequenceEntry
from tracknoise.tables.store import RunFolder

ENTRY = SequenceEntry(SequenceId("d", "a"), 10, 64, 48, "birth", 5, 1.5)
SECOND = replace(ENTRY, sequence=SequenceId("d", "b"))


class Clock:
    """Stands still but while the manifest is written, which takes a second."""

    def __init__(self):
        self.now = 100.0


@pytest.fixture
def clock(monkeypatch):
    clock, write = Clock(), RunFolder.write_manifest

    def slowly(run, manifest):
        write(run, manifest)
        clock.now += 1.0

    monkeypatch.setattr(RunFolder, "write_manifest", slowly)
    monkeypatch.setattr(ledger_module.time, "monotonic", lambda: clock.now)
    return clock


@pytest.fixture
def run(tmp_path):
    run = RunFolder(tmp_path / "run")
    run.create("", Manifest("hash", {}, {}, 0))
    return run


def test_it_is_written_at_once_then_in_a_twentieth_of_the_time_and_in_the_end(run, clock):
    with ManifestWriter(run, run.manifest()) as manifest_writer:
        manifest_writer.measured(ENTRY)
        clock.now += 19.9
        manifest_writer.write_if_due()
        assert run.manifest().sequences == {}
        clock.now += 0.2
        manifest_writer.write_if_due()
        assert list(run.manifest().sequences) == [ENTRY.key]
        manifest_writer.measured(SECOND)
        manifest_writer.write_if_due()
        assert list(run.manifest().sequences) == [ENTRY.key]
    assert list(run.manifest().sequences) == [ENTRY.key, SECOND.key]


def test_what_failed_is_in_the_manifest_and_in_a_file_of_its_own(run):
    with ManifestWriter(run, run.manifest()) as manifest_writer:
        manifest_writer.failed("x", Failure("no light", "a.png", FailureKind.permanent, attempts=1))
    assert run.manifest().failures == {"x": "no light"}
    line = {"sequence": "x", "cause": "no light", "place": "a.png", "attempts": 1}
    assert json.loads((run.path / "failures.jsonl").read_text()) == line


def test_a_run_that_is_interrupted_is_written_and_tells_of_the_interruption(run):
    with pytest.raises(KeyboardInterrupt), ManifestWriter(run, run.manifest()) as manifest_writer:  # noqa: PT012
        manifest_writer.measured(ENTRY)
        raise KeyboardInterrupt
    assert list(run.manifest().sequences) == [ENTRY.key]


@pytest.mark.parametrize("error", [None, ZeroDivisionError])
def test_what_ended_the_run_is_told_rather_than_that_it_cannot_be_written(error, run):
    with pytest.raises(error or StoreError), ManifestWriter(run, run.manifest()):  # noqa: PT012
        run.path.rename(run.path.parent / "moved")
        run.path.touch()
        if error:
            raise error
