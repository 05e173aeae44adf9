"""The program that is attacked: a small run, its phases, and what it must leave."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil

SCENES, FRAMES, WORKERS = 4, 8, 2
EXPERIMENT = """
name = "attack"
speeds = [1]
[dataset]
reader = "folder"
root = "data"
[[trackers]]
kind = "lucas-kanade"
[[trackers]]
kind = "external"
options = { command = ["PYTHON", "-S"], script = "points.py", inputs = [], every = 4, max_features = 10 }
[statistics]
min_features = 5
"""
_POINTS = """
import os, time
from pathlib import Path
if os.fork() == 0:
    os.setsid()
    time.sleep(600)
images = Path("frames_color.txt").read_text().split()
for query in Path().glob("query_*.txt"):
    time.sleep(0.01)
    Path(query.name.replace("query", "output")).write_text(f"{query.read_text().split()[1]}\\n" * len(images))
"""
"""A program of the user, which leaves a process in a session of its own."""
_MAIN = (  # a program in the background of a shell would ignore Ctrl-C
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "from tracknoise.cli.app import main; main()"
)
PROGRAM = [sys.executable, "-c", _MAIN]
PHASES = ("start", "workers", "measurement", "statistics", "report", "files")
"""Before there are workers; from the first; from the first measured scene; from the last; from the findings; from the
first file of the report."""
OF_REPORT = ("report", "files")
"""Phases that a run without a report does not have."""
_LIMIT_S = 300
_TEMPORARY = "temporary"


@dataclass(frozen=True)
class Subject:
    """A run that can be started in any folder.

    Attributes
    ----------
    folder
        Folder of the experiment, its data and its runs.
    expected
        Contents of the files of a run that was left alone.
    phases_s
        Duration of each phase of that run, seconds.
    options
        Of the command line.
    """

    folder: Path
    expected: dict[str, object]
    phases_s: dict[str, float]
    options: tuple[str, ...] = ()

    def start(self, name: str) -> subprocess.Popen[str]:
        """Start the program, or resume its run."""
        return _start(self.folder, name, self.options)

    def resume(self, name: str) -> int:
        """Resume a run until it ends; the exit status."""
        program = self.start(name)
        program.communicate(timeout=_LIMIT_S)
        return program.returncode

    def reach(self, program: subprocess.Popen[str], name: str, phase: str, rng: random.Random) -> bool:
        """Wait for a random moment of a phase; False if the program has ended."""
        run = self.folder / name
        while not _has_reached(run, program.pid, phase):
            if program.poll() is not None:
                return False
            time.sleep(0.001)
        time.sleep(rng.uniform(0.0, self.phases_s[phase]))
        return program.poll() is None

    def differences(self, name: str) -> list[str]:
        """Files of a run that differ from those of the run that was left alone, and temporary folders that are left."""
        found = _contents(self.folder / name)
        left = [str(path) for path in (self.folder / _TEMPORARY).glob("tracknoise-*")]
        return left + sorted(path for path in {*found, *self.expected} if found.get(path) != self.expected.get(path))


@contextmanager
def subject(*options: str) -> Iterator[Subject]:
    """Write the data, and run the program once, with options of the command line, without an attack."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        _write_data(folder)
        program, started, reached = _start(folder, "alone", options), time.monotonic(), {}
        while program.poll() is None:
            for phase in PHASES:
                if phase not in reached and _has_reached(folder / "alone", program.pid, phase):
                    reached[phase] = time.monotonic()
            time.sleep(0.001)
        if program.returncode:
            raise RuntimeError(program.communicate()[1])
        times = [*(reached.get(phase, started) for phase in PHASES), time.monotonic()]
        phases_s = {phase: max(0.0, times[i + 1] - times[i]) for i, phase in enumerate(PHASES)}
        text = ", ".join(f"{phase} {duration_s:.2f} s" for phase, duration_s in phases_s.items())
        expected = _contents(folder / "alone")
        print(f"left alone: {len(expected)} files; {text}", flush=True)
        yield Subject(folder, expected, phases_s, options)


@contextmanager
def subjects(phases: Sequence[str]) -> Iterator[dict[str, Subject]]:
    """A subject for each phase. Those before the report begins write none, because it would take most of the time."""
    options = {phase: () if phase in OF_REPORT else ("--no-report",) for phase in phases}
    with ExitStack() as stack:
        made = {option: stack.enter_context(subject(*option)) for option in sorted(set(options.values()))}
        yield {phase: made[option] for phase, option in options.items()}


def workers(pid: int) -> list[psutil.Process]:
    """Worker processes of a program."""
    return [child for child in below(pid) if _is_worker(child)]


def below(pid: int) -> list[psutil.Process]:
    """All processes that a process started, and those that they started."""
    try:
        return psutil.Process(pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def wait_for(processes: list[psutil.Process]) -> float:
    """Time until processes have ended, seconds; infinite if they have not after a minute."""
    started = time.monotonic()
    _, alive = psutil.wait_procs(processes, timeout=60)
    return float("inf") if alive else time.monotonic() - started


def handles_signals(pid: int) -> bool:
    """Whether a program handles signals itself: not while its interpreter starts or exits."""
    caught = _status(pid).get("SigCgt", "0")
    return bool(int(caught, 16) >> (signal.SIGHUP - 1) & 1)


def wait_until_stopped(pid: int) -> bool:
    """Wait until SIGSTOP has its effect; False if the program has ended."""
    while (state := _status(pid).get("State", "Z")[0]) not in "TZX":
        time.sleep(0.0005)
    return state == "T"


def _status(pid: int) -> dict[str, str]:
    """What the kernel says about a process; empty if there is none."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return {}
    return {name: value.strip() for name, _, value in (line.partition(":") for line in lines)}


def measured(run: Path) -> int:
    """Number of measured scenes of a run."""
    return len(_manifest(run).get("sequences", {}))


def _start(folder: Path, name: str, options: tuple[str, ...]) -> subprocess.Popen[str]:
    command = [*PROGRAM, "run", folder / "x.toml", "--out", folder / name, "--workers", str(WORKERS), "--quiet"]
    command += options
    environment = {**os.environ, "TMPDIR": str(folder / _TEMPORARY)}
    return subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, process_group=0, env=environment
    )


def _has_reached(run: Path, pid: int, phase: str) -> bool:
    manifest = _manifest(run)
    match phase:
        case "start":
            return handles_signals(pid)
        case "workers":
            return bool(workers(pid))
        case "measurement":
            return bool(manifest.get("sequences"))
        case "statistics":
            return len(manifest.get("sequences", {})) == SCENES
        case "report":
            return (run / "statistics" / "findings.json").exists()
        case _:
            return any(run.glob(".report.*/*")) or (run / "report").exists()


def _is_worker(process: psutil.Process) -> bool:
    try:
        return "spawn_main" in " ".join(process.cmdline())
    except psutil.Error:
        return False


def _manifest(run: Path) -> dict[str, dict[str, object]]:
    try:
        return json.loads((run / "manifest.json").read_text())
    except (FileNotFoundError, ValueError):
        return {}


def _write_data(folder: Path) -> None:
    """Scenes that are measured in a moment: copies of one simulated motion."""
    options = [
        "--motion",
        "sideways",
        "--frames",
        str(FRAMES),
        "--option",
        "width=320",
        "--option",
        "height=240",
        "--quiet",
    ]
    scene = folder / "data" / "scene-0"
    subprocess.run([*PROGRAM, "simulate", "--out", scene, *options], check=True, stdout=subprocess.DEVNULL)
    for number in range(1, SCENES):
        shutil.copytree(scene, folder / "data" / f"scene-{number}")
    (folder / "x.toml").write_text(EXPERIMENT.replace("PYTHON", sys.executable))
    (folder / "points.py").write_text(_POINTS)
    (folder / _TEMPORARY).mkdir()


def _contents(run: Path) -> dict[str, object]:
    """Every file of a run, and the manifest without the measured times."""
    paths = sorted(path for path in run.rglob("*") if path.is_file())
    files: dict[str, object] = {str(path.relative_to(run)): path.read_bytes() for path in paths}
    manifest = json.loads(files.pop("manifest.json"))
    for entry in manifest["sequences"].values():
        entry["seconds"] = 0
    return {**files, "manifest.json": manifest}
