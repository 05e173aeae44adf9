"""The layout of a report: its sections, figures and tables in their order, for the page and for programs.

- ``contents.json``: the sections, figures and tables of a report, for programs and for other pages.
- Which sections of the page are open, each with the figures that answer its question, and what is folded.
"""

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tracknoise.exceptions import StoreError
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.text import printable

CONTENTS = "contents.json"
FORMAT = 1


@dataclass(frozen=True, slots=True)
class Section:
    """A section of the report.

    Attributes
    ----------
    id, title
        Its anchor in the page, and its heading.
    items
        Its figures, and those that could not be drawn.
    tables
        Names, titles and kinds of the table files that it links to.
    has_cells
        Whether tables stand below its figures.
    """

    id: str
    title: str
    items: Sequence[Figure | Absence] = ()
    tables: Sequence[tuple[str, str, Sequence[str]]] = ()
    has_cells: bool = False


def contents_json(experiment: str, sections: Sequence[Section], formats: Sequence[str]) -> str:
    """Write the table of contents."""
    document = {
        "format": FORMAT,
        "title": f"{experiment} \N{EN DASH} tracknoise report",
        "experiment": experiment,
        "tracknoise": version("tracknoise"),
        "page": "index.html",
        "sections": [_section(section, formats) for section in sections],
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _section(section: Section, formats: Sequence[str]) -> dict[str, Any]:
    figures = [
        _files(item.id, item.title, "figures", formats) | ({"message": printable(item.message)} if item.message else {})
        for item in section.items
        if isinstance(item, Figure)
    ]
    absences = [item for item in section.items if isinstance(item, Absence)]
    return {
        "id": section.id,
        "title": section.title,
        "figures": figures,
        "tables": [_files(name, title, "tables", kinds) for name, title, kinds in section.tables],
        "absences": [{"id": item.id, "title": printable(item.title), "why": printable(item.why)} for item in absences],
    }


def _files(name: str, title: str, folder: str, kinds: Sequence[str]) -> dict[str, Any]:
    return {"id": name, "title": printable(title), "files": [f"{folder}/{name}.{kind}" for kind in kinds]}


def read_contents(report: Path) -> dict[str, Any] | None:
    """Read the table of contents of a report. None where there is none.

    Parameters
    ----------
    report
        Folder of the report.

    Raises
    ------
    StoreError
        If it is damaged, or of another format.
    """
    path = report / CONTENTS
    try:
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, RecursionError) as error:
        raise StoreError(f"{path}: damaged ({error}), expected a table of contents; {_REMEDY}") from error
    if document.get("format") != FORMAT:
        raise StoreError(f"{path}: found format {document.get('format')!r}, expected {FORMAT}; {_REMEDY}")
    return document


_REMEDY = "`tracknoise report` writes it again"


@dataclass(frozen=True, slots=True)
class Opening:
    """A section of the page that is open from the start.

    Attributes
    ----------
    title
        Its heading: the question that it answers.
    figures
        Beginnings of the ids of its figures, each of which stands for one figure. The first two that there are stand.
    """

    title: str
    figures: tuple[str, ...] = ()


def accuracy_title(*, compared: bool) -> str:
    """Heading about accuracy; `compared`: whether there are several trackers."""
    return "Which is better" if compared else "How accurate it is"


TRUTH_TITLE = "Can the truth be trusted"
"""Heading of what is said of the truth."""
_ACCURACY = "error-by-tracker"
_MOST_FIGURES = 2
_EXAMPLES = "example-frames-"
OPENINGS: Mapping[str, Opening] = {
    "estimator": Opening("Files for your estimator"),
    _ACCURACY: Opening(accuracy_title(compared=True), ("ranking", "cost-", "error-by-age")),
    "lifetimes": Opening("How long tracks live", ("lifetimes", "outlier-ratio")),
    "time-structure": Opening("How errors grow, and how heavy their tails are", ("time-structure", "gaussianity")),
    "error-by-place": Opening("Where errors are", ("image-map-", "surroundings-")),
    "truth": Opening(TRUTH_TITLE, ("pose-errors", "audit-")),
    "explorer": Opening("Look closer", (_EXAMPLES,)),
}
"""Sections that are open, by id. All else is under "Everything measured"."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where the sections of a report stand in its page.

    Attributes
    ----------
    open
        Sections that are open, in order.
    folded
        Sections under "Everything measured". Each is drawn when the reader opens it.
    """

    open: Sequence[Section]
    folded: Sequence[Section]

    @property
    def every(self) -> list[Section]:
        """All sections in the order of the page."""
        return [*self.open, *self.folded]


def layout(sections: Sequence[Section], *, filmed: bool = False, compared: bool = True) -> Layout:
    """Divide sections into those that are open and those that are folded.

    Of the figures that a section of the page may show for each of its beginnings, it shows the first one that states a
    finding, or else the first one.

    Parameters
    ----------
    sections
        All sections, each under an id of its own.
    filmed
        Whether the page shows the frames of a scene, in place of its example.
    compared
        Whether there are several trackers.
    """
    figures = [item for section in sections for item in section.items if isinstance(item, Figure)]
    by_id = {section.id: section for section in sections}
    opened, shown = [], set[str]()
    for name, opening in OPENINGS.items():
        starts = [start for start in opening.figures if not (filmed and start == _EXAMPLES)]
        chosen = [candidate for start in starts if (candidate := _chosen(figures, start)) is not None][:_MOST_FIGURES]
        shown |= {entry.id for entry in chosen}
        if chosen or name in by_id:
            title = accuracy_title(compared=compared) if name == _ACCURACY else opening.title
            opened.append(Section(name, title, chosen))
    return Layout(opened, [*_folded(sections, {entry.id for entry in opened}, shown)])


def _chosen(figures: Sequence[Figure], start: str) -> Figure | None:
    able = [figure for figure in figures if figure.id.startswith(start)]
    return next((figure for figure in able if figure.message), able[0] if able else None)


def _folded(sections: Sequence[Section], opened: Collection[str], shown: Collection[str]) -> Iterator[Section]:
    """What the open sections leave. A section of which a part is open has another id: its own is that of the part."""
    for section in sections:
        remaining = [item for item in section.items if item.id not in shown]
        if remaining or section.has_cells or not (section.items or section.id in opened):
            is_parted = section.id in opened or len(remaining) < len(section.items)
            name = f"more-{section.id}" if is_parted else section.id
            yield Section(name, section.title, remaining, section.tables, section.has_cells)
