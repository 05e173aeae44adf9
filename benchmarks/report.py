"""How large a report is, how long it takes to write, and how soon a reader can use it.

The run is made up and has the conditions of the light stage: two trackers, five speeds and 19 lightings. Scenes go
through the very functions that a run puts measured ones through. At full size some of them stand in for others, under
other names. The time is that of the processor, of one thread, so that it can be measured on a machine that does other
things too. A page can be used when a choice in its explorer has changed a figure; this is measured in a headless
Chromium, if there is one.

``python -m benchmarks.report --counts RUN ...`` counts what a reader sees in the reports of runs: words and numbers of
the first screen, open sections and figures, words, height and printed pages, and nodes for screen readers.
"""

import base64
import json
import re
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import polars as pl
from tests.browser import chromium

from benchmarks.harness import Row, in_new_process
from benchmarks.made_up import CAMERA, EXPERIMENT, made_up, renamed, seen_by_a_still_camera
from tracknoise.experiments.measure import complete
from tracknoise.experiments.resume import new_manifest
from tracknoise.experiments.run_findings import compute_findings
from tracknoise.experiments.run_statistics import compute_statistics
from tracknoise.experiments.settings import Experiment, parse_experiment
from tracknoise.experiments.task import tables_to_keep
from tracknoise.report.page import write_report
from tracknoise.tables.findings_schema import SUMMARY
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import RunFolder

FEW, MANY = 3, 60
LIGHTINGS = ("diffuse", *(f"LR{place}" for place in range(10)), *(f"BF{place}" for place in range(8)))
FRAMES, OBSERVATIONS = 49, 20_000
DIFFERENT = 67
"""Sequences that differ. It is a prime number, so that scenes of a condition differ, and lightings of a scene."""
_CHOICE = """(async () => {
  const select = document.querySelector("#controls [name=tracker]");
  select.value = select.options[0].value;
  select.dispatchEvent(new Event("change", { bubbles: true }));
  const place = document.querySelector("[data-explorer]");
  while (!place.dataset.shown || JSON.parse(place.dataset.shown).tracker !== select.value) {
    await new Promise((resolve) => setTimeout(resolve, 5));
  }
  return performance.now() / 1000;
})()"""


def rows() -> list[Row]:
    """Of a few scenes."""
    return _rows(FEW)


def full_rows() -> list[Row]:
    """Of as many scenes as the light stage has."""
    return _rows(MANY)


def _rows(scenes: int) -> list[Row]:
    found = in_new_process("benchmarks.report", scenes)
    size = f"{scenes} scenes, {found['conditions']} conditions"
    made = [
        Row("report: page", found["page"] / 1e6, "MB", size),
        Row("report: page and files", found["all"] / 1e6, "MB", f"{found['files']} files"),
        Row("report: writing", found["writing"], "s of processor", size),
    ]
    if "interactive" in found:
        made += [
            Row("report: from opening the page to a changed figure", found["interactive"], "s", size),
            Row("report: the page's own share of it", found["working"], "s of processor", "its main thread"),
        ]
    return made


def _measure(scenes: int) -> dict[str, float]:
    experiment = parse_experiment(EXPERIMENT, place="benchmark")
    with tempfile.TemporaryDirectory() as folder:
        run = RunFolder(Path(folder) / "run")
        conditions = _make(run, experiment, scenes)
        start = time.process_time()
        page = write_report(run)
        writing = time.process_time() - start
        files = [path for path in page.parent.rglob("*") if path.is_file()]
        found = {"conditions": conditions, "page": page.stat().st_size, "files": len(files), "writing": writing}
        found["all"] = sum(path.stat().st_size for path in files)
        return found | ({} if chromium.installed() is None else _interactive_s(page, Path(folder)))


def _make(run: RunFolder, experiment: Experiment, scenes: int) -> int:
    """Write a run, and say how many conditions it has."""
    manifest = new_manifest(experiment)
    run.create(experiment.to_toml(), manifest)
    made = [_tables(experiment, seed) for seed in range(min(DIFFERENT, scenes * len(LIGHTINGS)))]
    for number in range(scenes):
        for place, lighting in enumerate(LIGHTINGS):
            tables = made[(number * len(LIGHTINGS) + place) % len(made)]
            entry = _write(run, tables, f"SET{number:03d}", lighting)
            manifest.sequences[entry.key] = entry
    run.write_manifest(manifest)
    statistics = compute_statistics(run, experiment)
    compute_findings(run, experiment, statistics)
    return int(run.statistics(SUMMARY).height)


def _tables(experiment: Experiment, seed: int) -> dict[str, pl.DataFrame]:
    """Tables of one sequence."""
    tables = made_up("scene", seed=seed, frames=FRAMES, observations=OBSERVATIONS, lighting="light")
    sequence = seen_by_a_still_camera(SequenceId("made up", "scene", "light"), FRAMES)
    return tables_to_keep(experiment, sequence, complete(sequence, tables))


def _write(run: RunFolder, tables: dict[str, pl.DataFrame], scene: str, lighting: str) -> SequenceEntry:
    """Write them as those of another sequence."""
    name = SequenceId("made up", scene, lighting)
    entry = SequenceEntry(name, FRAMES, CAMERA.width, CAMERA.height, "birth", 0, 0.0)
    kept = renamed(tables, {"scene": scene, "lighting": lighting})
    return replace(entry, sha256=run.write_sequence(entry.key, kept, b""))


def _interactive_s(page: Path, folder: Path) -> dict[str, float]:
    """Seconds from opening a page to the first figure that a choice has changed; processor time of its main thread."""
    with chromium.browser(folder / "profile") as pipe, chromium.tab(pipe) as tab:
        tab.size(1366, 768)
        tab.command("Performance.enable", timeDomain="threadTicks")
        tab.goto(f"file://{page}")
        interactive = float(tab.evaluate(_CHOICE))
        metrics = {one["name"]: one["value"] for one in tab.command("Performance.getMetrics")["metrics"]}
    return {"interactive": interactive, "working": metrics["TaskDuration"]}


_SEEN = """(() => {
  const text = (one) => one.innerText;
  const parts = "h1, h2, p, th, td, figcaption, text".split(", ").map((name) => `.first ${name}`).join(", ");
  const shown = [...document.querySelectorAll(parts)]
    .filter((one) => !one.querySelector("select") && !one.parentElement.closest("p, td, th, h2"));
  const first = shown.map((one) => one.textContent).join(" ");
  const beside = shown.filter((one) => !one.closest(".board")).map((one) => one.textContent).join(" ");
  const open = [...document.querySelectorAll("section.open")];
  const numbers = (words) => (words.match(/(?<![\\w.])\\d[\\d,.]*/g) ?? []).length;
  const words = (all) => all.split(/\\s+/).filter((word) => /\\w/.test(word)).length;
  const page = text(document.querySelector("main"));
  return {
    "words on the first screen": words(first),
    "numbers on the first screen": numbers(first),
    "words beside the leaderboard": words(beside),
    "numbers beside the leaderboard": numbers(beside),
    "undecided on the first screen": (first.match(/undecided/gi) ?? []).length,
    "open sections": open.length + 1,
    "open figures": document.querySelectorAll("section.open figure, .first figure").length,
    "words": words(page),
    "undecided": (page.match(/undecided/gi) ?? []).length,
    "height, px": document.documentElement.scrollHeight,
  };
})()"""
_DRAWN = "[...document.querySelectorAll('section.open [data-figure]')].every((one) => one.dataset.drawn === 'yes')"


def counts(run: Path) -> dict[str, float]:
    """What a reader sees of the report of a run, in a window of 1366 times 768 px."""
    page = (run / "report" / "index.html").resolve()
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
        chromium.browser(Path(folder)) as pipe,
        chromium.tab(pipe) as tab,
    ):
        tab.size(1366, 768)
        tab.goto(page.as_uri())
        tab.wait(_DRAWN)
        tab.evaluate("document.fonts.ready.then(() => true)")
        found = dict(tab.evaluate(_SEEN))
        tab.command("Accessibility.enable")
        nodes = tab.command("Accessibility.getFullAXTree")["nodes"]
        found["nodes for screen readers"] = sum(not node["ignored"] for node in nodes)
        printed = base64.b64decode(tab.command("Page.printToPDF")["data"])
        found["printed pages"] = len(re.findall(rb"/Type\s*/Page\b", printed))
        found["size, MB"] = page.stat().st_size / 1e6
    return found


def _print_counts(runs: Sequence[Path]) -> None:
    table = {run.name: counts(run) for run in runs}
    names = next(iter(table.values()))
    print("".join([f"{'':32}", *(f"{name[:16]:>17}" for name in table)]))
    for name in names:
        print("".join([f"{name:32}", *(f"{found[name]:17,.4g}" for found in table.values())]))


if __name__ == "__main__":
    if sys.argv[1] == "--counts":
        _print_counts([Path(name) for name in sys.argv[2:]])
    else:
        json.dump(_measure(int(sys.argv[1])), sys.stdout)
