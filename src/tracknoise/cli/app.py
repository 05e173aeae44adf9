"""The ``tracknoise`` command: its subcommands, and how errors are printed.

Exit status: 0 success, 1 user error, 2 some scenes failed. Results go to stdout, everything else to stderr.
"""

import io
import sys
from importlib import import_module
from typing import Annotated

import typer

from tracknoise import __version__
from tracknoise.cli.terminal import Terminal
from tracknoise.exceptions import TracknoiseError

_COMMANDS = ("demo", "run", "replicate", "report", "findings", "simulate", "datasets", "trackers", "selfcheck")
"""Modules of this package, in the order of the help. Each has a function `register`."""
_INTERRUPTED = 130

app = typer.Typer(
    name="tracknoise",
    help="Measure the errors of feature tracks: bias, covariance, drift, outlier ratio and lifetime.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)
for command in _COMMANDS:
    import_module(f"tracknoise.cli.{command}").register(app)


def _print_version(asked: bool) -> None:
    if asked:
        sys.stdout.write(f"tracknoise {__version__}\n")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Measure the errors of feature tracks: bias, covariance, drift, outlier ratio and lifetime."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its status.

    Parameters
    ----------
    arguments
        Without the program's name. Default: the arguments of the process.
    """
    terminal = Terminal()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # one unprintable character must not hide the rest
    try:
        status = typer.main.get_command(app).main(
            args=arguments, prog_name="tracknoise", standalone_mode=False, obj=terminal
        )
    except typer.TyperException as error:
        if message := error.format_message():  # empty if the help was printed instead
            terminal.error(message)
        status = 1
    except (typer.Abort, KeyboardInterrupt):
        status = _INTERRUPTED
    except TracknoiseError as error:
        if terminal.debug:
            raise
        terminal.error(str(error))
        status = 1
    except Exception as error:
        if terminal.debug:
            raise
        terminal.error(f"internal error ({type(error).__name__}: {error}); use --debug for a traceback")
        status = 1
    if status == _INTERRUPTED:
        terminal.error("interrupted; run the same command again to resume")
    sys.exit(status)
