"""Runs that are killed while a program of the user works for them: neither it nor its folder is left."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
from tests.writers.program import PROGRAM, small_experiment

HANGS = """
import os, sys, time
from pathlib import Path
at = Path({at!r})
for leaves in (False, True):
    if os.fork() == 0:
        if leaves:
            os.setsid()
            if os.fork():
                os._exit(0)
        break
(at / str(os.getpid())).touch()
time.sleep(600)
"""
TRACKER = 'kind = "external"\noptions = {{ command = [{python!r}, "-S"], script = "hangs.py", timeout_s = 500 }}'
EACH = 3
"""The program, its child, and a process that left its group and its session."""


@pytest.fixture
def started(tmp_path):
    """Starts a run with some workers, and waits for its programs; the run and these processes."""
    (tmp_path / "hangs.py").write_text(HANGS.format(at=str(tmp_path / "pids")))
    (tmp_path / "x.toml").write_text(small_experiment(TRACKER.format(python=sys.executable)))
    (tmp_path / "go.py").write_text(PROGRAM)
    for name in ("pids", "temporary"):
        (tmp_path / name).mkdir()
    runs, programs = [], []

    def start(workers: int, *options: str) -> tuple[subprocess.Popen[bytes], list[psutil.Process]]:
        command = [sys.executable, tmp_path / "go.py", "run", tmp_path / "x.toml", "--out", tmp_path / "run"]
        environment = {**os.environ, "TMPDIR": str(tmp_path / "temporary")}
        runs.append(
            subprocess.Popen(
                [*command, "--workers", str(workers), "--no-report", "--quiet", *options],
                env=environment,
                stderr=subprocess.PIPE,
            )
        )
        while len(names := [path.name for path in (tmp_path / "pids").iterdir()]) < EACH * workers:
            assert runs[-1].poll() is None, runs[-1].communicate()
            time.sleep(0.05)
        programs.extend(psutil.Process(int(name)) for name in names)
        return runs[-1], programs

    yield start
    for run in runs:
        run.kill()
        run.wait()
        run.stderr.close()
    for program in programs:
        with suppress(psutil.NoSuchProcess):
            program.kill()


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a program that leaves its process group is not ended")
@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_run_that_is_killed_leaves_no_program_and_no_folder(started, tmp_path, number, workers):
    run, programs = started(workers)
    assert list((tmp_path / "temporary").iterdir()) != []
    run.send_signal(number)
    run.communicate()
    assert psutil.wait_procs(programs, timeout=60)[1] == []
    for _ in range(600):
        if not any((tmp_path / "temporary").iterdir()):
            break
        time.sleep(0.1)
    assert list((tmp_path / "temporary").iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a program that leaves its process group is not ended")
def test_a_worker_that_is_killed_leaves_no_program_and_no_folder(started):
    run, programs = started(2)
    (guard, other) = {Path(program.cwd()): guard_of(program) for program in programs}.items()
    guard[1].parent().kill()
    ended = [program for program in programs if Path(program.cwd()) == guard[0]]
    assert len(ended) == EACH
    assert psutil.wait_procs([guard[1], *ended], timeout=60)[1] == []
    assert not guard[0].exists()
    assert other[0].exists()
    assert run.poll() is None


def test_a_guard_that_is_killed_leaves_neither_the_group_of_its_program_nor_its_folder(started, tmp_path):
    run, programs = started(1, "--scenes", "1")
    guard = guard_of(programs[0])
    group = [program for program in programs if os.getsid(program.pid) == guard.children()[0].pid]
    assert len(group) == EACH - 1
    guard.kill()
    assert psutil.wait_procs([guard, *group], timeout=60)[1] == []
    assert b"the process that watches it was killed" in run.communicate()[1]
    assert list((tmp_path / "temporary").iterdir()) == []


def guard_of(program: psutil.Process) -> psutil.Process:
    """The process above a program that watches it."""
    return next(above for above in program.parents() if "guarded_folder" in " ".join(above.cmdline()))
