"""The report: one page that needs no network, its figures and its tables, written into the run folder."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from tracknoise.atomic import replaced_folder
from tracknoise.exceptions import StoreError, UnknownNameError
from tracknoise.report import export, found, matters, measured, tables, trimmed
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures import FAMILIES, Figure
from tracknoise.tables.store import RunFolder

_ANCHORS = ["measured", "matters", "limits"]
"""Sections besides those of figures that sentences may lead to."""


def write_report(run: RunFolder, *, figure_formats: Sequence[str] = export.FORMATS) -> Path:
    """Write ``report/`` of a run: ``index.html``, ``figures/`` and ``tables/``; it replaces an earlier one when whole.

    Parameters
    ----------
    run
        A run whose statistics were computed.
    figure_formats
        What figures are written as beside the page: any of ``svg``, ``png``, ``pdf``.

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
    files = _files(Evidence.of(run), tuple(figure_formats))
    return _replace(run.path / "report", files) / "index.html"


def _files(evidence: Evidence, formats: tuple[str, ...]) -> dict[str, bytes]:
    """Content of every file of the report, by its path within it."""
    sections = [(family, family.figures(evidence), family.tables(evidence)) for family in FAMILIES]
    specs = {
        figure.id: export.specification(figure)
        for _, figures, _ in sections
        for figure in figures
        if isinstance(figure, Figure)
    }
    files: dict[str, bytes] = {}
    for name, spec in specs.items():
        files |= {f"figures/{name}.{kind}": content for kind, content in export.render(spec, formats).items()}
    for item in tables.EXPORTS:
        table = item.make(evidence)
        files[f"tables/{item.id}.csv"] = tables.to_csv(table).encode()
        files[f"tables/{item.id}.tex"] = tables.to_latex(table).encode()
    files["index.html"] = _page(evidence, sections, specs, formats).encode()
    return files


def _page(evidence: Evidence, sections: Sequence[Any], specs: Mapping[str, Any], formats: tuple[str, ...]) -> str:
    return template("index.html.j2").render(
        evidence=evidence,
        measured=measured,
        matters=matters,
        found=found,
        anchors=[family.id for family, figures, _ in sections if figures] + _ANCHORS,
        trimmed=trimmed,
        summary=measured.summary(evidence),
        exports=tables.EXPORTS,
        sections=[section for section in sections if section[1]],
        specs={name: _embedded(spec) for name, spec in specs.items()},
        formats=formats,
        vega=export.scripts(),
    )


def template(name: str) -> Template:
    """A template of the package, which finds the report's style as `css` and its script as `script`."""
    loader = PackageLoader("tracknoise.report", "template")
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.tests["figure"] = lambda item: isinstance(item, Figure)
    raw = {"css": "page.css", "script": "page.js"}
    environment.globals |= {key: loader.get_source(environment, file)[0] for key, file in raw.items()}
    return environment.get_template(name)


def _embedded(spec: Mapping[str, Any]) -> str:
    """JSON that cannot end the script element it stands in."""
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
