"""Flip bits in every file of a finished run, and see whether a reader of the run is deceived.

    python -m benchmarks.attack flips [--count N] [--seed N] [--workers N] [--keep FOLDER]

A small run is made once. Each flip is of one bit of one file: files take turns, and within a file the offsets are
spread evenly. After it the run is read by `summary`, by `findings`, by `findings --json` and by `report`, and is then
resumed by `run`, all with the functions of the command line. A reader must either refuse the run with one line, or show
what it shows of the whole run. After the resumption the folder must be that of the whole run, or the resumption must be
refused with one line; then `run --fresh` must give the whole run. A reader that does not open the file is skipped and
counted. Printed are counts by file and outcome.
"""

import argparse
import contextlib
import hashlib
import json
import os
import random
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from benchmarks.attack.command import SCENE, call, memory_folder
from tracknoise.cli.run_summary import summary_text
from tracknoise.exceptions import TracknoiseError
from tracknoise.processes import usable_cores
from tracknoise.report.page import write_report
from tracknoise.tables.store import RunFolder

EXPERIMENT = """
name = "flips"
[dataset]
reader = "folder"
root = "data"
[[trackers]]
kind = "oracle"
[statistics]
min_features = 5
"""
NOTICED, UNCHANGED, REPAIRED, SKIPPED = "noticed", "unchanged", "repaired", "not read"
WRONG = ("changed", "crashed")
OF_REPORT = ("report", "statistics/noise")


@dataclass(frozen=True)
class Flip:
    """One bit of a file of the run: path within the run, offset in bytes, and bit."""

    path: str
    offset: int
    bit: int

    def apply(self, run: Path) -> None:
        content = bytearray((run / self.path).read_bytes())
        content[self.offset] ^= 1 << self.bit
        (run / self.path).write_bytes(content)


@dataclass(frozen=True)
class Outcome:
    """What a reader did, and its first line where it refused the run or was deceived."""

    reader: str
    kind: str
    text: str = ""


@dataclass(frozen=True)
class Reader:
    """A way to read a run, what it shows of the whole run, and the files that it opens for this."""

    name: str
    read: Callable[[Path], object]
    shown: object
    opened: frozenset[str]

    @classmethod
    def of(cls, name: str, read: Callable[[Path], object], run: Path) -> "Reader":
        with opened_files() as opened:
            shown = read(run)
        inside = (Path(path) for path in opened if Path(path).is_relative_to(run))
        return cls(name, read, shown, frozenset(str(path.relative_to(run)) for path in inside))

    def judged(self, run: Path, flip: Flip) -> Outcome:
        """What the reader makes of a run with a flip."""
        if flip.path not in self.opened:
            return Outcome(self.name, SKIPPED)
        try:
            shown = self.read(run)
        except TracknoiseError as error:
            return Outcome(self.name, NOTICED if "\n" not in str(error) else "crashed", str(error))
        except BaseException as error:
            return Outcome(self.name, "crashed", f"{type(error).__name__}: {error}")
        return Outcome(self.name, UNCHANGED if shown == self.shown else "changed")


@contextlib.contextmanager
def opened_files() -> Iterator[set[str]]:
    """Names of the files that this process opens meanwhile."""
    opened: set[str] = set()
    watching = [True]

    def watch(event: str, arguments: tuple[object, ...]) -> None:
        if watching and event == "open" and isinstance(arguments[0], str | os.PathLike):
            opened.add(os.fspath(arguments[0]))

    sys.addaudithook(watch)
    yield opened
    watching.clear()  # a hook cannot be removed


def main(arguments: list[str]) -> int:
    """Flip bits, print counts, and return 1 if a reader was deceived or crashed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.attack flips", description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=usable_cores())
    parser.add_argument("--keep", type=Path, help="folder for the list of all outcomes, as flips.jsonl")
    chosen = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(dir=memory_folder()) as folder:
        whole = make_run(Path(folder))
        flips = plan(whole, chosen.count, chosen.seed)
        found = list(attack(Path(folder), flips, chosen.workers))
    if chosen.keep:
        _keep(chosen.keep, found)
    return report(found, seed=chosen.seed)


def make_run(folder: Path) -> Path:
    """A finished run of two scenes, with its report, and one failed scene so that it has every kind of file."""
    scene = folder / "data" / "scene-0"
    call(["simulate", "--out", str(scene), *SCENE])
    shutil.copytree(scene, folder / "data" / "scene-1")
    shutil.copytree(scene, folder / "data" / "scene-2")
    (folder / "data" / "scene-2" / "poses.txt").write_text("damaged\n")
    (folder / "x.toml").write_text(EXPERIMENT)
    status, _, said = call(_resume(folder, folder / "whole"))
    if status != 2:
        raise RuntimeError(f"the run cannot be made (status {status}): {said}")
    _write_page(folder / "whole")
    return folder / "whole"


def plan(whole: Path, count: int, seed: int) -> list[Flip]:
    """Flips of all files in turn, at offsets that are spread over each file."""
    rng = random.Random(seed)
    paths = sorted(str(path.relative_to(whole)) for path in whole.rglob("*") if path.is_file())
    rng.shuffle(paths)
    flips = []
    for place, path in enumerate(paths):
        size, times = (whole / path).stat().st_size, len(range(place, count, len(paths)))
        parts = [(size * part // times, size * (part + 1) // times) for part in range(times)]
        flips += [
            Flip(path, min(rng.randrange(low, max(high, low + 1)), size - 1), rng.randrange(8)) for low, high in parts
        ]
    return flips


def attack(folder: Path, flips: list[Flip], workers: int) -> Iterator[tuple[Flip, list[Outcome]]]:
    """Outcomes of every flip, in order."""
    shares = [flips[place::workers] for place in range(workers)]
    if workers == 1:
        yield from attack_all(folder, 0, flips)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for found in pool.map(attack_all, [folder] * workers, range(workers), shares):
            yield from found


def attack_all(folder: Path, number: int, flips: list[Flip]) -> list[tuple[Flip, list[Outcome]]]:
    """Outcomes of flips, one after the other, each in a new copy of the whole run."""
    place = folder / f"copy-{number}"
    place.mkdir()
    run = place / "run"
    shutil.copytree(folder / "whole", run)
    readers = [Reader.of(name, read, run) for name, read in READERS.items()]
    expected = contents(run)
    found = []
    for flip in flips:
        shutil.rmtree(run)
        shutil.copytree(folder / "whole", run)
        flip.apply(run)
        outcomes = [reader.judged(run, flip) for reader in readers]
        found.append((flip, [*outcomes, *resumed(folder, run, expected)]))
    return found


def resumed(folder: Path, run: Path, expected: dict[str, object]) -> Iterator[Outcome]:
    """What a resumption makes of a run; if it is refused, what a fresh start makes of it."""
    before = contents(run)
    for options in ([], ["--fresh"]):
        name = " ".join(["run", *options])
        status, _, said = call([*_resume(folder, run), *options])
        lines = [line for line in said.splitlines() if line.startswith("tracknoise: error: ")]
        if status == 2 and contents(run) == expected:
            yield Outcome(name, UNCHANGED if before == expected else REPAIRED)
            return
        refused = status == 1 and len(lines) == 1 and "internal error" not in said
        yield Outcome(name, NOTICED if refused and not options else "changed", said)
        if not refused:
            return


def contents(run: Path) -> dict[str, object]:
    """Files of a run: all but what a report writes, which are also its noise models, and no wall times."""
    files: dict[str, object] = {
        str(path.relative_to(run)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(run.rglob("*"))
        if path.is_file() and not any(path.is_relative_to(run / written) for written in OF_REPORT)
    }
    try:
        manifest = json.loads((run / "manifest.json").read_bytes())
        for entry in manifest["sequences"].values():
            entry["seconds"] = 0
        files["manifest.json"] = manifest
    except (ValueError, KeyError, AttributeError, TypeError):
        pass
    return files


def report(found: list[tuple[Flip, list[Outcome]]], *, seed: int) -> int:
    """Print counts by kind of file and reader, and what went wrong."""
    counts = Counter((_kind(flip.path), outcome.reader, outcome.kind) for flip, made in found for outcome in made)
    for (kind, reader, outcome), times in sorted(counts.items()):
        print(f"{kind:<24} {reader:<16} {outcome:<10} {times:6d}")
    wrong = [(flip, outcome) for flip, made in found for outcome in made if outcome.kind in WRONG]
    for flip, outcome in wrong:
        print(f"WRONG: {flip}: {outcome.reader} {outcome.kind}: {outcome.text[:300]}")
    files = len({flip.path for flip, _ in found})
    print(f"{len(found)} flips in {files} files, seed {seed}: {len(wrong)} readers deceived or crashed")
    return int(bool(wrong))


def _kind(path: str) -> str:
    folder = Path(path).parent
    return path if folder == Path() or folder == Path("statistics") else str(folder)


def _keep(folder: Path, found: list[tuple[Flip, list[Outcome]]]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    lines = [json.dumps([str(flip), *([o.reader, o.kind, o.text] for o in made)]) for flip, made in found]
    (folder / "flips.jsonl").write_text("\n".join(lines) + "\n")


def _findings(*options: str) -> Callable[[Path], str]:
    def read(run: Path) -> str:
        return _shown(["report", str(run), "--text", *options])

    return read


def _write_page(run: Path) -> dict[str, str]:
    """Hashes of the files of a new report, without drawn figures; their specifications are part of the page."""
    page = write_report(RunFolder(run), figure_formats=())
    files = sorted(path for path in page.parent.rglob("*") if path.is_file())
    return {str(path.relative_to(page.parent)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


READERS: dict[str, Callable[[Path], object]] = {
    "summary": lambda run: summary_text(RunFolder(run)),
    "findings": _findings(),
    "findings --json": _findings("--json"),
    "report": _write_page,
}


def _shown(arguments: list[str]) -> str:
    """What a command prints. An error of it is raised."""
    status, shown, said = call(arguments)
    if status == 1 and said.count("\n") == 1 and "internal error" not in said:
        raise TracknoiseError(said.strip())
    if status:
        raise RuntimeError(said)
    return shown + said


def _resume(folder: Path, run: Path) -> list[str]:
    return ["run", str(folder / "x.toml"), "--out", str(run), "--workers", "1", "--no-report", "--quiet"]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
