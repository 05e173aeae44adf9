"""``tracknoise compare``: what changed between runs on the same scenes, and whether it passes a gate."""

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.options import DebugOption, QuietOption
from tracknoise.tables.defaults import LEVEL, MARGIN
from tracknoise.tables.enumerations import ComparedAges

if TYPE_CHECKING:
    from tracknoise.cli.terminal import Terminal
    from tracknoise.findings.comparison.result import Comparison

STATUS = {"pass": 0, "worse": 3, "undecided": 4}
"""Exit status of each outcome of a gate."""
_WIDTH = 110


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("compare", no_args_is_help=True)(compare)


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
    json: Annotated[Path | None, typer.Option("--json", help="Write the comparison as JSON to this file.")] = None,
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
    from tracknoise.experiments.comparing.compare_runs import compare as compare_runs
    from tracknoise.experiments.comparing.gate_file import read_gate

    tolerances = None if gate is None else read_gate(gate)
    found = compare_runs(*runs, trackers=trackers, gate=tolerances, margin=margin, level=level, ages=ages)
    _print(context.obj, found)
    _write(context.obj, found, html=html, markdown=markdown, json=json)
    return 0 if found.gate is None else STATUS[found.gate.outcome]


def _write(
    terminal: "Terminal", found: "Comparison", *, html: Path | None, markdown: Path | None, json: Path | None
) -> None:
    from tracknoise.findings.comparison.document import comparison_json
    from tracknoise.report.comparison.markdown import comparison_markdown
    from tracknoise.report.comparison.page import comparison_page
    from tracknoise.tables.files import write_atomically

    for path, make in ((html, comparison_page), (markdown, comparison_markdown), (json, comparison_json)):
        if path is not None:
            write_atomically(path, make(found).encode())
            terminal.result(f"written: {path.resolve()}")


def _print(terminal: "Terminal", found: "Comparison") -> None:
    from tracknoise.cli.text_table import show
    from tracknoise.report.comparison.tables import gate_cells, verdict_cells
    from tracknoise.report.comparison.words import answers, by_run, clearest, gate_sentences

    for side, rows in zip(found.others, by_run(found).values(), strict=True):
        for note in side.notes:
            terminal.warn(f"{side.name}: {note}")
        for cells in verdict_cells(found, side.name, rows):
            show(terminal.result, cells)
            terminal.result("")
        for sentence in [*answers(rows), *clearest(rows)]:
            terminal.result(textwrap.fill(sentence, _WIDTH, subsequent_indent="  "))
        terminal.result("")
    if found.gate is not None:
        show(terminal.result, gate_cells(found.gate))
        terminal.result("\n".join(["", *gate_sentences(found.gate)]))
