"""The parts of a report: its sections, figures and tables in their order, for the page and for programs.

- ``contents.json``: the sections, figures and tables of a report, for programs and for other pages.
- The parts of the page in their order: the answer first, then its evidence, and how it was measured last.
"""

import json
from collections.abc import Mapping, Sequence
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
    """

    id: str
    title: str
    items: Sequence[Figure | Absence] = ()
    tables: Sequence[tuple[str, str, Sequence[str]]] = ()


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
class Part:
    """A part of the page.

    Attributes
    ----------
    title
        Its heading in the table of contents.
    sections
        In the order of the page.
    """

    title: str
    sections: Sequence[Section]


PARTS: Mapping[str, tuple[str, ...]] = {
    "Answer": ("findings", "estimator"),
    "Evidence": (
        *(
            "explorer",
            "error-by-tracker",
            "lifetimes",
            "outlier-ratio",
            "gaussianity",
            "time-structure",
            "changes",
            "trimming",
        ),
        *("feature-counts", "survivorship-bias", "summary"),
    ),
    "Factors": (
        *("factor-effects", "error-by-speed", "error-by-lighting", "error-by-rotation", "error-by-direction"),
        *("error-by-place", "along-and-across", "occlusion"),
    ),
    "Truth": ("truth", "truth-audit", "pose-errors", "between-trackers"),
    "Scenes": ("example-frames", "trajectory"),
    "Method": ("limits", "measured"),
}
"""Sections of every part, by title."""


def parts(sections: Mapping[str, Section]) -> list[Part]:
    """The parts that have sections."""
    made = (Part(title, [sections[name] for name in names if name in sections]) for title, names in PARTS.items())
    return [part for part in made if part.sections]
