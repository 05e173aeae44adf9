"""``tracknoise compare``: what changed between runs on the same scenes, and whether it passes a gate."""

import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.shared_options import DebugOption, JsonFileOption, JsonOption, QuietOption, write_json
from tracknoise.cli.terminal import WIDTH, Terminal
from tracknoise.inference.conventions import LEVEL
from tracknoise.tables.defaults import MARGIN
from tracknoise.tables.enumerations import ComparedAges

if TYPE_CHECKING:
    from tracknoise.analysis.run_changes import Comparison

STATUS = {"pass": 0, "worse": 3, "undecided": 4}
"""Exit status of each outcome of a gate."""


def compare(
    context: typer.Context,
    runs: Annotated[list[Path], typer.Argument(help="Run folders. All others are compared with the first.")],
    trackers: Annotated[
        tuple[str, str] | None,
        typer.Option("--trackers", help="A tracker of the first run, and one of the others to compare it with."),
    ] = None,
    gate: Annotated[
        Path | None, typer.Option("--gate", help="TOML file of tolerances. It decides the exit status.")
    ] = None,
    html: Annotated[Path | None, typer.Option("--html", help="Write a page to this file.")] = None,
    markdown: Annotated[
        Path | None, typer.Option("--markdown", help="Write Markdown for a pull request to this file.")
    ] = None,
    as_json: JsonOption = False,
    json_file: JsonFileOption = None,
    margin: Annotated[
        float, typer.Option("--margin", help="Largest relative change that counts as no difference.")
    ] = MARGIN,
    level: Annotated[float, typer.Option("--level", help="Level of intervals and verdicts.")] = LEVEL,
    ages: Annotated[
        ComparedAges,
        typer.Option(
            "--ages", help="Whether verdicts are about every age besides the mean over ages, or the mean alone."
        ),
    ] = ComparedAges.every,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Compare runs on the same scenes, paired by scene: worse, better, no difference or undecided.

    Refuses runs on other data, with other truth or other libraries. Verdicts need six scenes. With --gate, the exit
    status is 0 if it passes, 3 if something is worse than its tolerance, and 4 if it is undecided.

    Examples: `tracknoise compare runs/before runs/after --gate gate.toml`,
    `tracknoise compare runs/a runs/b --trackers lucas-kanade mine --html compare.html`
    """
    from tracknoise.analysis.gate import comparison_json
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.experiments.compare_runs import compare as compare_runs
    from tracknoise.experiments.compare_runs import read_gate

    outputs = [("--html", html), ("--markdown", markdown), ("--json-file", json_file)]
    require_outputs(outputs, inputs=[*runs, gate])
    tolerances = None if gate is None else read_gate(gate)
    found = compare_runs(*runs, trackers=trackers, gate=tolerances, margin=margin, level=level, ages=ages)
    _print_notes(context.obj, found)
    if not as_json:
        _print(context.obj, found)
    write_json(context.obj, comparison_json(found), as_json=as_json, file=json_file)
    for path in _written(found, html=html, markdown=markdown):
        (context.obj.say if as_json else context.obj.result)(f"written: {path.resolve()}")
    return 0 if found.gate is None else STATUS[found.gate.outcome]


def _written(found: "Comparison", *, html: Path | None, markdown: Path | None) -> Iterator[Path]:
    """Write the pages that are asked for."""
    from tracknoise.report.comparison_page import comparison_markdown, comparison_page
    from tracknoise.tables.files import write_atomically

    for path, make in ((html, comparison_page), (markdown, comparison_markdown)):
        if path is not None:
            write_atomically(path, make(found).encode())
            yield path


def _print_notes(terminal: Terminal, found: "Comparison") -> None:
    for doubt in found.doubts:
        terminal.warn(doubt)
    for side in found.others:
        for note in side.notes:
            terminal.warn(f"{side.name}: {note}")


def _print(terminal: Terminal, found: "Comparison") -> None:
    from tracknoise.cli.text_table import show
    from tracknoise.report.comparison_page import answers, by_run, clearest, gate_cells, gate_sentences, verdict_cells

    for side, rows in zip(found.others, by_run(found).values(), strict=True):
        for cells in verdict_cells(found, side.name, rows):
            show(terminal.result, cells)
            terminal.result("")
        for sentence in [*answers(rows), *clearest(rows)]:
            terminal.result(textwrap.fill(sentence, WIDTH, subsequent_indent="  "))
        terminal.result("")
    if found.gate is not None:
        show(terminal.result, gate_cells(found.gate))
        terminal.result("\n".join(["", *gate_sentences(found.gate)]))
