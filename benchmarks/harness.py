"""Timing, what is timed, and the rows that every benchmark returns."""

import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PROGRAM = [sys.executable, "-c", "from tracknoise.cli.app import main; main()"]
ONE_THREAD = dict.fromkeys(
    ("OPENCV_FOR_THREADS_NUM", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS"), "1"
)


@dataclass(frozen=True, slots=True)
class Row:
    """One measured figure."""

    name: str
    value: float
    unit: str
    note: str = ""


def median_ms(run: Callable[[], object], repeats: int = 15) -> float:
    """Median wall time of one call, ms, after one warm-up call."""
    run()
    return statistics.median(elapsed_ms(run) for _ in range(repeats))


def elapsed_ms(run: Callable[[], object]) -> float:
    """Wall time of one call, ms."""
    start = time.perf_counter()
    run()
    return (time.perf_counter() - start) * 1e3


def program(*arguments: object) -> None:
    """Run `tracknoise` with these arguments, every library with one thread, as a worker does."""
    command = [*PROGRAM, *map(str, arguments)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, **ONE_THREAD})


def write_scene(folder: Path, *, frames: int, width: int, height: int) -> None:
    """Write a simulated scene with images, depth and poses in the layout `folder`."""
    size = ["--option", f"width={width}", "--option", f"height={height}"]
    program("simulate", "--out", folder, "--motion", "sideways", "--frames", frames, *size, "--quiet")


def in_new_process(module: str, *arguments: object) -> dict[str, Any]:
    """What a benchmark's own program prints: a JSON object. Its libraries have one thread each."""
    command = [sys.executable, "-m", module, *map(str, arguments)]
    finished = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env={**os.environ, **ONE_THREAD})
    printed: dict[str, Any] = json.loads(finished.stdout)
    return printed


def stay_on_one_core() -> None:
    """Keep this program on one core (Linux). Threads that wait for each other on two cores take a fifth more time."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def peak_mib() -> float:
    """Largest resident size since this program began; unlike `resource.getrusage`, without its parent's (Linux)."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 2**10


class Silent:
    """Listens to a run and prints nothing; a failure ends it."""

    def planned(self, keys: list[str], done: int) -> None: ...

    def frame(self, key: str, done: int, total: int, first: int) -> None: ...

    def measured(self, key: str, entry: object) -> None: ...

    def failed(self, keys: list[str], cause: str) -> None:
        raise RuntimeError(cause)

    def remark(self, text: str) -> None: ...
