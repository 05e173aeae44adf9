"""The subcommands of ``tracknoise``."""

from collections.abc import Mapping
from importlib import import_module
from typing import Annotated, Any

import typer

from tracknoise import __version__
from tracknoise.cli.shared_options import Command, Commands
from tracknoise.cli.terminal import write_result

_ASKS_FOR_MORE: Mapping[str, Any] = {"no_args_is_help": True}
_COMMANDS: Mapping[str, Mapping[str, Any]] = {
    "demo": {},
    "init": _ASKS_FOR_MORE,
    "check": _ASKS_FOR_MORE,
    "run": _ASKS_FOR_MORE,
    "report": _ASKS_FOR_MORE,
    "compare": _ASKS_FOR_MORE,
    "export": {},
    "tournament": {},
    "trackers": {},
    "simulate": _ASKS_FOR_MORE,
    "replicate": {},
    "datasets": {},
}
"""Settings of each command, in the order of the help. It is what has its name in the module of the same name."""

app = typer.Typer(
    name="tracknoise",
    cls=Commands,
    help="Measure the errors of feature tracks: bias, covariance, drift, outlier ratio and lifetime.",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)
for name, settings in _COMMANDS.items():
    app.command(name, cls=Command, **settings)(getattr(import_module(f"tracknoise.cli.{name}"), name))


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
