"""The report: one page that needs no network, its figures and its tables, written into the run folder."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tracknoise.atomic import replaced_folder
from tracknoise.estimators.exports import asked
from tracknoise.estimators.run_models import RunModels, run_models
from tracknoise.exceptions import StoreError, UnknownNameError
from tracknoise.report import (
    answer_plot,
    estimator_exports,
    explorer,
    factor_section,
    figure_files,
    filmed_scene,
    findings_section,
    looks,
    measured,
    share_picture,
    small_plots,
    table_files,
    truth_section,
)
from tracknoise.report.annotated_frame import annotated_frame
from tracknoise.report.answer import conclusions, summarise
from tracknoise.report.cells import Cells
from tracknoise.report.contents import CONTENTS, TRUTH_TITLE, Layout, Section, accuracy_title, contents_json, layout
from tracknoise.report.figures.families import FAMILIES
from tracknoise.report.figures.figure import Figure, require_distinct
from tracknoise.report.glossary import TERMS
from tracknoise.report.leaderboard import UNKNOWN, Leaderboard, leaderboard
from tracknoise.report.report_data import ReportData
from tracknoise.report.settings_picker import Picker
from tracknoise.report.style import PALETTE
from tracknoise.report.templates import template
from tracknoise.report.worst_track import Strip, worst_track
from tracknoise.tables.store import RunFolder
from tracknoise.text import browser_json
from tracknoise.topics import trimming_topic
from tracknoise.topics.answer_summary import SUMMARY, NoiseToSet, Summary, summary_json
from tracknoise.words import intervals_at


def write_report(run: RunFolder, *, figure_formats: Sequence[str] = ()) -> Path:
    """Write the folder ``report/`` of a run. An earlier report is replaced when the new one is complete.

    The folder has ``index.html``, ``summary.json`` (see `tracknoise.topics.answer_summary`), ``contents.json`` (see
    `tracknoise.report.contents`) and ``tables/``; ``share.png`` where the run has a noise model; and ``figures/`` if
    figure files are asked for.

    Parameters
    ----------
    run
        A run with statistics.
    figure_formats
        Kinds of figure files: any of ``svg``, ``png``. The page draws its figures itself and saves each on demand.

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
        if name not in figure_files.FORMATS:
            raise UnknownNameError("figure format", name, figure_files.FORMATS)
    data = ReportData.of(run)
    with ThreadPoolExecutor(1) as beside:  # the converter bundles the scripts without holding back this thread
        files = _files(data, tuple(figure_formats), beside.submit(figure_files.scripts))
    return _replace(run.path / "report", files) / "index.html"


def _files(data: ReportData, formats: tuple[str, ...], scripts: Future[str]) -> dict[str, bytes]:
    """Content of every file of the report, by its path within it."""
    below = {family.id: family.tables(data) for family in FAMILIES}
    sections = [
        Section(family.id, family.title, items, has_cells=bool(below[family.id]))
        for family in FAMILIES
        if (items := family.figures(data))
    ]
    require_distinct(item for section in sections for item in section.items)
    figures = [item for section in sections for item in section.items if isinstance(item, Figure)]
    specs = {figure.id: figure_files.specification(figure) for figure in figures}
    frames = filmed_scene.filmed_scene(data)
    answered, fits, seen = summarise(data), run_models(data.run), looks.looks(data)
    parts = [*_before(), *sections, *_after(data)]
    arranged = layout(parts, filmed=frames is not None, compared=len(answered.cards) > 1)
    board = leaderboard(data)
    leader = None if board is None else board.first_with(answered.settings)
    shown = answer_plot.answer_plot(fits.models, data.estimator, answered.settings, leader)
    strip = None if shown is None else worst_track(seen, shown.curves[0].tracker)
    files = _figure_files(specs, formats) | _table_files(data)
    shared = share_picture.png(answered, shown, strip, board)
    files |= {} if shared is None else {share_picture.FILE: shared}
    files[CONTENTS] = contents_json(data.name, arranged.every, formats).encode()
    files[SUMMARY] = summary_json(answered).encode()
    family_of = {item.id: section.id for section in sections for item in section.items}
    page = _page(data, answered, fits, arranged, family_of, below, specs, seen, shown, strip, board, frames, scripts)
    files["index.html"] = page.encode()
    return files


def _before() -> list[Section]:
    """Sections that stand before the figures."""
    return [Section("explorer", "Explorer"), Section("truth", truth_section.TITLE), Section("findings", "Findings")]


def _after(data: ReportData) -> list[Section]:
    """Sections that stand after them."""
    exported = [(item.id, item.title, item.kinds) for item in table_files.EXPORTS]
    return [
        Section("factor-effects", factor_section.heading(data)),
        Section("summary", "Summary", tables=exported),
        Section("measured", "Measurement"),
        Section("limits", "Reading guide and limits"),
    ]


def _figure_files(specs: Mapping[str, Any], formats: tuple[str, ...]) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    for name, spec in specs.items():
        files |= {f"figures/{name}.{kind}": content for kind, content in figure_files.render(spec, formats).items()}
    return files


def _table_files(data: ReportData) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    for item in table_files.EXPORTS:
        table = item.make(data)
        files[f"tables/{item.id}.csv"] = table_files.to_csv(table).encode()
        if "tex" in item.kinds:
            files[f"tables/{item.id}.tex"] = table_files.to_latex(table).encode()
    return files


def _page(
    data: ReportData,
    answered: Summary,
    fits: RunModels,
    arranged: Layout,
    family_of: Mapping[str, str],
    below: Mapping[str, Sequence[Cells]],
    specs: Mapping[str, Any],
    seen: Mapping[str, Any],
    shown: answer_plot.AnswerPlot | None,
    strip: Strip | None,
    board: Leaderboard | None,
    frames: Mapping[str, Any] | None,
    scripts: Future[str],
) -> str:
    families = {family.id: family for family in FAMILIES}
    return template("index.html.j2").render(
        data=data,
        summary=answered,
        verdict=data.truth,
        scales=small_plots.scales(answered.cards),
        interval_plot=small_plots,
        picture=shown,
        strip=strip,
        board=board,
        palette=len(PALETTE),
        unknown=UNKNOWN,
        intervals=_intervals(data),
        glossary=dict(TERMS),
        frame=annotated_frame(data) if shown is None else None,
        layout=arranged,
        accuracy_title=accuracy_title(compared=len(answered.cards) > 1),
        truth_title=TRUTH_TITLE,
        family_of=family_of,
        anchors=_anchors(arranged, family_of),
        families=families,
        conclusions=conclusions(answered),
        below=below,
        heights={name: figure_files.height_px(spec) for name, spec in specs.items()},
        measured=measured,
        factor_effects=factor_section,
        findings_section=findings_section,
        trimmed=trimming_topic,
        truth_section=truth_section,
        exports=table_files.EXPORTS,
        noise_exports=estimator_exports.exports(
            missing=fits.missing,
            paths=fits.paths,
            picker=Picker(
                models=fits.models,
                colours=data.colour,
                are_bounds=not data.truth.is_usable,
                first=data.estimator,
                target=asked(data.settings, data.estimator),
                board=board,
            ),
        ),
        specs={name: _embedded(figure_files.themed(spec)) for name, spec in specs.items()},
        shown_settings=_shown_settings(answered),
        explored=_embedded(explorer.explored(data)),
        has_looks=bool(seen["groups"]),
        looked=_embedded(seen),
        filmed=frames,
        filmed_json=_embedded(frames or {}),
        vega=scripts.result(),
    )


def _intervals(data: ReportData) -> str:
    """What intervals of sigma are; empty where there are none."""
    levels = data["advice"]["level"].drop_nulls()
    return "" if levels.is_empty() or not data.truth.is_usable else f"{intervals_at(levels[0])}."


def _shown_settings(answered: Summary) -> Sequence[NoiseToSet]:
    """What to set for the trackers of the first screen: all in their order, or those with the smallest sigma."""
    if len(answered.settings) <= answer_plot.MOST_TRACKERS:
        return answered.settings
    return sorted(answered.settings, key=lambda setting: setting.sigma.value or 0.0)[: answer_plot.MOST_TRACKERS]


def _anchors(arranged: Layout, family_of: Mapping[str, str]) -> set[str]:
    """Ids of the page that evidence can be in."""
    opened = {family_of[item.id] for section in arranged.open for item in section.items}
    return {section.id for section in arranged.every} | opened


def _embedded(spec: Mapping[str, Any]) -> str:
    """JSON that cannot end the script element that contains it."""
    return browser_json(spec).replace("<", "\\u003c")


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
