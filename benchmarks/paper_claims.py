"""The paper's claims, judged by runs of its simulated experiments, and the tables of docs/paper.md.

    python -m benchmarks.paper_claims measure --scenes 6 --frames 60 --width 320 --out /tmp/claims
    python -m benchmarks.paper_claims tables /tmp/claims --write docs/paper.md

`measure` runs the presets as they are, except for the number of scenes and frames and the size of the images. At full
size, use `tracknoise replicate` instead. `tables` prints the verdicts of either as Markdown, or writes them into a
page.
"""

import argparse
import csv
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from tracknoise.cli.progress import RunProgress
from tracknoise.cli.shared_options import processes
from tracknoise.cli.terminal import Terminal
from tracknoise.experiments.execute import execute, remake
from tracknoise.experiments.load import load_experiment, resolve
from tracknoise.experiments.settings import Experiment
from tracknoise.paper.claim_verdicts import Agreement
from tracknoise.paper.replication import Replicated, write_replication
from tracknoise.paper.variants import SIMULATED, as_read
from tracknoise.report import paper
from tracknoise.tables.enumerations import Reading
from tracknoise.tables.store import RunFolder

BEGIN, END = "<!-- claims: begin -->", "<!-- claims: end -->"
Row = Mapping[str, str]


def reduced(preset: str, *, scenes: int, frames: int, width: int) -> Experiment:
    """The experiment of a preset with fewer scenes and frames, and smaller images of the same field of view."""
    experiment = load_experiment(preset)
    for name, value in {"worlds": scenes, "frames": frames, "width": width, "height": width * 3 // 4}.items():
        experiment = experiment.with_option(name, value)
    return resolve(experiment)


def replicated(experiment: Experiment, out: Path) -> Replicated:
    """Measure an experiment, and make its run again under the other readings of trimming."""
    run = RunFolder(out / experiment.name)
    with RunProgress(Terminal()) as shown:
        execute(experiment, run, listener=shown, workers=processes(None))
    others = {
        reading: RunFolder(out / "readings" / f"{experiment.name}-{reading}")
        for reading in (Reading.none, Reading.followed)
    }
    for reading, folder in others.items():
        remake(run, as_read(run, reading), folder)
    return Replicated(experiment.name, "Simulated; reduced in size.", run, None, others)


def tables(rows: Sequence[Row]) -> str:
    """Markdown: the claims about repeated experiments with what was measured, then the counts of all verdicts."""
    stated = [row for row in rows if row["source"] != "summary table"]
    cells = [row for row in rows if row["source"] == "summary table"]
    parts = [
        "\n".join(_table(["experiment", "claim", *Reading], _claims(stated))),
        "\n".join(_table(["verdicts", *Reading], _counts({"claims": stated, "cells": cells}))),
    ]
    return "\n\n".join(parts)


def _table(headings: Sequence[str], rows: Iterator[list[str]]) -> Iterator[str]:
    yield f"| {' | '.join(headings)} |"
    yield f"|{' --- |' * len(headings)}"
    for row in rows:
        yield f"| {' | '.join(row)} |"


def _by_claim(rows: Sequence[Row]) -> Iterator[dict[str, Row]]:
    """The rows of each claim, by reading."""
    for start in range(0, len(rows), len(Reading)):
        yield {row["reading"]: row for row in rows[start : start + len(Reading)]}


def _claims(rows: Sequence[Row]) -> Iterator[list[str]]:
    """What was measured is that of the reading with untrimmed errors."""
    for claim in _by_claim(rows):
        first = claim[Reading.none]
        if first["reason"] != "the experiment was not repeated":
            verdicts = [row["verdict"] for row in claim.values()]
            verdicts[0] = f"{verdicts[0]}: {first['measured']}".removesuffix(": ")
            yield [paper.title(first["experiment"]), first["text"], *verdicts]


def _counts(groups: Mapping[str, Sequence[Row]]) -> Iterator[list[str]]:
    for name, rows in groups.items():
        for agreement in Agreement:
            found = [row["reading"] for row in rows if row["verdict"] == agreement]
            yield [f"{name}: {agreement}", *(str(found.count(reading)) for reading in Reading)]


def written(page: str, text: str) -> str:
    """A page with other tables between its marks."""
    before, _, rest = page.partition(BEGIN)
    return f"{before}{BEGIN}\n\n{text}\n\n{END}{rest.partition(END)[2]}"


def read(folder: Path) -> list[Row]:
    """Rows of ``claims.csv``."""
    with (folder / "claims.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("measure")
    for name in ("scenes", "frames", "width"):
        run.add_argument(f"--{name}", type=int, required=True)
    run.add_argument("--out", type=Path, required=True)
    shown = commands.add_parser("tables")
    shown.add_argument("folder", type=Path)
    shown.add_argument("--write", type=Path)
    return parser.parse_args()


def main() -> None:
    """Measure, or print the tables."""
    asked = _arguments()
    if asked.command == "measure":
        limits = {"scenes": asked.scenes, "frames": asked.frames, "width": asked.width}
        write_replication(asked.out, [replicated(reduced(name, **limits), asked.out) for name in SIMULATED])
        return
    text = tables(read(asked.folder))
    if asked.write is None:
        sys.stdout.write(f"{text}\n")
    else:
        asked.write.write_text(written(asked.write.read_text(encoding="utf-8"), text), encoding="utf-8")


if __name__ == "__main__":
    main()
