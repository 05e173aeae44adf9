"""The subcommands of ``tracknoise``."""

from collections.abc import Mapping
from importlib import import_module
from typing import Annotated, Any

import typer

from tracknoise import __version__
from tracknoise.cli.shared_options import JsonCommand
from tracknoise.cli.terminal import write_result

_ASKS_FOR_MORE: Mapping[str, Any] = {"no_args_is_help": True}
_PRINTS_JSON: Mapping[str, Any] = {"no_args_is_help": True, "cls": JsonCommand}
_COMMANDS: Mapping[str, Mapping[str, Any]] = {
    "demo": {},
    "tournament": {},
    "check": _PRINTS_JSON,
    "init": _ASKS_FOR_MORE,
    "run": _ASKS_FOR_MORE,
    "replicate": {},
    "report": _ASKS_FOR_MORE,
    "findings": _PRINTS_JSON,
    "compare": _PRINTS_JSON,
    "audit": _PRINTS_JSON,
    "noise": {},
    "prove": _ASKS_FOR_MORE,
    "simulate": _ASKS_FOR_MORE,
    "effects": {},
    "datasets": {},
    "trackers": {},
    "selfcheck": {},
}
"""Settings of each command, in the order of the help. It is what has its name in the module of the same name."""

app = typer.Typer(
    name="tracknoise",
    help="Measure the errors of feature tracks: bias, covariance, drift, outlier ratio and lifetime.",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)
for name, settings in _COMMANDS.items():
    command = getattr(import_module(f"tracknoise.cli.{name}"), name)
    if isinstance(command, typer.Typer):
        app.add_typer(command, name=name)
    else:
        app.command(name, **settings)(command)


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
