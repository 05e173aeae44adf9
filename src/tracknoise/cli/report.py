"""``tracknoise report``: write the report of a run."""

from pathlib import Path
from typing import Annotated

import typer

from tracknoise.cli.options import DebugOption, QuietOption


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("report", no_args_is_help=True)(report)


def report(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Write the report of a run: an HTML page, figures as SVG, PNG and PDF, tables as CSV and LaTeX.

    Example: `tracknoise report runs/7scenes`
    """
    from tracknoise.cli.summary import print_results
    from tracknoise.tables.store import RunFolder

    print_results(context.obj, RunFolder(run), report=True)
    return 0
