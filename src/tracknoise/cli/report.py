"""``tracknoise report``: write the report of a run."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.terminal import DebugOption, QuietOption, Terminal

if TYPE_CHECKING:
    from tracknoise.tables.store import RunFolder


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("report", no_args_is_help=True)(report)


def report(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(help="Folder of a run.")],
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Write the report of a run: one HTML page, its figures as SVG, PNG and PDF, its tables as CSV and LaTeX.

    Example: `tracknoise report runs/7scenes`
    """
    from tracknoise.cli.summary import summary_text
    from tracknoise.tables.store import RunFolder

    folder = RunFolder(run)
    context.obj.result(summary_text(folder))
    context.obj.result(f"report: {write(context.obj, folder)}")
    return 0


def write(terminal: Terminal, run: "RunFolder") -> Path:
    """Write the report and return the path of its page."""
    from tracknoise.report.page import write_report

    terminal.say("writing the report")
    return write_report(run).resolve()
