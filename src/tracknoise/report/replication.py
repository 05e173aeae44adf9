"""The pages of a replication: the paper's tables compared with the runs, and the differences from the paper."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tracknoise.findings.wording import DASH, number
from tracknoise.report import factor_effects, paper
from tracknoise.report.cells import Cells
from tracknoise.report.contents import read_contents
from tracknoise.report.departures import Part, departures
from tracknoise.report.report_data import ReportData
from tracknoise.report.templates import template
from tracknoise.tables.files import write_atomically
from tracknoise.tables.store import RunFolder


@dataclass(frozen=True, slots=True)
class Replicated:
    """One experiment of the paper, and its run if there is one.

    Attributes
    ----------
    experiment
        Its key in `tracknoise.report.paper`.
    found
        One sentence: the data that were found, or why there are none.
    run
        Its run, with a report; None where there is none.
    variants
        A run of its first scene with variants of its trackers; None where there is none.
    """

    experiment: str
    found: str
    run: RunFolder | None = None
    variants: RunFolder | None = None


def write_replication(folder: Path, replicated: Sequence[Replicated]) -> Path:
    """Write ``index.html`` and ``differences.html`` into the folder of the runs.

    Parameters
    ----------
    folder
        That contains the folders of the runs.
    replicated
        Every experiment of the paper, in the order of the page.

    Returns
    -------
    Path
        Of ``index.html``.

    Raises
    ------
    StoreError, SchemaError
        If a run is damaged, or the folder cannot be written.
    """
    parts = {item.experiment: _part(item) for item in replicated if item.run}
    shown: dict[str, Any] = {"paper": paper, "parts": parts}
    chapters = [_chapter(item, parts.get(item.experiment), folder) for item in replicated]
    total = {name: sum(chapter["tally"].get(name, 0) for chapter in chapters) for name in paper.AGREEMENTS}
    index = template("replication.html.j2").render(ran=_ran(replicated, parts), chapters=chapters, total=total, **shown)
    differences = template("differences.html.j2").render(departures=departures(list(parts.values())), **shown)
    write_atomically(folder / "differences.html", differences.encode())
    write_atomically(folder / "index.html", index.encode())
    return folder / "index.html"


def _part(item: Replicated) -> Part:
    assert item.run is not None
    variants = ReportData.of(item.variants) if item.variants else None
    return Part(paper.title(item.experiment), ReportData.of(item.run), variants)


def _chapter(item: Replicated, part: Part | None, folder: Path) -> Mapping[str, Any]:
    """What the page shows for one experiment."""
    chapter: dict[str, Any] = {"id": item.experiment, "title": paper.title(item.experiment), "found": item.found}
    if part is None or item.run is None:
        return {**chapter, "part": None, "tally": {}}
    table = part.data.comparison
    return {
        **chapter,
        "part": part,
        "tally": paper.tally(table, of="yardstick_agreement"),
        "sentences": factor_effects.sentences(part.data),
        "verdicts": factor_effects.verdicts(part.data),
        "page": f"{os.path.relpath(item.run.path, folder)}/report/index.html",
        "families": _with_figures(item.run.path / "report"),
    }


def _with_figures(report: Path) -> list[tuple[str, str, int]]:
    """Anchor, title and number of figures of each section of a report that has figures."""
    contents = read_contents(report) or {"sections": []}
    counted = [(section["id"], section["title"], len(section["figures"])) for section in contents["sections"]]
    return [section for section in counted if section[2]]


def _ran(replicated: Sequence[Replicated], parts: Mapping[str, Part]) -> Cells:
    rows = [_row(item, parts.get(item.experiment)) for item in replicated]
    headings = ["experiment", "data", "sequences", "failed", "observations", "cells", *paper.AGREEMENTS * 2]
    groups = [("", 6), ("paper's yardstick", len(paper.AGREEMENTS)), ("paired verdicts", len(paper.AGREEMENTS))]
    return Cells("Runs", headings, rows, [False, False, *[True] * (len(headings) - 2)], groups)


def _row(item: Replicated, part: Part | None) -> list[str]:
    if part is None:
        return [paper.title(item.experiment), item.found, *[DASH] * (4 + 2 * len(paper.AGREEMENTS))]
    manifest, table = part.data.manifest, part.data.comparison
    yardstick, paired = paper.tally(table, of="yardstick_agreement"), paper.tally(table)
    observed = int(part.data.counts.filter(kind="truth")["n"].sum())
    counts = [len(manifest.sequences), len(manifest.failures), observed, sum(paired.values()), *yardstick.values()]
    counts += paired.values()
    return [part.title, item.found, *map(number, counts)]
