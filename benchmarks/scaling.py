"""What a second worker gains, and what it costs to check that a run is whole before it goes on.

Eight scenes are measured by the whole program: by one process and by two workers in turn, all of them with one thread,
and its tables are compared. Only the machine's spare cores can be gained, so nothing else should run beside it.
"""

import shutil
import tempfile
from pathlib import Path

from benchmarks.harness import Row, elapsed_ms, program, write_scene
from tracknoise.tables.store import RunFolder

SCENES, REPEATS = 8, 2
WORKERS = (1, 2)
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


def rows() -> list[Row]:
    """Of 16 frames of 320x240."""
    return _rows(16, 320, 240)


def full_rows() -> list[Row]:
    """Of 40 frames of 640x480."""
    return _rows(40, 640, 480)


def _rows(frames: int, width: int, height: int) -> list[Row]:
    """Wall time by count of workers, their ratio, and the rate at which files are checked."""
    size = f"{frames} frames of {width}x{height} each"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_data(folder, frames, width, height)
        times: dict[int, list[float]] = {workers: [] for workers in WORKERS}
        for _ in range(REPEATS):
            for workers, found in times.items():
                found.append(_run_s(folder, workers))
        same = _tables(folder / "run-1") == _tables(folder / "run-2")
        table = [
            Row(f"scaling: {SCENES} scenes, {workers} workers", min(found), "s", size)
            for workers, found in times.items()
        ]
        ratio = Row("scaling: 1 worker over 2", min(times[1]) / min(times[2]), "x", f"identical tables: {same}")
        return [*table, ratio, _check(folder / "run-1")]


def _run_s(folder: Path, workers: int) -> float:
    out = folder / f"run-{workers}"
    shutil.rmtree(out, ignore_errors=True)
    options = ["--out", out, "--workers", workers, "--no-report", "--quiet"]
    return elapsed_ms(lambda: program("run", folder / "x.toml", *options)) / 1e3


def _check(path: Path) -> Row:
    """How fast a run that goes on makes sure that what it has is whole."""
    run, size = RunFolder(path), sum(len(content) for content in _tables(path).values())
    entries = list(run.manifest().sequences.values())
    elapsed = elapsed_ms(lambda: [run.has_sequence(entry) for entry in entries]) / 1e3
    return Row("checking a run before it goes on", size / 2**20 / elapsed, "MiB/s", f"{size / 2**20:.0f} MiB")


def _tables(run: Path) -> dict[str, bytes]:
    return {str(path.relative_to(run)): path.read_bytes() for path in run.rglob("*.parquet")}


def _write_data(folder: Path, frames: int, width: int, height: int) -> None:
    write_scene(folder / "data" / "scene-0", frames=frames, width=width, height=height)
    for number in range(1, SCENES):
        shutil.copytree(folder / "data" / "scene-0", folder / "data" / f"scene-{number}")
    (folder / "x.toml").write_text(EXPERIMENT)
