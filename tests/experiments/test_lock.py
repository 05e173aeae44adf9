"""One start at a time in a run folder, and nobody locked out by a dead one."""

import errno
import fcntl
import json
import os
import pickle
import signal
import socket
import subprocess
import sys
from dataclasses import replace

import pytest

from tracknoise.exceptions import StoreError
from tracknoise.experiments.run_lock import hold
from tracknoise.tables.store import RunFolder

HOLDER = """
import sys, time
from pathlib import Path
from tracknoise.experiments.run_lock import hold
from tracknoise.tables.store import RunFolder
with hold(RunFolder(Path(sys.argv[1]))):
    print("held", flush=True)
    time.sleep(100)
"""


@pytest.fixture
def run(tmp_path) -> RunFolder:
    return RunFolder(tmp_path / "runs" / "run")


@pytest.fixture
def holder(run):
    """Another process that holds the folder."""
    process = subprocess.Popen([sys.executable, "-c", HOLDER, run.path], stdout=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stdout.readline() == b"held\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def write_holder(run: RunFolder, **names) -> None:
    run.path.mkdir(parents=True, exist_ok=True)
    run.lock_path.write_text(json.dumps({"pid": 1, "host": socket.gethostname(), "token": "x", **names}))


def test_a_second_start_is_refused_naming_process_and_host(run, holder):
    expected = rf"{run.path}: in use by process {holder.pid} on {socket.gethostname()}, expected"
    with pytest.raises(StoreError, match=expected), hold(run):
        pass
    assert json.loads(run.lock_path.read_text())["pid"] == holder.pid, "the refused start left the lock alone"


def test_a_lock_that_is_damaged_locks_nobody_out(run):
    run.path.mkdir(parents=True)
    for content in ("[" * 100_000, "{", '"text"', "[1]", '{"a": 1}'):
        run.lock_path.write_text(content)
        with hold(run):
            assert json.loads(run.lock_path.read_text())["pid"] == os.getpid()


def test_the_lock_of_a_killed_process_is_taken_over(run, holder):
    holder.kill()
    holder.wait()
    assert json.loads(run.lock_path.read_text())["pid"] == holder.pid
    with hold(run):
        assert json.loads(run.lock_path.read_text())["pid"] == os.getpid()


def test_the_lock_is_gone_afterwards_whatever_happened(run):
    with pytest.raises(ZeroDivisionError), hold(run):
        raise ZeroDivisionError
    assert list(run.path.iterdir()) == []


def test_the_same_process_is_refused_too(run):
    with hold(run), pytest.raises(StoreError, match=f"process {os.getpid()}"), hold(run):
        pass


def test_the_lock_of_another_host_is_refused_with_how_to_remove_it(run):
    write_holder(run, pid=123, host="elsewhere")
    with pytest.raises(StoreError, match=rf"process 123 on elsewhere, .*, delete {run.lock_path}"), hold(run):
        pass
    assert run.lock_path.exists()
    run.lock_path.unlink()
    with hold(run):
        pass


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"pid": 1}'])
def test_a_lock_that_its_process_died_in_writing_is_taken_over(run, content):
    run.path.mkdir(parents=True)
    run.lock_path.write_bytes(content)
    with hold(run):
        pass


def without_locks(descriptor, operation):
    raise OSError(errno.ENOLCK, "No locks available")


def test_without_locks_in_the_file_system_the_process_is_looked_for(run, monkeypatch):
    monkeypatch.setattr(fcntl, "flock", without_locks)
    write_holder(run, pid=os.getppid())
    with pytest.raises(StoreError, match=f"process {os.getppid()} on .*delete"), hold(run):
        pass
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    write_holder(run, pid=dead.pid)
    with hold(run):
        pass


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="file/run: cannot be written"), hold(RunFolder(tmp_path / "file" / "run")):
        pass


def test_a_claim_stands_as_long_as_the_start_that_made_it(run):
    with hold(run) as first:
        claim = replace(pickle.loads(pickle.dumps(first)), patience_s=0)
        claim.check()
    with pytest.raises(StoreError, match="not held by this run"):
        claim.check()
    with hold(run) as second:
        second.check()
        with pytest.raises(StoreError, match=f"as seen from {socket.gethostname()}"):
            claim.check()


def test_an_interruption_while_the_lock_is_given_back_comes_after_that(run, monkeypatch):
    """As of a second Ctrl-C."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    same = os.path.samestat

    def interrupted(*states):
        os.kill(os.getpid(), signal.SIGINT)
        return same(*states)

    with pytest.raises(KeyboardInterrupt), hold(run):
        monkeypatch.setattr(os.path, "samestat", interrupted)
    assert list(run.path.iterdir()) == []
