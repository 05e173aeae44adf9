"""Programs that are ended by a signal: one line, the exit status of a shell, and a run that resumes."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import cv2
import numpy as np
import polars as pl
import psutil
import pytest
from tests.lean import measured_by_command

from tracknoise import processes
from tracknoise.cli import recording_arguments
from tracknoise.cli.app import Interruption, main
from tracknoise.experiments import load, task
from tracknoise.sequences import reader_registry

pytestmark = pytest.mark.usefixtures("pipes_are_files")

MAIN = (  # a program in the background of a shell would ignore Ctrl-C
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "from tracknoise.cli.app import main; main()"
)
TEXT = """
name = "x"
[dataset]
reader = "sevenscenes"
root = "data"
[[trackers]]
kind = "oracle"
options = { n_features = 20, margin_px = 2 }
[truth]
poses = "stated"  # pipes are read once
[statistics]
min_features = 2
"""


@pytest.fixture(autouse=True)
def not_ignored():
    """Tests in the background of a shell, or under nohup, inherit signals that are ignored."""
    handlers = {number: signal.signal(number, signal.SIG_DFL) for number in processes.ENDING}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.fixture(autouse=True)
def limited():
    """A program that does not end fails the test."""

    def fail(number, frame):
        raise TimeoutError

    signal.signal(signal.SIGALRM, fail)
    signal.alarm(120)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)


@pytest.fixture
def stalled(tmp_path):
    """Two scenes, each with an image that is a pipe: whoever reads it waits. Gives the pipes and the image."""
    content = cv2.imencode(".png", np.random.default_rng(0).integers(0, 256, (48, 64), dtype=np.uint8))[1].tobytes()
    pipes = []
    for scene in ("seq-01", "seq-02"):
        folder = tmp_path / "data" / scene
        folder.mkdir(parents=True)
        for index in range(3):
            name = f"frame-{index:06d}"
            (folder / f"{name}.color.png").write_bytes(content)
            cv2.imwrite(str(folder / f"{name}.depth.png"), np.full((48, 64), 585, np.uint16))
            np.savetxt(folder / f"{name}.pose.txt", np.eye(4))
        np.savetxt(folder / "camera-intrinsics.txt", [[585, 0, 31.5], [0, 585, 23.5], [0, 0, 1]])
        pipes.append(folder / "frame-000001.color.png")
        pipes[-1].unlink()
        os.mkfifo(pipes[-1])
    (tmp_path / "x.toml").write_text(TEXT)
    return pipes, content


def arguments(folder):
    return ["run", str(folder / "x.toml"), "--out", str(folder / "run"), "--quiet", "--no-report"]


def start(folder, *options):
    command = [sys.executable, "-c", MAIN, *arguments(folder), *options]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, process_group=0)


def send(program, number):
    """Five times to all processes."""
    for _ in range(5):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(program.pid, number)
        time.sleep(0.02)


def workers(program):
    with contextlib.suppress(psutil.Error):
        children = psutil.Process(program.pid).children(recursive=True)
        return [child for child in children if "spawn_main" in " ".join(child.cmdline())]
    return []


def wait_until(true):
    deadline = time.monotonic() + 60
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.02)  # to look for children takes processor time that they need


@pytest.mark.parametrize(
    ("count", "number", "text"),
    [("1", signal.SIGINT, "interrupted"), ("2", signal.SIGTERM, "ended by SIGTERM")],
)
def test_a_program_is_ended_with_one_line_and_resumes(number, text, count, stalled, tmp_path, tracknoise):
    """The signal is sent as soon as there is a worker, or else the manifest."""
    pipes, content = stalled
    program = start(tmp_path, "--workers", count)
    if count == "1":
        wait_until((tmp_path / "run" / "manifest.json").exists)
    else:
        wait_until(lambda: workers(program))
    there = workers(program)
    send(program, number)
    _, errors = program.communicate(timeout=60)
    assert errors == f"tracknoise: error: {text}; run the same command again to resume\n"
    assert program.returncode == 128 + number
    assert psutil.wait_procs(there, timeout=10)[1] == []
    for pipe in pipes:
        pipe.unlink()
        pipe.write_bytes(content)
    with measured_by_command():
        resumed, _, errors = tracknoise(*arguments(tmp_path), "--workers", "1")
    assert (resumed, errors) == (0, "")


def test_a_program_that_waits_for_a_file_is_ended(stalled, tmp_path):
    (first, _), _ = stalled
    program = start(tmp_path, "--workers", "1")
    with first.open("wb"):  # it is opened, and soon read
        time.sleep(0.5)
        send(program, signal.SIGHUP)
        _, errors = program.communicate(timeout=60)
    assert errors.endswith("tracknoise: error: ended by SIGHUP; run the same command again to resume\n")
    assert program.returncode == 128 + signal.SIGHUP


@pytest.mark.parametrize("count", ["1", "2"])
def test_a_removed_run_folder_says_what_to_do(count, stalled, tmp_path):
    (first, second), content = stalled
    program = start(tmp_path, "--workers", count)
    with first.open("wb") as pipe:  # it is read: the run is in the middle
        shutil.rmtree(tmp_path / "run")
        second.unlink()
        second.write_bytes(content)
        pipe.write(content)
    _, errors = program.communicate()
    assert errors == (
        f"tracknoise: error: {tmp_path / 'run'}: removed or replaced during the run, expected it to stay; "
        "run the same command again to start over\n"
    )
    assert program.returncode == 1
    assert not (tmp_path / "run").exists()


def panicked(cause):
    """Raise the panic of Polars that an exception within its calls of Python becomes."""
    raise pl.exceptions.PanicException(f"called `Result::unwrap()` on an `Err` value: PyErr {{ type: {cause!r} }}")


@pytest.mark.parametrize("signalled", [True, False])
def test_a_panic_that_an_interruption_caused_ends_like_it(signalled, monkeypatch, tracknoise):
    def interrupted():
        with contextlib.suppress(KeyboardInterrupt):
            if signalled:
                signal.raise_signal(signal.SIGINT)
        panicked(KeyboardInterrupt)

    monkeypatch.setattr(reader_registry, "READERS", SimpleNamespace(descriptions=interrupted))
    assert tracknoise("datasets") == (130, "", "tracknoise: error: interrupted\n")


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("run", "x"), "; run the same command again to resume"),
        (("run", "x", "--fresh"), "; run the same command again without --fresh to resume"),
        (("tournament", "x"), "; run the same command again to resume"),
        (("demo",), ""),
        (("check", "x"), ""),
        (("init", "x"), ""),
    ],
)
def test_only_commands_that_resume_say_so(command, said, monkeypatch, tracknoise):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(load, "load_experiment", interrupted)
    monkeypatch.setattr(recording_arguments, "open_recording", interrupted)
    assert tracknoise(*command) == (130, "", f"tracknoise: error: interrupted{said}\n")


def test_another_panic_is_an_internal_error_of_one_line(monkeypatch, tracknoise):
    monkeypatch.setattr(reader_registry, "READERS", SimpleNamespace(descriptions=lambda: panicked(ValueError)))
    status, _, errors = tracknoise("datasets")
    assert status == 1
    assert errors.startswith("tracknoise: error: internal error (PanicException: called `Result::unwrap()`")
    assert errors.count("\n") == 1
    with pytest.raises(pl.exceptions.PanicException):
        main(["datasets", "--debug"])


def test_a_sequence_that_panics_because_of_an_interruption_has_not_failed(monkeypatch):
    monkeypatch.setattr(task, "_measure_batch", lambda *_, **__: panicked(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        task.attempt([SimpleNamespace(parts=())], None)


@pytest.mark.parametrize("number", processes.ENDING)
def test_signals_in_quick_succession_count_once(number):
    with Interruption() as interruption:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGTERM)
        assert interruption.status == 128 + number
        interruption.end()
    signal.raise_signal(number)  # the program is about to exit


def test_an_interruption_that_python_only_reports_is_repeated(capsys):
    class Careless:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    def finalize():
        careless = Careless()
        del careless
        time.sleep(30)

    with Interruption() as interruption, pytest.raises(KeyboardInterrupt):
        finalize()
    assert interruption
    assert capsys.readouterr().err == ""


def test_other_errors_that_python_only_reports_are_still_reported(monkeypatch):
    class Careless:
        def __del__(self):
            raise ValueError

    reported = []
    monkeypatch.setattr(sys, "unraisablehook", reported.append)
    with Interruption():
        careless = Careless()
        del careless
    assert [item.exc_type for item in reported] == [ValueError]


def test_a_signal_that_is_ignored_from_the_start_stays_ignored():
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with Interruption() as interruption:
        signal.raise_signal(signal.SIGHUP)
        assert not interruption


LOADING = """
import os, signal, sys
from tracknoise.__main__ import start

class Interrupted:
    def find_spec(name, path=None, target=None):
        os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupted)
start()
"""


def test_ctrl_c_is_quiet_while_modules_are_loaded():
    done = subprocess.run([sys.executable, "-c", LOADING], capture_output=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, b"", b"")
