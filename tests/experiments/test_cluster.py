"""Measured by several processes, some of which are killed: a run ends as if one had done it all in peace."""

import os
import queue
import re
import signal
import socket
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import cv2
import psutil
import pytest
from distributed import Client

from tracknoise.exceptions import SettingsError, StoreError
from tracknoise.experiments.execute import execute
from tracknoise.experiments.failures import FailureKind
from tracknoise.experiments.local_workers import measure_locally
from tracknoise.experiments.plan import batches, plan
from tracknoise.experiments.resume import new_manifest
from tracknoise.experiments.run_lock import hold
from tracknoise.experiments.task import Job, attempt
from tracknoise.tables.store import RunFolder

pytestmark = pytest.mark.usefixtures("pipes_are_files", "lean")

CLI = "from distributed.cli.dask_{0} import main; main()"


@pytest.fixture
def scheduler(tmp_path):
    """Starts a scheduler and two workers, each a process of its own; gives its address and the workers."""
    processes = []

    def start(name, *arguments):
        command = [sys.executable, "-c", CLI.format(name), *arguments]
        log = (tmp_path / f"{name}-{len(processes)}.log").open("wb")
        with log:
            processes.append(subprocess.Popen(command, stdout=log, stderr=log, cwd=tmp_path))
        return processes[-1]

    where = tmp_path / "scheduler.json"
    start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", where)
    options = ("--scheduler-file", where, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--death-timeout", "60")
    workers = [start("worker", *options, "--local-directory", tmp_path) for _ in range(2)]
    with Client(scheduler_file=str(where), timeout=60) as client:
        client.wait_for_workers(2, timeout=60)
        yield client.scheduler.address, workers
    for process in processes:
        process.kill()
        process.wait()


@pytest.fixture
def peaceful(scenes, tmp_path, told):
    """Two scenes, and the run of them in peace."""
    experiment, whole = scenes(2), RunFolder(tmp_path / "whole")
    execute(experiment, whole, listener=told())
    return experiment, whole


@pytest.fixture
def killed(peaceful, tmp_path):
    """The worker that is killed in the middle of the second scene, as soon as it is known.

    An image is a pipe until it is opened. The worker that opened it waits for bytes when it is killed.
    """
    image, content, victims = tmp_path / "data/seq-02/frame-000002.color.png", tmp_path / "image.png", queue.Queue()
    image.rename(content)
    os.mkfifo(image)

    def kill():
        with image.open("wb"):
            (victim,) = [child for child in psutil.Process().children(recursive=True) if reads(child, image)]
            content.rename(image)
            victim.kill()
        victims.put(victim.pid)

    threading.Thread(target=kill, daemon=True).start()
    return lambda: victims.get(timeout=60)


def reads(process: psutil.Process, path: Path) -> bool:
    return str(path) in map(os.path.realpath, Path(f"/proc/{process.pid}/fd").iterdir())


def test_a_scheduler_with_two_workers_one_of_which_is_killed(scheduler, peaceful, killed, tmp_path, told, files):
    (address, workers), (experiment, whole) = scheduler, peaceful
    run, listener = RunFolder(tmp_path / "run"), told()
    outcome = execute(experiment, run, listener=listener, scheduler=address)
    assert {worker.pid: worker for worker in workers}[killed()].wait(timeout=60) == -signal.SIGKILL
    assert outcome.failures == {}
    assert files(run) == files(whole)
    assert listener.remarks[0] == f"scheduler {address}: 2 workers"


def test_a_local_worker_that_is_killed(peaceful, killed, tmp_path, told, files):
    experiment, whole = peaceful
    run, listener = RunFolder(tmp_path / "run"), told()
    outcome = execute(experiment, run, listener=listener, workers=2)
    assert not psutil.pid_exists(killed())
    assert outcome.failures == {}
    assert files(run) == files(whole)
    (retried,) = listener.remarks
    assert retried == "seq-02@default: the worker died while measuring it (killed, or out of memory); retrying"
    assert spawned() == []


def spawned() -> list[psutil.Process]:
    """The workers of this process that run."""
    children = psutil.Process().children(recursive=True)
    running = [child for child in children if child.status() != psutil.STATUS_ZOMBIE]
    return [child for child in running if "spawn_main" in " ".join(child.cmdline())]


def test_local_workers_load_every_library_with_one_thread():
    """`os.getenv` is the job here, and variables are the batches."""
    names = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS"]
    assert dict(measure_locally(os.getenv, names, workers=1)) == dict.fromkeys(names, "1")


def test_a_batch_that_kills_its_worker_is_a_failure_that_names_it():
    """`os._exit` is the job here, and exit codes are the batches."""
    results = list(measure_locally(os._exit, [3, 4], workers=1))
    assert [batch for batch, _ in results] == [3, 4]
    assert {(result.kind, result.attempts) for _, result in results} == {(FailureKind.transient, 1)}
    assert all(re.fullmatch(r"worker process \d+", result.place) for _, result in results)
    assert [result.cause for _, result in results] == [
        f"the worker ended with exit status {status} while measuring it" for status in (3, 4)
    ]


@pytest.mark.parametrize(
    ("address", "reason"),
    [("nonsense", "missing port number"), ("carrier://pigeon:1", "unknown address scheme"), ("tcp://x:port", "port")],
)
def test_an_address_that_is_none_is_one_line_and_leaves_nothing(address, reason, scenes, tmp_path, told):
    run = RunFolder(tmp_path / "run")
    with pytest.raises(SettingsError, match=rf"scheduler {address}: cannot be reached \(.*{reason}"):
        execute(scenes(1), run, listener=told(), scheduler=address)
    assert not run.lock_path.exists()
    assert run.manifest().sequences == {}


def test_without_the_extra_a_scheduler_is_refused_in_one_line(scenes, tmp_path, told, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)  # as if it were not installed
    run, address = RunFolder(tmp_path / "run"), "tcp://127.0.0.1:8786"
    missing = rf"^scheduler {address}: needs the extra `cluster`: pip install 'tracknoise\[cluster\]'$"
    with pytest.raises(SettingsError, match=missing):
        execute(scenes(1), run, listener=told(), scheduler=address)
    assert not run.lock_path.exists()


def test_local_workers_need_no_extra():
    """`abs` is the job here, and numbers are the batches."""
    code = (
        "import sys\nsys.modules.update(dask=None, distributed=None)\n"
        "from tracknoise.experiments.execute import execute\n"
        "from tracknoise.experiments.local_workers import measure_locally\n"
        "if __name__ == '__main__': print(list(measure_locally(abs, [-3], workers=2)))"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == "[(-3, 3)]"


@pytest.fixture
def threads():
    """A worker sets the count of OpenCV's threads for good."""
    before = cv2.getNumThreads()
    yield
    cv2.setNumThreads(before)


@pytest.mark.usefixtures("threads")
def test_a_worker_pins_threads_and_refuses_other_libraries_and_other_folders(scenes, tmp_path):
    run, experiment = RunFolder(tmp_path / "run"), scenes(1)
    (batch,) = batches(plan(experiment))
    versions = new_manifest(experiment).versions
    with hold(run) as claim:
        cv2.setNumThreads(2)
        (entry,) = Job(run, claim, versions, False)(batch)
        assert cv2.getNumThreads() == 1
        assert run.has_sequence(entry)
        with pytest.raises(SettingsError, match=rf"worker on {socket.gethostname()}: polars .* expected 1.0"):
            Job(run, claim, {**versions, "polars": "1.0"}, False)(batch)
        with pytest.raises(StoreError, match="expected the same folder on every machine"):
            Job(run, replace(claim, path=tmp_path / "elsewhere", patience_s=0), versions, False)(batch)


def test_a_worker_whose_program_is_gone_writes_nothing(scenes, tmp_path):
    run = RunFolder(tmp_path / "run")
    (batch,) = batches(plan(scenes(1)))
    with hold(run) as first:
        claim = replace(first, patience_s=0)
    with hold(run):
        result = attempt(batch, run, claim=claim)
        assert result.kind is FailureKind.fatal
        assert [path.name for path in run.path.iterdir()] == [run.lock_path.name]
