"""The paper's figures under every reading of its trimming, side by side on one page."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tracknoise.report import export
from tracknoise.report.figures.families import FAMILIES
from tracknoise.report.figures.figure import Figure
from tracknoise.report.report_data import ReportData
from tracknoise.report.templates import template
from tracknoise.tables.enumerations import Reading
from tracknoise.tables.files import write_atomically

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
    """One figure under every reading.

    Attributes
    ----------
    title
        Its heading.
    files
        Path of the image within the folder of the page, by reading; without those that cannot be drawn.
    """

    title: str
    files: Mapping[Reading, str]


def write_figures(
    folder: Path, runs: Mapping[str, Mapping[Reading, ReportData]], titles: Mapping[Reading, str]
) -> Path:
    """Draw the figures and write the page ``figures.html``.

    Parameters
    ----------
    folder
        Of the page. The images are written into its folder ``figures``.
    runs
        By title of the experiment and by reading.
    titles
        Of the readings.

    Raises
    ------
    StoreError
        If the folder cannot be written.
    """
    chapters = {title: _drawn(folder, f"figures/{number}", data) for number, (title, data) in enumerate(runs.items())}
    page = template("side_by_side.html.j2").render(chapters=chapters, titles=titles)
    write_atomically(folder / PAGE, page.encode())
    return folder / PAGE


def _drawn(folder: Path, place: str, runs: Mapping[Reading, ReportData]) -> list[Beside]:
    found: dict[str, dict[Reading, str]] = {}
    titles: dict[str, str] = {}
    for reading, data in runs.items():
        for figure in _figures(data):
            file = f"{place}/{figure.id}-{reading}.svg"
            write_atomically(folder / file, export.render(export.specification(figure), ("svg",))["svg"])
            found.setdefault(figure.id, {})[reading] = file
            titles[figure.id] = figure.title.removesuffix(_TRIMMING_IN_TITLE[reading])
    return [Beside(titles[name], files) for name, files in found.items()]


def _figures(data: ReportData) -> list[Figure]:
    made = [item for family in FAMILIES if family.id in _FAMILIES for item in family.figures(data)]
    return [item for item in made if isinstance(item, Figure) and not item.id.endswith(_OTHER_TRIMMING)]
