"""``tracknoise findings``: the findings of a run as sentences and verdicts, or as JSON."""

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.shared_options import DebugOption, JsonFileOption, JsonOption, QuietOption, write_json
from tracknoise.cli.terminal import WIDTH, Terminal

if TYPE_CHECKING:
    from tracknoise.report.report_data import ReportData

_MOST = 10
"""Sentences that are printed unless all are asked for."""


def findings(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    every: Annotated[bool, typer.Option("--all", help="Print all findings with all their numbers.")] = False,
    table: Annotated[bool, typer.Option("--table", help="Print the tables of verdicts too.")] = False,
    as_json: JsonOption = False,
    json_file: JsonFileOption = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Print at most ten sentences about a run: what to set, which tracker is better, and what was shown.

    Examples: `tracknoise findings runs/7scenes`, `tracknoise findings runs/7scenes --all --table`
    """
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.exceptions import StoreError
    from tracknoise.report.report_data import ReportData
    from tracknoise.tables.store import RunFolder
    from tracknoise.topics.headlines import findings_json
    from tracknoise.words import count

    require_outputs([("--json-file", json_file)], inputs=[run])
    data = ReportData.of(RunFolder(run))
    if data["findings"].is_empty():
        raise StoreError(f"{run}: holds no findings, expected those of a finished run; `tracknoise run` computes them")
    if failed := data.manifest.failures:
        are = "is" if len(failed) == 1 else "are"
        context.obj.warn(f"{run}: {count(len(failed), 'sequence')} failed and {are} not in these findings")
    tables = data.tables
    write_json(context.obj, findings_json(tables), as_json=as_json, file=json_file)
    if not as_json:
        _print_sentences(context.obj, data, every=every)
    if table and not as_json:
        _print_tables(context.obj, data)
    return 0


def _print_sentences(terminal: Terminal, data: "ReportData", *, every: bool) -> None:
    from tracknoise.cli.run_answer import most_important
    from tracknoise.report import findings_section

    whole = [row["text"] for row in findings_section.sentences(data)]
    for rank, text in enumerate(whole if every else most_important(data, _MOST), start=1):
        marker = f"{rank:>2}. "
        terminal.result(textwrap.fill(text, WIDTH, initial_indent=marker, subsequent_indent=" " * len(marker)))
    if not every:
        terminal.result(f"All {len(whole)} findings: --all; verdicts with their intervals: --table")


def _print_tables(terminal: Terminal, data: "ReportData") -> None:
    from tracknoise.cli.text_table import show
    from tracknoise.report import factor_section, findings_section

    effects, intervals = factor_section.verdicts(data), factor_section.intervals(data)
    asked = [effects] if len(effects.headings) > 1 else []
    for cells in [findings_section.verdicts(data), *asked, *([intervals] if intervals else [])]:
        terminal.result("")
        show(terminal.result, cells)
