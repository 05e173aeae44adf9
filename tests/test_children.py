"""Processes that the package starts, in a folder with modules named like those of Python."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from tests.writers.program import PROGRAM, small_experiment

NAMES = ("pickle", "select", "types", "numpy", "signal", "multiprocessing", "struct", "socket", "re", "tracknoise")
CHILDREN = """
import os

if __name__ == "__main__":
    import multiprocessing, numpy, pickle, polars, re, select, signal, socket, struct, sys, types
    from tracknoise.processes import process_pool
    from tracknoise.experiments.local_workers import measure_locally
    from tracknoise.parsing_child import call_in_child

    sys.path[:] = [*{before!r}, *sys.path]
    print(dict(measure_locally(os.getenv, ["PYTHONSAFEPATH", "NONE"], workers=2))["PYTHONSAFEPATH"])
    with process_pool(1) as pool:
        print(pool.submit(os.getenv, "PYTHONSAFEPATH").result())
    print(call_in_child(abs, -3, size=0), sys.path[:1] == [""], os.getenv("PYTHONSAFEPATH"))
"""
SMALL = small_experiment('kind = "imported"\noptions = { path = "{scene}.csv" }')


@pytest.fixture
def data(tmp_path) -> Path:
    """A folder with such modules, each of which writes its name and ends the program."""
    folder = tmp_path / "data"
    folder.mkdir()
    for name in NAMES:
        (folder / f"{name}.py").write_text(
            f"open({str(tmp_path / 'ran')!r}, 'a').write('{name} ')\nraise SystemExit(3)\n"
        )
    return folder


@pytest.fixture
def start(data, tmp_path):
    """Runs a program, which lies elsewhere, in that folder."""

    def go(text: str, *arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
        program = tmp_path / "program" / "go.py"
        program.parent.mkdir(exist_ok=True)
        program.write_text(text)
        kept = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
        command = [sys.executable, program, *map(str, arguments)]
        return subprocess.run(command, cwd=data, env={**kept, **environment}, capture_output=True, text=True)

    return go


@pytest.mark.parametrize(("before", "set_by_user"), [([], "1"), ([""], None)], ids=["script", "interactive"])
def test_no_child_runs_modules_of_the_current_folder(before, set_by_user, start, tmp_path):
    environment = {} if set_by_user is None else {"PYTHONSAFEPATH": set_by_user}
    ended = start(CHILDREN.format(before=before), **environment)
    assert not (tmp_path / "ran").exists()
    assert (ended.stdout.split(), ended.stderr) == (
        [*[str(set_by_user)] * 2, "3", str(before == [""]), str(set_by_user)],
        "",
    )


def test_a_run_among_such_data(start, data, tmp_path):
    """Tracks are read by the child for parsers of the worker."""
    rows = [f"{track},{frame},{10 + 8 * track},{40}" for frame in range(4) for track in range(8)]
    (data / "forward-00.csv").write_text("\n".join(["track,frame,u_px,v_px", *rows]))
    (data / "small.toml").write_text(SMALL)
    ended = start(PROGRAM, "run", "small.toml", "--out", tmp_path / "run", "--no-report", "--workers", 2, "--scenes", 1)
    assert not (tmp_path / "ran").exists()
    assert ended.returncode == 0, ended.stderr


def test_modules_that_the_user_names_are_found(start, tmp_path):
    extra = tmp_path / "extra"
    extra.mkdir()
    (extra / "extra_jobs.py").write_text("def double(x):\n    return 2 * x\n")
    text = (
        "if __name__ == '__main__':\n"
        "    from extra_jobs import double\n"
        "    from tracknoise.experiments.local_workers import measure_locally\n"
        "    from tracknoise.parsing_child import call_in_child\n"
        "    print(list(measure_locally(double, [4], workers=1)), call_in_child(double, 5, size=0))\n"
    )
    ended = start(text, PYTHONPATH=os.pathsep.join([str(extra), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep))
    assert (ended.stdout.strip(), ended.stderr) == ("[(4, 8)] 10", "")


def test_programs_that_a_worker_starts_find_what_lies_beside_them(start, tmp_path):
    folder = tmp_path / "tool"
    folder.mkdir()
    (folder / "beside.py").write_text("VALUE = 7\n")
    (folder / "tool.py").write_text("import beside\nprint(beside.VALUE)\n")
    text = (
        "import subprocess, sys\n"
        "if __name__ == '__main__':\n"
        "    from tracknoise.experiments.local_workers import measure_locally\n"
        f"    command = [sys.executable, {str(folder / 'tool.py')!r}]\n"
        "    print(list(measure_locally(subprocess.check_output, [command], workers=1))[0][1])\n"
    )
    ended = start(text)
    assert (ended.stdout.strip(), ended.stderr) == (r"b'7\n'", "")


def test_workers_of_a_scheduler_as_the_documentation_starts_them(data, tmp_path):
    """Beside such data, and where only this machine can connect."""
    from distributed import Client

    from tracknoise.parsing_child import call_in_child

    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    local = ("--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0")
    commands = {
        "scheduler": ("--port", str(port), *local),
        "worker": (f"tcp://127.0.0.1:{port}", "--nworkers", "1", "--nthreads", "1", *local),
    }
    environment, processes = {**os.environ, "PYTHONSAFEPATH": "1"}, []
    try:
        for name, options in commands.items():
            command = [sys.executable, "-c", f"from distributed.cli.dask_{name} import main; main()", *options]
            with (tmp_path / f"{name}.log").open("wb") as log:
                processes.append(psutil.Popen(command, stdout=log, stderr=log, cwd=data, env=environment))
        with Client(f"tcp://127.0.0.1:{port}", timeout=60) as client:
            client.wait_for_workers(1, timeout=60)
            assert client.submit(call_in_child, abs, -3, size=0).result(timeout=60) == 3
            started = [one for process in processes for one in [process, *process.children(recursive=True)]]
            listening = {
                connection.laddr.ip
                for one in started
                for connection in one.net_connections("inet")
                if connection.status == psutil.CONN_LISTEN
            }
        assert listening == {"127.0.0.1"}
        assert not (tmp_path / "ran").exists()
    finally:
        for process in reversed(processes):
            process.terminate()
            process.wait(60)
