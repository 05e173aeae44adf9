"""What a second worker gains, and what it costs to check that a run is whole before it goes on.

Eight scenes are measured by the whole program: by one process and by two workers in turn, all of them with one thread,
and its tables are compared. Only the machine's spare cores can be gained, so nothing else should run beside it.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.harness import Row
from tracknoise.tables.store import RunFolder

SCENES, FRAMES, REPEATS = 8, 40, 2
EXPERIMENT = """
name = "scaling"
speeds = [1, 2, 4]
[dataset]
reader = "folder"
root = "data"
[[trackers]]
kind = "lucas-kanade"
[[trackers]]
kind = "correspondence"
"""
PROGRAM = [sys.executable, "-c", "from tracknoise.cli.app import main; main()"]
ONE_THREAD = dict.fromkeys(
    ("OPENCV_FOR_THREADS_NUM", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS"), "1"
)


def rows() -> list[Row]:
    """Wall time by count of workers, their ratio, and the rate at which files are checked."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_data(folder)
        times = {workers: [] for workers in (1, 2)}
        for _ in range(REPEATS):
            for workers, found in times.items():
                found.append(_run_s(folder, workers))
        same = _tables(folder / "run-1") == _tables(folder / "run-2")
        table = [
            Row(f"scaling: {SCENES} scenes, {workers} workers", min(found), "s") for workers, found in times.items()
        ]
        ratio = Row("scaling: 1 worker over 2", min(times[1]) / min(times[2]), "", f"identical tables: {same}")
        return [*table, ratio, _check(folder / "run-1")]


def _run_s(folder: Path, workers: int) -> float:
    out = folder / f"run-{workers}"
    command = [*PROGRAM, "run", folder / "x.toml", "--out", out, "--workers", str(workers), "--no-report", "--quiet"]
    shutil.rmtree(out, ignore_errors=True)
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, **ONE_THREAD})
    return time.perf_counter() - start


def _check(path: Path) -> Row:
    """How fast a run that goes on makes sure that what it has is whole."""
    run, size = RunFolder(path), sum(len(content) for content in _tables(path).values())
    entries = list(run.manifest().sequences.values())
    start = time.perf_counter()
    if not all(run.has_sequence(entry) for entry in entries):
        raise RuntimeError(f"{path}: not whole")
    elapsed = time.perf_counter() - start
    return Row("checking a run before it goes on", size / 2**20 / elapsed, "MiB/s", f"{size / 2**20:.0f} MiB")


def _tables(run: Path) -> dict[str, bytes]:
    return {str(path.relative_to(run)): path.read_bytes() for path in run.rglob("*.parquet")}


def _write_data(folder: Path) -> None:
    scene = folder / "data" / "scene-0"
    options = ["--motion", "sideways", "--frames", str(FRAMES), "--width", "640", "--height", "480", "--quiet"]
    subprocess.run([*PROGRAM, "simulate", "--out", scene, *options], check=True, stdout=subprocess.DEVNULL)
    for number in range(1, SCENES):
        shutil.copytree(scene, folder / "data" / f"scene-{number}")
    (folder / "x.toml").write_text(EXPERIMENT)
