"""The pages that join the runs of a replication: the paper's tables beside ours, and the differences from the paper."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from tracknoise.report import matters, paper, tables
from tracknoise.report.departures import Part, departures
from tracknoise.report.evidence import Evidence
from tracknoise.report.page import template
from tracknoise.report.sentences import DASH, number
from tracknoise.tables.files import write_atomically
from tracknoise.tables.store import RunFolder


@dataclass(frozen=True, slots=True)
class Replicated:
    """One experiment of the paper, as far as it was repeated.

    Attributes
    ----------
    experiment
        The paper's name of it, as in `tracknoise.report.paper`.
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
    """Write ``index.html`` and ``differences.html`` into the folder that holds the runs.

    Parameters
    ----------
    folder
        Holds the folders of the runs.
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
    intervals = any(not part.evidence.dependence.is_empty() for part in parts.values())
    shown: dict[str, Any] = {"paper": paper, "parts": parts, "intervals": intervals}
    chapters = [_chapter(item, parts.get(item.experiment), folder) for item in replicated]
    total = {name: sum(chapter["tally"].get(name, 0) for chapter in chapters) for name in paper.AGREEMENTS}
    index = template("replication.html.j2").render(ran=_ran(replicated, parts), chapters=chapters, total=total, **shown)
    differences = template("differences.html.j2").render(departures=departures(list(parts.values())), **shown)
    write_atomically(folder / "differences.html", differences.encode())
    write_atomically(folder / "index.html", index.encode())
    return folder / "index.html"


def _part(item: Replicated) -> Part:
    assert item.run is not None
    variants = Evidence.of(item.variants) if item.variants else None
    return Part(paper.title(item.experiment), Evidence.of(item.run), variants)


def _chapter(item: Replicated, part: Part | None, folder: Path) -> Mapping[str, Any]:
    """What the page says of one experiment."""
    chapter: dict[str, Any] = {"id": item.experiment, "title": paper.title(item.experiment), "found": item.found}
    if part is None or item.run is None:
        return {**chapter, "part": None, "tally": {}}
    table = paper.comparison(part.evidence)
    return {
        **chapter,
        "part": part,
        "tally": paper.tally(table),
        "sentences": matters.sentences(part.evidence),
        "verdicts": matters.verdicts(part.evidence),
        "page": f"{os.path.relpath(item.run.path, folder)}/report/index.html",
        "families": _Families.of(item.run.path / "report" / "index.html").found,
    }


class _Families(HTMLParser):
    """The sections of a report that have figures: anchor, title and count of figures of each, in `found`."""

    def __init__(self) -> None:
        super().__init__()
        self._section, self._in_heading = ["", ""], False
        self._n_figures: dict[tuple[str, str], int] = {}

    @classmethod
    def of(cls, page: Path) -> "_Families":
        """Read a page; one that is not there has none."""
        families = cls()
        if page.is_file():
            families.feed(page.read_text(encoding="utf-8").partition("<script")[0])
        return families

    @property
    def found(self) -> list[tuple[str, str, int]]:
        return [(*section, n) for section, n in self._n_figures.items()]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "section":
            self._section = [dict(attrs).get("id") or "", ""]
        elif tag == "figure":
            section = self._section[0], self._section[1]
            self._n_figures[section] = self._n_figures.get(section, 0) + 1
        self._in_heading = tag == "h2"

    def handle_data(self, data: str) -> None:
        if self._in_heading:
            self._section[1] += data

    def handle_endtag(self, tag: str) -> None:
        self._in_heading = False


def _ran(replicated: Sequence[Replicated], parts: Mapping[str, Part]) -> tables.Cells:
    rows = [_row(item, parts.get(item.experiment)) for item in replicated]
    headings = ["experiment", "data", "sequences", "failed", "observations", "cells", *paper.AGREEMENTS * 2]
    groups = [("", 6), ("verdicts", len(paper.AGREEMENTS)), ("effects alone", len(paper.AGREEMENTS))]
    return tables.Cells("What ran", headings, rows, [False, False, *[True] * (len(headings) - 2)], groups)


def _row(item: Replicated, part: Part | None) -> list[str]:
    if part is None:
        return [paper.title(item.experiment), item.found, *[DASH] * (4 + 2 * len(paper.AGREEMENTS))]
    manifest, table = part.evidence.manifest, paper.comparison(part.evidence)
    tally, alone = paper.tally(table), paper.tally(table, of="point_agreement")
    observed = int(part.evidence.counts.filter(kind="truth")["n"].sum())
    counts = [len(manifest.sequences), len(manifest.failures), observed, sum(tally.values()), *tally.values()]
    counts += alone.values()
    return [part.title, item.found, *map(number, counts)]
