"""The report: one page that needs no network, its figures and its tables, written into the run folder."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tracknoise.atomic import replaced_folder
from tracknoise.exceptions import StoreError, UnknownNameError
from tracknoise.report import (
    export,
    factor_effects,
    findings_section,
    measured,
    table_files,
    trimmed,
    truth_section,
)
from tracknoise.report.cells import Cells
from tracknoise.report.contents import CONTENTS, Section, contents_json
from tracknoise.report.figures.families import FAMILIES
from tracknoise.report.figures.figure import Absence, Figure, require_distinct
from tracknoise.report.report_data import ReportData
from tracknoise.report.templates import template
from tracknoise.tables.store import RunFolder


def write_report(run: RunFolder, *, figure_formats: Sequence[str] = export.FORMATS) -> Path:
    """Write the folder ``report/`` of a run. An earlier report is replaced when the new one is complete.

    The folder has ``index.html``, ``contents.json`` (see `tracknoise.report.contents`), ``figures/`` and ``tables/``.

    Parameters
    ----------
    run
        A run with statistics.
    figure_formats
        Kinds of figure files: any of ``svg``, ``png``, ``pdf``.

    Returns
    -------
    Path
        Of the page.

    Raises
    ------
    StoreError, SchemaError
        If there is no run, one of its files is missing or damaged, or the folder cannot be written.
    UnknownNameError
        If there is no such format.
    """
    for name in figure_formats:
        if name not in export.FORMATS:
            raise UnknownNameError("figure format", name, export.FORMATS)
    files = _files(ReportData.of(run), tuple(figure_formats))
    return _replace(run.path / "report", files) / "index.html"


def _files(data: ReportData, formats: tuple[str, ...]) -> dict[str, bytes]:
    """Content of every file of the report, by its path within it."""
    drawn = [(family, family.figures(data), family.tables(data)) for family in FAMILIES]
    shown = [section for section in drawn if section[1]]
    require_distinct(item for _, items, _ in shown for item in items)
    contents = _contents(data, [Section(family.id, family.title, items) for family, items, _ in shown])
    figures = [item for _, items, _ in shown for item in items if isinstance(item, Figure)]
    specs = {figure.id: export.specification(figure) for figure in figures}
    files = _figure_files(specs, formats) | _table_files(data)
    files[CONTENTS] = contents_json(data.name, contents, formats).encode()
    files["index.html"] = _page(data, contents, shown, specs, formats).encode()
    return files


def _contents(data: ReportData, families: Sequence[Section]) -> list[Section]:
    """All sections of the page, in order."""
    exported = [(item.id, item.title) for item in table_files.EXPORTS]
    return [
        Section("findings", "Findings"),
        Section("truth", truth_section.TITLE),
        Section("measured", "Measurement"),
        Section("summary", "Summary", tables=exported),
        Section("factor-effects", factor_effects.heading(data)),
        *families,
        Section("limits", "Reading guide and limits"),
    ]


def _figure_files(specs: Mapping[str, Any], formats: tuple[str, ...]) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    for name, spec in specs.items():
        files |= {f"figures/{name}.{kind}": content for kind, content in export.render(spec, formats).items()}
    return files


def _table_files(data: ReportData) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    for item in table_files.EXPORTS:
        table = item.make(data)
        files[f"tables/{item.id}.csv"] = table_files.to_csv(table).encode()
        files[f"tables/{item.id}.tex"] = table_files.to_latex(table).encode()
    return files


def _page(
    data: ReportData,
    contents: Sequence[Section],
    shown: Sequence[tuple[object, Sequence[Figure | Absence], Sequence[Cells]]],
    specs: Mapping[str, Any],
    formats: tuple[str, ...],
) -> str:
    return template("index.html.j2").render(
        data=data,
        contents=contents,
        titles={section.id: section.title for section in contents},
        measured=measured,
        factor_effects=factor_effects,
        findings_section=findings_section,
        trimmed=trimmed,
        truth_section=truth_section,
        summary=measured.summary(data),
        exports=table_files.EXPORTS,
        sections=shown,
        specs={name: _embedded(spec) for name, spec in specs.items()},
        formats=formats,
        vega=export.scripts(),
    )


def _embedded(spec: Mapping[str, Any]) -> str:
    """JSON that cannot end the script element that contains it."""
    return json.dumps(spec, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c")


def _replace(folder: Path, files: Mapping[str, bytes]) -> Path:
    """Write files into a new folder, which replaces the old one when it is whole."""
    try:
        with replaced_folder(folder) as building:
            for name, content in files.items():
                path = building / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written ({error.strerror}), expected a writable folder") from error
    return folder
