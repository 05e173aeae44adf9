"""The subcommands of ``tracknoise``."""

from importlib import import_module
from typing import Annotated

import typer

from tracknoise import __version__
from tracknoise.cli.terminal import write_result

_COMMANDS = (
    "demo",
    "tournament",
    "check",
    "init",
    "run",
    "replicate",
    "report",
    "findings",
    "compare",
    "audit",
    "noise",
    "prove",
    "simulate",
    "effects",
    "datasets",
    "trackers",
    "selfcheck",
)
"""Modules of this package, in the order of the help. Each has a function `register`."""

app = typer.Typer(
    name="tracknoise",
    help="Measure the errors of feature tracks: bias, covariance, drift, outlier ratio and lifetime.",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)
for command in _COMMANDS:
    import_module(f"tracknoise.cli.{command}").register(app)


def _print_version(asked: bool) -> None:
    if asked:
        write_result(f"tracknoise {__version__}\n")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Measure the errors of feature tracks: bias, covariance, drift, outlier ratio and lifetime."""
