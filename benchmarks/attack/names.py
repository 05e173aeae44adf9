"""Carry naughty names through the whole pipeline.

    python -m benchmarks.attack names [--count N] [--seed N] [--batch N]

Names come from a list of strings that programs stumble over, and from random mixtures of them. Each batch of names is
one data set whose folders have these names, and one experiment whose trackers have them. It is measured, its findings
are printed and its report is written with figures, by the functions of the command line. Then sequences whose data set,
scene, lighting and camera have these names are measured and analysed by the functions of the Python interface.

A scene may fail with one line, and settings may refuse a name with one line; neither may be an internal error. Control
characters in settings must be refused, other names must not. Whatever was measured must be in the report: a row of
`tables/summary.csv` for each tracker and lighting, and a figure that can be parsed for each id. No line of the terminal
and no file of the report may hold a control character, and no text of a CSV file may start as a formula does. Printed
are counts by outcome.
"""

import argparse
import csv
import json
import os
import random
import re
import shutil
import sys
import tempfile
import unicodedata
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import tomlkit

import tracknoise
from benchmarks.attack.command import SCENE, call, memory_folder
from benchmarks.attack.naughty import NAUGHTY
from tracknoise.exceptions import TracknoiseError
from tracknoise.experiments.settings import parse_experiment
from tracknoise.report.page import write_report
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.store import RunFolder

_CONTROL = {"Cc", "Cs"}
"""Categories of characters that no setting may have."""
FORMATS = ("svg", "png")
"""Of the figures of a report."""
_NO_FORMULA = re.compile(r"[-+]?(\d+\.?\d*(e[-+]?\d+)?|inf|nan)", re.IGNORECASE)


def main(arguments: list[str]) -> int:
    """Try names, print counts, and return 1 if one was not dealt with."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.attack names", description=__doc__)
    parser.add_argument("--count", type=int, default=len(NAUGHTY))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--batch", type=int, default=5, help="names in one run")
    chosen = parser.parse_args(arguments)
    names = list(chosen_names(chosen.count, random.Random(chosen.seed)))
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(dir=memory_folder()) as folder:
        call(["simulate", "--out", f"{folder}/scene", *SCENE])
        for place in range(0, len(names), chosen.batch):
            counts.update(attacked(Path(folder), names[place : place + chosen.batch]))
    for outcome, times in sorted(counts.items()):
        print(f"{times:6d} {outcome}")
    wrong = sum(times for outcome, times in counts.items() if outcome.startswith("WRONG"))
    print(f"{len(names)} names, seed {chosen.seed}: {wrong} not dealt with")
    return int(bool(wrong))


def chosen_names(count: int, rng: random.Random) -> Iterator[str]:
    """The listed names in random order, then mixtures of two of them. All differ."""
    seen = dict.fromkeys(rng.sample(NAUGHTY, min(count, len(NAUGHTY))))
    while len(seen) < count:
        first, second = rng.sample(NAUGHTY, 2)
        seen[first[: rng.randrange(1, 9)] + rng.choice(["", " ", "-", "/"]) + second[: rng.randrange(1, 240)]] = None
    yield from seen


def attacked(folder: Path, names: list[str]) -> Iterator[str]:
    """Outcomes of a batch of names."""
    place = folder / "batch"
    try:
        labels = [name for name in names if not refused(name)]
        yield from map(judged_setting, names)
        made = [name for name in names if make_scene(folder / "scene", place / "data", name)]
        if labels and made:
            yield from run_of(place, labels, made)
        yield from analysis_of(folder / "scene", names)
    finally:
        shutil.rmtree(place, ignore_errors=True)


def refused(name: str) -> str:
    """Why the settings refuse a name of a tracker; empty if they accept it."""
    try:
        parse_experiment(settings([name], Path("data")), place="x.toml")
    except (TracknoiseError, UnicodeError) as error:
        return str(error)
    return ""


def judged_setting(name: str) -> str:
    """Outcome of a name of a tracker in the settings."""
    why, has_control = refused(name), any(unicodedata.category(sign) in _CONTROL for sign in name)
    if "\n" in why:
        return f"WRONG: settings refuse {name!r} with several lines"
    if has_control and not why:
        return f"WRONG: settings accept the control characters of {name!r}"
    return "name of a tracker: " + ("refused" if why else "accepted")


def settings(labels: Iterable[str], data: Path) -> str:
    """An experiment whose trackers have these names."""
    document = {
        "name": "names",
        "dataset": {"reader": "folder", "root": str(data)},
        "trackers": [{"kind": "oracle", "name": label} for label in labels],
        "statistics": {"min_features": 5},
    }
    return tomlkit.dumps(document)


def make_scene(scene: Path, data: Path, name: str) -> bool:
    """Copy the scene to a folder of this name; whether the file system can have it."""
    if os.path.normpath(f"/{name}") != f"/{name}":
        return False
    try:
        shutil.copytree(scene, data / name)
    except (OSError, ValueError):
        return False
    return True


def run_of(place: Path, labels: list[str], scenes: list[str]) -> Iterator[str]:
    """Outcomes of a run: measured, found and shown."""
    (place / "x.toml").write_text(settings(labels, place / "data"), encoding="utf-8")
    out = place / "run"
    commands = [
        ["run", str(place / "x.toml"), "--out", str(out), "--workers", "1", "--no-report"],
        ["report", str(out), "--text"],
    ]
    for command in commands:
        status, shown, said = call(command)
        yield from printed(command[0], shown + said)
        if status not in (0, 2) or "internal error" in said or "Traceback" in said:
            yield f"WRONG: {command[0]} ends with {status} for {labels} and {scenes}: {said[-300:]!r}"
            return
    manifest = RunFolder(out).manifest()
    if len(manifest.sequences) + len(manifest.failures) != len(scenes):
        yield f"WRONG: {len(scenes)} scenes gave {len(manifest.sequences)} results: {scenes}"
    for cause in manifest.failures.values():
        yield "scene: failed" if cause.startswith("scene ") else f"WRONG: a scene failed: {cause}"
    yield from ["scene: measured"] * len(manifest.sequences)
    yield from shown_in_report(RunFolder(out), labels, "tracker")


def analysis_of(scene: Path, names: list[str]) -> Iterator[str]:
    """Outcomes of an analysis of sequences whose data set, scene, lighting and camera have these names."""
    sequence = tracknoise.open_sequence("folder", scene)
    ids = [SequenceId("folder", name, name, camera=name) for name in names]
    measured = []
    for name in ids:
        try:
            name.require_utf8()
        except TracknoiseError:
            yield "lighting: cannot be stored"
        else:
            measured.append(tracknoise.measure(replace(sequence, id=name), tracknoise.Oracle()))
    if measured:
        run = tracknoise.analyse(measured, min_features=5)
        yield from shown_in_report(RunFolder(run.path), [item.sequence.id.lighting for item in measured], "lighting")
    for name in names:
        try:
            named = replace(sequence, id=SequenceId(name, "scene"))
            tracknoise.analyse(tracknoise.measure(named, tracknoise.Oracle()), min_features=5)
        except (TracknoiseError, UnicodeError):
            yield "data set: refused"
        else:
            yield "data set: analysed"


def shown_in_report(run: RunFolder, names: list[str], column: str) -> Iterator[str]:
    """Outcomes of the report of a run in which these names were measured."""
    try:
        report = write_report(run, figure_formats=FORMATS).parent
    except Exception as error:
        yield f"WRONG: no report for {names}: {type(error).__name__}: {str(error)[:300]}"
        return
    sections = json.loads((report / "contents.json").read_text())["sections"]
    figures = [item["id"] for section in sections for item in section["figures"]]
    drawn = sorted(path.stem for path in (report / "figures").glob("*.svg"))
    if sorted(figures) != drawn:
        yield f"WRONG: figures {figures}, files {drawn}"
    for path in (report / "figures").glob("*.svg"):
        ET.parse(path)
    for path in (path for path in report.rglob("*") if path.suffix in {".csv", ".tex", ".html", ".json", ".svg"}):
        yield from printed(path.name, path.read_text(encoding="utf-8"))
    for path in (report / "tables").glob("*.csv"):
        yield from cells_of(path)
    with (report / "tables" / "summary.csv").open(newline="") as file:
        found = Counter(row[column] for row in csv.DictReader(file))
    yield f"{column}: shown" if len(found) == len(names) else f"WRONG: {names} are shown as {list(found)}"


def cells_of(path: Path) -> Iterator[str]:
    """What is wrong with the cells of a CSV file."""
    with path.open(newline="") as file:
        for cell in {cell for row in csv.reader(file) for cell in row}:
            if cell.startswith(("=", "+", "-", "@", "\t", "\r")) and not _NO_FORMULA.fullmatch(cell):
                yield f"WRONG: {path.name} has the cell {cell!r}"


def printed(where: str, text: str) -> Iterator[str]:
    """What is wrong with a text that was shown or written."""
    bad = {sign for sign in set(text) - set("\n\t") if unicodedata.category(sign) in _CONTROL}
    if bad:
        yield f"WRONG: {where} holds {sorted(bad)}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
