"""The pages of a replication: the paper's claims, tables and figures beside those of the runs."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from tracknoise.paper import claim_verdicts
from tracknoise.paper.claim_verdicts import Judged, cells, claims
from tracknoise.paper.departures import Part, departures
from tracknoise.report import factor_section, figure_files, paper
from tracknoise.report.cells import Cells
from tracknoise.report.contents import read_contents
from tracknoise.report.figures.families import FAMILIES
from tracknoise.report.figures.figure import Figure
from tracknoise.report.report_data import ReportData
from tracknoise.report.templates import template
from tracknoise.tables.enumerations import Reading
from tracknoise.tables.files import write_atomically
from tracknoise.tables.store import RunFolder
from tracknoise.words import DASH, number

PAGE = "figures.html"
_FAMILIES = (
    "trimming",
    "feature-counts",
    "error-by-tracker",
    "error-by-speed",
    "error-by-lighting",
    "error-by-rotation",
    "error-by-direction",
)
"""Sections of a report that repeat figures of the paper and depend on its trimming."""
_OTHER_TRIMMING = ("-untrimmed", "-trimmed")
"""How ids of figures end that show other errors than those of the reading."""
_TRIMMING_IN_TITLE = {Reading.none: ", untrimmed", Reading.all: ", trimmed", Reading.followed: ", trimmed"}


@dataclass(frozen=True, slots=True)
class Beside:
    """One figure under every reading."""

    title: str  # its heading
    # path of the image within the folder of the page, by reading; without those that cannot be drawn
    files: Mapping[Reading, str]


def write_figures(
    folder: Path, runs: Mapping[str, Mapping[Reading, ReportData]], titles: Mapping[Reading, str]
) -> Path:
    """Draw the figures and write the page ``figures.html``."""
    chapters = {title: _drawn(folder, f"figures/{number}", data) for number, (title, data) in enumerate(runs.items())}
    page = template("side_by_side.html.j2").render(chapters=chapters, titles=titles)
    write_atomically(folder / PAGE, page.encode())
    return folder / PAGE


def _drawn(folder: Path, place: str, runs: Mapping[Reading, ReportData]) -> list[Beside]:
    by_figure: dict[str, dict[Reading, str]] = {}
    titles: dict[str, str] = {}
    for reading, data in runs.items():
        for figure in _figures(data):
            file = f"{place}/{figure.id}-{reading}.svg"
            write_atomically(folder / file, figure_files.render(figure_files.specification(figure), ("svg",))["svg"])
            by_figure.setdefault(figure.id, {})[reading] = file
            titles[figure.id] = figure.title.removesuffix(_TRIMMING_IN_TITLE[reading])
    return [Beside(titles[name], files) for name, files in by_figure.items()]


def _figures(data: ReportData) -> list[Figure]:
    figures = [item for family in FAMILIES if family.id in _FAMILIES for item in family.figures(data)]
    return [item for item in figures if isinstance(item, Figure) and not item.id.endswith(_OTHER_TRIMMING)]


@dataclass(frozen=True)
class Replicated:
    """One experiment of the paper, and its run if there is one."""

    experiment: str  # its key in `tracknoise.report.paper`
    found: str  # one sentence: the data that were found, or why there are none
    run: RunFolder | None = None  # its run, with a report; None where there is none
    # a run of its first scene with variants of its trackers; None where there is none
    variants: RunFolder | None = None
    # The same run under other readings of the paper's trimming. `run` is that of `Reading.all`.
    others: Mapping[Reading, RunFolder] = field(default_factory=dict)

    @cached_property
    def data(self) -> Mapping[Reading, ReportData]:
        """Tables of the run under each reading that there is, in the order of the readings."""
        runs = {**self.others, **({Reading.all: self.run} if self.run else {})}
        return {reading: ReportData.of(runs[reading]) for reading in Reading if reading in runs}


def judged_claims(replicated: Sequence[Replicated]) -> list[Judged]:
    """Verdicts on the claims of abstract, text and captions under every reading."""
    return claim_verdicts.judged(claims(), _by_reading(replicated))


def judged_cells(replicated: Sequence[Replicated]) -> list[Judged]:
    """Verdicts on the cells of the summary tables under every reading."""
    return claim_verdicts.judged(cells(), _by_reading(replicated))


def write_replication(folder: Path, replicated: Sequence[Replicated]) -> Path:
    """Write ``index.html``, ``differences.html``, ``figures.html`` and ``claims.csv`` into the folder of the runs.

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
    stated, of_tables = judged_claims(replicated), judged_cells(replicated)
    chapters = [_chapter(item, parts.get(item.experiment), folder, [stated, of_tables]) for item in replicated]
    total = {name: sum(chapter["tally"].get(name, 0) for chapter in chapters) for name in paper.AGREEMENTS}
    index = template("replication.html.j2").render(
        ran=_ran(replicated, parts), chapters=chapters, total=total, claims=_claims(stated, of_tables)
    )
    differences = template("differences.html.j2").render(departures=departures(list(parts.values())))
    drawn = {paper.title(item.experiment): item.data for item in replicated if item.run}
    write_figures(folder, drawn, claim_verdicts.READINGS)
    write_atomically(folder / "claims.csv", claim_verdicts.to_csv([*stated, *of_tables]).encode())
    write_atomically(folder / "differences.html", differences.encode())
    write_atomically(folder / "index.html", index.encode())
    return folder / "index.html"


def _by_reading(replicated: Sequence[Replicated]) -> claim_verdicts.Runs:
    runs = [(reading, item.experiment, data) for item in replicated for reading, data in item.data.items()]
    return {reading: {name: data for run_reading, name, data in runs if run_reading is reading} for reading in Reading}


def _claims(stated: Sequence[Judged], of_tables: Sequence[Judged]) -> Mapping[str, Any]:
    """What the page shows of the claims of all experiments."""
    return {
        "best": claim_verdicts.best_reading(stated),
        "stated": claim_verdicts.tallies(stated, "Claims of abstract, text and captions"),
        "cells": claim_verdicts.tallies(of_tables, "Cells of the summary tables"),
    }


def _part(item: Replicated) -> Part:
    variants = ReportData.of(item.variants) if item.variants else None
    return Part(paper.title(item.experiment), item.data[Reading.all], variants)


def _chapter(item: Replicated, part: Part | None, folder: Path, items: Sequence[Sequence[Judged]]) -> Mapping[str, Any]:
    """What the page shows for one experiment."""
    chapter: dict[str, Any] = {"id": item.experiment, "title": paper.title(item.experiment), "found": item.found}
    if part is None or item.run is None:
        return {**chapter, "part": None, "tally": {}}
    table = part.data.comparison
    stated, of_tables = ([judged for judged in group if judged.claim.experiment == item.experiment] for group in items)
    return {
        **chapter,
        "claims": claim_verdicts.table(stated, "Claims of abstract, text and captions"),
        "cells": claim_verdicts.table(of_tables, "Cells of the summary table, by paired verdicts"),
        "part": part,
        "tally": paper.tally(table, of="yardstick_agreement"),
        "sentences": factor_section.sentences(part.data),
        "verdicts": factor_section.verdicts(part.data),
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
    observed = int(part.data["counts"].filter(kind="truth")["n"].sum())
    counts = [len(manifest.sequences), len(manifest.failures), observed, sum(paired.values()), *yardstick.values()]
    counts += paired.values()
    return [part.title, item.found, *map(number, counts)]
