"""``tracknoise compare``: what changed between runs on the same scenes, and whether it passes a gate."""

import textwrap
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.shared_options import (
    DebugOption,
    JsonOption,
    QuietOption,
    files_by_ending,
    print_json,
    text,
    write_files,
)
from tracknoise.cli.terminal import WIDTH, Terminal

if TYPE_CHECKING:
    from tracknoise.analysis.comparison import Comparison

STATUS = {"pass": 0, "worse": 3, "undecided": 4}
"""Exit status of each outcome of a gate."""


def compare(
    context: typer.Context,
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", help="Run folders. All others are compared with the first.")
    ],
    trackers: Annotated[
        tuple[str, str] | None,
        text("--trackers", metavar="FIRST OTHER", help="A tracker of the first run, and one of the others."),
    ] = None,
    gate: Annotated[
        Path | None, text("--gate", metavar="FILE", help="TOML file of tolerances. It decides the exit status.")
    ] = None,
    out: Annotated[
        list[Path] | None,
        text("--out", "-o", metavar="FILE", help="Page (.html), JSON (.json) or Markdown (.md); repeatable."),
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Compare runs on the same scenes, paired by scene: which is better for what, or what is undecided.

    Refuses runs on other data, with other truth or other libraries. Verdicts need six scenes. With --gate, the exit
    status is 0 if it passes, 3 if something is worse than its tolerance, and 4 if it is undecided.

    Examples: `tracknoise compare runs/before runs/after --gate gate.toml`,
    `tracknoise compare runs/a runs/b --trackers lucas-kanade mine -o compare.html`
    """
    from tracknoise.analysis.comparison import comparison_json
    from tracknoise.analysis.gate import read_gate
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.experiments.compare_runs import compare as compare_runs
    from tracknoise.report.comparison_page import comparison_markdown, comparison_page
    from tracknoise.topics.catalogue import ESTIMANDS

    makers = {".html": comparison_page, ".json": comparison_json, ".md": comparison_markdown}
    files = files_by_ending(out, makers)
    require_outputs([("--out", path) for path in files.values()], inputs=[*runs, gate], are_reports=True)
    tolerances = None if gate is None else read_gate(gate, ESTIMANDS)
    comparison = compare_runs(*runs, trackers=trackers, gate=tolerances)
    _print_notes(context.obj, comparison)
    if as_json:
        print_json(context.obj, comparison_json(comparison))
    else:
        _print(context.obj, comparison)
    write_files(
        {path: partial(makers[ending], comparison) for ending, path in files.items()},
        context.obj.say if as_json else context.obj.result,
    )
    return 0 if comparison.gate is None else STATUS[comparison.gate.outcome]


def _print_notes(terminal: Terminal, comparison: "Comparison") -> None:
    for doubt in comparison.doubts:
        terminal.warn(doubt)
    for side in comparison.others:
        for note in side.notes:
            terminal.warn(f"{side.name}: {note}")


def _print(terminal: Terminal, comparison: "Comparison") -> None:
    from tracknoise.cli.text_table import show
    from tracknoise.report.comparison_page import change_sentences, gate_cells, gate_sentences, verdict_cells

    def print_lines(sentences: Sequence[str]) -> None:
        for sentence in sentences:
            terminal.result(textwrap.fill(sentence, WIDTH, subsequent_indent="  "))
        if sentences:
            terminal.result("")

    if comparison.gate is not None:
        terminal.result("\n".join([*gate_sentences(comparison.gate), ""]))
    print_lines(comparison.conclusions)
    if comparison.gate is not None:
        show(terminal.result, gate_cells(comparison.gate))
        terminal.result("")
    for side in comparison.others:
        print_lines(change_sentences(comparison, side))
        for cells in verdict_cells(comparison, side):
            show(terminal.result, cells)
            terminal.result("")
