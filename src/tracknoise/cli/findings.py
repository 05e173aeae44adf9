"""``tracknoise findings``: the findings of a run as sentences and verdicts, or as JSON."""

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.shared_options import DebugOption, JsonCommand, JsonFileOption, JsonOption, QuietOption, write_json

if TYPE_CHECKING:
    from tracknoise.cli.terminal import Terminal
    from tracknoise.report.report_data import ReportData

_WIDTH = 110


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("findings", cls=JsonCommand, no_args_is_help=True)(findings)


def findings(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    as_json: JsonOption = False,
    json_file: JsonFileOption = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Print the findings of a run: sentences with numbers, then verdicts with intervals.

    Example: `tracknoise findings runs/7scenes --json`
    """
    from tracknoise.exceptions import StoreError
    from tracknoise.phrases.headlines import findings_json
    from tracknoise.report.report_data import ReportData
    from tracknoise.tables.store import FINDINGS_TABLES, RunFolder
    from tracknoise.words import count

    data = ReportData.of(RunFolder(run))
    if data.findings.is_empty():
        raise StoreError(f"{run}: holds no findings, expected those of a finished run; `tracknoise run` computes them")
    if failed := data.manifest.failures:
        are = "is" if len(failed) == 1 else "are"
        context.obj.warn(f"{run}: {count(len(failed), 'sequence')} failed and {are} not in these findings")
    tables = {name: getattr(data, name) for name in FINDINGS_TABLES}
    write_json(context.obj, findings_json(tables), as_json=as_json, file=json_file)
    if not as_json:
        _print(context.obj, data)
    return 0


def _print(terminal: "Terminal", data: "ReportData") -> None:
    from tracknoise.cli.text_table import show
    from tracknoise.report import factor_section, findings_section

    for row in findings_section.sentences(data):
        marker = f"{row['rank']:>2}. "
        terminal.result(textwrap.fill(row["text"], _WIDTH, initial_indent=marker, subsequent_indent=" " * len(marker)))
    effects, intervals = factor_section.verdicts(data), factor_section.intervals(data)
    asked = [effects] if len(effects.headings) > 1 else []
    for cells in [findings_section.verdicts(data), *asked, *([intervals] if intervals else [])]:
        terminal.result("")
        show(terminal.result, cells)
