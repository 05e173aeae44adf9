"""Worker processes on this machine: what ends them, what a program does then, and who can connect to them."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
from tests.experiments.local_jobs import allocate, announce, crash, refuse, status_of, survive_in

from tracknoise import processes as signals
from tracknoise.exceptions import DataError, SettingsError
from tracknoise.experiments import local_workers
from tracknoise.experiments.execute import execute
from tracknoise.experiments.local_workers import Worker, WorkerDiedError, beside, measure_locally
from tracknoise.tables.store import RunFolder

pytestmark = pytest.mark.usefixtures("pipes_are_files")

STRANGER = """
import os, socket, sys
if os.getuid() == 0:
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
for address in sys.argv[1:]:
    host, port = address.rsplit(":", 1)
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as stranger:
        stranger.settimeout(2)
        print("connected" if stranger.connect_ex((host, int(port))) == 0 else "refused")
"""


def test_a_crash_names_the_signal_and_the_file(tmp_path):
    (tmp_path / "damaged.mat").write_bytes(b"x")
    ((_, failure),) = measure_locally(crash, [str(tmp_path / "damaged.mat")], workers=2)
    assert failure.place == str(tmp_path / "damaged.mat")
    assert failure.cause == (
        f"the worker crashed (SIGSEGV) while measuring it; the last file it opened is {tmp_path / 'damaged.mat'}"
    )


def test_calls_run_beside_the_program_one_after_the_other_and_in_it_if_their_process_dies():
    here = os.getpid()
    with beside() as begin:
        first, second = begin(os.getpid), begin(os.getpid)
        assert first() == second() != here
        assert begin(survive_in, here)() == here
        assert begin(abs, -1)() == 1
    with beside(is_wanted=False) as begin:
        assert begin(os.getpid)() == here


def test_a_worker_that_exceeds_its_share_of_the_memory_is_ended(monkeypatch):
    monkeypatch.setattr(local_workers, "memory_bytes", lambda: 600 << 20)
    ((_, failure),) = measure_locally(allocate, [700], workers=2)
    assert failure.cause == "the worker exceeded its share of the memory (0.6 GiB); use fewer workers"


@pytest.mark.parametrize(
    ("name", "kind", "text"),
    [
        ("data", DataError, "data: nothing, expected something"),
        ("other", SettingsError, "other"),
        ("lambda", RuntimeError, "Local: cannot be sent"),
    ],
)
def test_what_a_job_raises_is_raised_here_with_its_traceback(name, kind, text):
    with pytest.raises(kind) as caught:
        list(measure_locally(refuse, [name], workers=1))
    assert str(caught.value) == text
    assert "in refuse" in caught.value.__notes__[0]
    assert not spawned()


def test_notes_of_workers_arrive_before_their_results():
    told = []

    def tell(*values):
        told.append(values)

    assert list(measure_locally(announce, [2], workers=4, frame=tell)) == [(2, 2)]
    assert told == [("key", 0, 2), ("key", 1, 2)]
    told.clear()
    assert dict(measure_locally(announce, [2, 3], workers=4, frame=tell)) == {2: 2, 3: 3}
    assert sorted(told) == [("key", 0, 2), ("key", 0, 3), ("key", 1, 2), ("key", 1, 3), ("key", 2, 3)]


def test_processes_that_cannot_be_started_are_a_failure_of_every_batch(monkeypatch):
    def refused(environment):
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(local_workers, "Worker", refused)
    results = list(measure_locally(announce, [1, 2], workers=2))
    assert [batch for batch, _ in results] == [1, 2]
    assert all("worker processes could not be started ([Errno 11]" in failure.cause for _, failure in results)


def test_an_interruption_ends_the_workers_at_once():
    results = measure_locally(time.sleep, [0, 60, 60], workers=2)
    next(results)
    assert spawned()
    results.close()
    assert not spawned()


def spawned() -> list[psutil.Process]:
    children = psutil.Process().children(recursive=True)
    return [child for child in children if "spawn_main" in " ".join(child.cmdline())]


def test_workers_leave_signals_to_the_program():
    found = dict(measure_locally(status_of, signals.ENDING, workers=1))
    assert found == dict.fromkeys(signals.ENDING, (signal.SIG_IGN, False))


@pytest.mark.parametrize("number", signals.ENDING[:2])
def test_a_signal_during_the_start_of_a_worker_is_honoured(number, monkeypatch):
    """A signal in the middle of the start has its effect when the worker has started, and not before."""
    seen = []
    signal.signal(number, lambda *_: seen.append(number))
    start = type(Worker({})._process).start

    def interrupted(process):
        os.kill(os.getpid(), number)
        start(process)
        time.sleep(0.05)
        assert seen == []

    monkeypatch.setattr("multiprocessing.context.SpawnProcess.start", interrupted)
    worker = Worker({})
    assert seen == [number]
    worker.call(os.getpid)
    assert worker.result() == worker.pid
    worker.close()


def test_workers_start_from_other_threads_too():
    found = []
    thread = threading.Thread(target=lambda: found.extend(measure_locally(abs, [-1], workers=1)))
    thread.start()
    thread.join()
    assert found == [(-1, 1)]


def test_a_worker_ends_with_its_program_in_the_middle_of_a_call():
    script = (
        "import sys, time; from tracknoise.experiments.local_workers import Worker\n"
        "if __name__ == '__main__':\n"
        "    worker = Worker({}); worker.call(time.sleep, 60); print(worker.pid, flush=True); sys.stdin.read()"
    )
    program = subprocess.Popen([sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    worker = psutil.Process(int(program.stdout.readline()))
    program.kill()
    program.communicate()
    worker.wait(timeout=30)


def test_a_worker_that_died_is_an_error_of_the_call():
    worker = Worker({})
    worker.kill()
    worker.call(os.getpid)
    with pytest.raises(WorkerDiedError) as caught:
        worker.result()
    assert caught.value.exit_status == -signal.SIGKILL
    worker.close()


@pytest.mark.usefixtures("lean")
def test_no_socket_of_a_run_accepts_a_stranger(scenes, tmp_path, told):
    """Neither this process nor a worker listens anywhere, so that no other user can send them work."""
    experiment = scenes(2)
    stated = experiment.truth.model_copy(update={"poses": "stated"})  # pipes are read once
    experiment = experiment.model_copy(update={"truth": stated})
    images = [tmp_path / f"data/seq-{number:02}/frame-000002.color.png" for number in (1, 2)]
    contents = [image.read_bytes() for image in images]
    for image in images:
        image.unlink()
        os.mkfifo(image)
    found = {}

    def look():
        with images[0].open("wb") as first, images[1].open("wb") as second:  # both workers are in the middle
            processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
            found["workers"], found["addresses"] = len(spawned()), listening(processes)
            first.write(contents[0])
            second.write(contents[1])

    before = set(listening([psutil.Process(), *psutil.Process().children(recursive=True)]))
    thread = threading.Thread(target=look)
    thread.start()
    outcome = execute(experiment, RunFolder(tmp_path / "run"), listener=told(), workers=2)
    thread.join()
    assert outcome.failures == {}
    assert found["workers"] == 2
    assert set(found["addresses"]) - before == set()


def test_a_stranger_would_be_noticed():
    """The check of the test above and of `python -m benchmarks.attack strangers` finds sockets that do listen."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        assert address in listening([psutil.Process()])
        assert as_stranger([address]) == ["connected"]
    assert as_stranger([address]) == ["refused"]


def listening(processes: list[psutil.Process]) -> list[str]:
    """Addresses at which processes accept connections or packets, sockets of the file system included."""
    inodes = {inode for process in processes for inode in sockets(process)}
    inet = [
        f"{connection.laddr.ip}:{connection.laddr.port}"
        for process in processes
        for connection in process.net_connections("inet")
        if connection.status in (psutil.CONN_LISTEN, psutil.CONN_NONE) and connection.laddr
    ]
    rows = (line.split() for line in Path("/proc/net/unix").read_text().splitlines()[1:])
    return inet + [row[-1] for row in rows if row[3] == "00010000" and row[6] in inodes]


def sockets(process: psutil.Process) -> set[str]:
    """Inodes of the sockets of a process."""
    links = []
    for link in Path(f"/proc/{process.pid}/fd").iterdir():
        with suppress(FileNotFoundError):  # closed in the meantime
            links.append(str(link.readlink()))
    return {link[len("socket:[") : -1] for link in links if link.startswith("socket:")}


def as_stranger(addresses: list[str]) -> list[str]:
    """What a client of another user finds at each address; of this user where no other can be taken on."""
    command = [sys.executable, "-c", STRANGER, *addresses]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()


def test_a_worker_that_is_left_does_not_keep_its_program_from_ending():
    script = (
        "import time; from tracknoise.experiments.local_workers import Worker\n"
        "if __name__ == '__main__':\n"
        "    worker = Worker({}); worker.call(time.sleep, 600)\n"
        "    assert worker.connection.poll(0.5) is False"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)


FEW_FILES = """
import os, resource, sys
from tracknoise.experiments.local_workers import measure_locally

def count():
    return len(os.listdir("/proc/self/fd"))

if __name__ == "__main__":
    list(measure_locally(abs, [-1], workers=1))
    before, limits = count(), resource.getrlimit(resource.RLIMIT_NOFILE)
    for more in [*range(8), *range(8)]:
        resource.setrlimit(resource.RLIMIT_NOFILE, (before + more, limits[1]))
        results = list(measure_locally(abs, [-1, -2], workers=2))
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
        print(count() - before, *(getattr(result, "cause", result) for _, result in results), sep="; ")
"""


def test_workers_for_which_too_many_files_are_open_leave_none_open(tmp_path):
    """So that nothing else fails for the want of them. Shared memory is kept for the next workers."""
    program = tmp_path / "program.py"
    program.write_text(FEW_FILES)
    lines = [line.split("; ") for line in subprocess.check_output([sys.executable, program], text=True).splitlines()]
    assert len(lines) == 16
    left = [int(line[0]) for line in lines]
    assert max(left[8:]) <= max(left[:8]) <= 2
    for _, *outcomes in lines:
        assert sorted(outcomes) == ["1", "2"] or "could not be started" in outcomes[-1]
