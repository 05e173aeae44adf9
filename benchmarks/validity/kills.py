"""Runs killed at random moments and started again, compared with one that was left in peace.

    python -m benchmarks.validity.kills [--kills N] [--seed N]

Each run is the whole program, `tracknoise run` with two workers, in a folder of its own. After a random time, up to
that of a run in peace, SIGKILL goes to the program, to one of its workers, or to all at once. A program that was killed
is started again. In the end every file of the run must be the same to the byte; the manifest, but for the seconds.
Workers of a killed program must end by themselves: printed is how long they took.
"""

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

EXPERIMENT = """
name = "kills"
speeds = [1, 2]
[dataset]
reader = "folder"
root = "data"
[[trackers]]
kind = "lucas-kanade"
[[trackers]]
kind = "oracle"
[statistics]
min_features = 5
"""
SCENES, FRAMES = 8, 24
VICTIMS = ("program", "worker", "all")
PROGRAM = [sys.executable, "-c", "from tracknoise.cli.app import main; main()"]


def main() -> None:
    """Print a line a run and exit with the count of those that came out otherwise."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.validity.kills", description=__doc__)
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    with tempfile.TemporaryDirectory() as folder:
        wrong = _all(Path(folder), rng, arguments.kills)
    print(f"{arguments.kills - wrong} of {arguments.kills} runs the same as the one in peace")
    sys.exit(bool(wrong))


def _all(folder: Path, rng: random.Random, kills: int) -> int:
    _write_data(folder)
    started = time.monotonic()
    _start(folder, "peace").wait()
    in_peace_s = time.monotonic() - started
    expected = _contents(folder / "peace")
    print(f"in peace: {in_peace_s:.1f} s, {len(expected)} files")
    killed = wrong = 0
    while killed < kills:
        victim, after_s = VICTIMS[killed % len(VICTIMS)], rng.uniform(0, in_peace_s)
        story = _one(folder, victim, after_s, rng)
        if story is None:  # it was over, or there was no worker yet
            continue
        killed += 1
        same = _contents(folder / "run") == expected
        wrong += not same
        print(f"{victim:>8} killed after {after_s:5.1f} s: {story}: {'the same' if same else 'OTHERWISE'}", flush=True)
    return wrong


def _one(folder: Path, victim: str, after_s: float, rng: random.Random) -> str | None:
    """Kill once, and see the run through to its end; what happened, in words, or None if there was nothing to kill."""
    shutil.rmtree(folder / "run", ignore_errors=True)
    program = _start(folder, "run")
    time.sleep(after_s)
    workers = _workers(program.pid)
    if program.poll() is not None or (victim == "worker" and not workers):
        program.wait()
        return None
    done = _measured(folder / "run")
    chosen = {"program": [], "worker": workers[: 1 + rng.randrange(len(workers) or 1)], "all": workers}[victim]
    for worker in chosen:
        worker.kill()
    if victim == "worker":
        status = program.wait()
        return f"{done} of {SCENES} measured; {len(chosen)} of {len(workers)} workers; status {status}"
    program.send_signal(signal.SIGKILL)
    program.wait()
    orphaned_s = _wait_for(workers)
    status = _start(folder, "run").wait()
    return f"{done} of {SCENES} measured; {len(workers)} workers gone after {orphaned_s:.1f} s; then status {status}"


def _start(folder: Path, name: str) -> subprocess.Popen[bytes]:
    out = folder / name
    command = [*PROGRAM, "run", folder / "x.toml", "--out", out, "--workers", "2", "--no-report", "--quiet"]
    quiet = {**os.environ, "PYTHONWARNINGS": "ignore::UserWarning"}  # multiprocessing tells of what it cleans up
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, env=quiet)


def _write_data(folder: Path) -> None:
    """Scenes of a few seconds; a simulated motion, cut in pieces, is enough."""
    options = ["--motion", "sideways", "--frames", str(FRAMES), "--width", "320", "--height", "240", "--quiet"]
    scene = folder / "data" / "scene-0"
    subprocess.run([*PROGRAM, "simulate", "--out", scene, *options], check=True, stdout=subprocess.DEVNULL)
    for number in range(1, SCENES):
        shutil.copytree(scene, folder / "data" / f"scene-{number}")
    (folder / "x.toml").write_text(EXPERIMENT)


def _workers(pid: int) -> list[psutil.Process]:
    try:
        children = psutil.Process(pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []
    return [child for child in children if _is_worker(child)]


def _is_worker(process: psutil.Process) -> bool:
    try:
        return "spawn_main" in " ".join(process.cmdline())
    except psutil.Error:
        return False


def _wait_for(processes: list[psutil.Process]) -> float:
    """How long they took to end, seconds."""
    started = time.monotonic()
    psutil.wait_procs(processes, timeout=60)
    return time.monotonic() - started if not any(process.is_running() for process in processes) else float("inf")


def _measured(run: Path) -> int:
    try:
        return len(json.loads((run / "manifest.json").read_text())["sequences"])
    except FileNotFoundError:
        return 0


def _contents(run: Path) -> dict[str, object]:
    """Every file of a run, and the manifest without what is of the clock."""
    files: dict[str, object] = {
        str(path.relative_to(run)): path.read_bytes() for path in sorted(run.rglob("*")) if path.is_file()
    }
    manifest = json.loads(files.pop("manifest.json"))
    for entry in manifest["sequences"].values():
        entry["seconds"] = 0
    return {**files, "manifest": manifest}


if __name__ == "__main__":
    main()
