"""Links in place of every file and folder of a run: ``python -m benchmarks.attack links [--count N] [--seed N]``.

A small run is copied, and one of its files or folders, or one that a run may have, becomes a link to a copy of it
elsewhere, or to nothing. Commands that read the run, resume it or replace it must refuse it in one line that names the
link, and leave what is elsewhere as it was.
"""

import argparse
import random
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.attack.command import SCENE, call, memory_folder

EXPERIMENT = """
name = "links"
speeds = [1]
[dataset]
reader = "folder"
root = "data"
[[trackers]]
kind = "lucas-kanade"
[statistics]
min_features = 5
"""
FURTHER = (
    ".lock",
    "parts",
    "parts/one",
    "report",
    "report/index.html",
    "failures.jsonl",
    ".x.1.0.tracknoise-unfinished",
)
"""What a run has at times."""
COMMANDS = (
    ("run", "{folder}/x.toml", "--out", "{run}", "-w", "1", "--no-report", "--quiet"),
    ("run", "{folder}/x.toml", "--out", "{run}", "-w", "1", "--no-report", "--quiet", "--fresh"),
    ("report", "{run}"),
    ("report", "{run}", "--text"),
    ("check", "{run}"),
)


def main(arguments: Sequence[str]) -> int:
    """Print one line per fault, and counts; the exit code is 1 if there is a fault."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.attack links", description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="links in all")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    rng, wrong = random.Random(options.seed), 0
    with tempfile.TemporaryDirectory(dir=memory_folder()) as temporary:
        folder = Path(temporary)
        names = _measured(folder)
        chosen = [names[number % len(names)] for number in range(options.count)]
        rng.shuffle(chosen)
        for name in chosen:
            command, leads = rng.choice(COMMANDS), rng.choice(("copy", "nothing"))
            fault = attempt(folder, name, command, leads)
            wrong += fault is not None
            if fault is not None:
                print(f"{name} leads to {leads}, {' '.join(command[:1] + command[7:])}: {fault}", flush=True)
    print(f"{options.count} links in place of {len(set(chosen))} names, seed {options.seed}: {wrong} not dealt with")
    return int(bool(wrong))


def _measured(folder: Path) -> list[str]:
    """Measure the run, and return the names of what may become a link."""
    for command in (
        ["simulate", "--out", str(folder / "data" / "scene"), *SCENE],
        ["run", str(folder / "x.toml"), "--out", str(folder / "whole"), "-w", "1", "--no-report", "--quiet"],
    ):
        (folder / "x.toml").write_text(EXPERIMENT)
        status, _, errors = call(command)
        if status:
            raise RuntimeError(errors)
    found = {str(path.relative_to(folder / "whole")) for path in (folder / "whole").rglob("*")}
    return sorted(found | {*FURTHER})


def attempt(folder: Path, name: str, command: Sequence[str], leads: str) -> str | None:
    """Call a command on a run with one link; what was wrong, or None."""
    run, elsewhere = folder / "run", folder / "elsewhere"
    for left in (run, elsewhere):
        shutil.rmtree(left, ignore_errors=True)
    shutil.copytree(folder / "whole", run)
    link, target = run / name, elsewhere / "target"
    elsewhere.mkdir()
    (elsewhere / "beside").write_text("mine")
    link.parent.mkdir(parents=True, exist_ok=True)
    if leads == "copy" and not link.exists():
        target.write_text("mine")
    elif leads == "copy":
        link.rename(target)
    elif link.is_dir():
        shutil.rmtree(link)
    else:
        link.unlink(missing_ok=True)
    link.symlink_to(target)
    before = _state(elsewhere)
    status, _, errors = call([part.format(folder=folder, run=run) for part in command])
    if _state(elsewhere) != before:
        return "WRITTEN ELSEWHERE"
    if not link.is_symlink():
        return "the link was replaced"
    if status == 0:
        return "accepted"
    if errors.count("\n") != 1 or not (str(link) in errors or str(run) in errors):
        return f"status {status}, it said {errors!r}"
    return None


def _state(folder: Path) -> dict[str, tuple[int, bytes]]:
    """Content and time of the last change of all files, and times of folders."""
    return {
        str(path.relative_to(folder)): (path.stat().st_mtime_ns, path.read_bytes() if path.is_file() else b"")
        for path in sorted(folder.rglob("*"))
    }
