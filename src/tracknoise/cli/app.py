"""The ``tracknoise`` command: its subcommands, and how errors leave it.

Exit status: 0 done, 1 the user's error, 2 some scenes failed. Results go to stdout, everything else to stderr.
"""

import io
import sys
from typing import Annotated

import typer

from tracknoise import __version__
from tracknoise.cli import datasets, demo, findings, replicate, report, run, selfcheck, simulate, trackers
from tracknoise.cli.terminal import Terminal
from tracknoise.exceptions import TracknoiseError

_INTERRUPTED = 130

app = typer.Typer(
    name="tracknoise",
    help="Measure how wrong feature tracks are: bias, covariance, drift, outlier ratio and lifetime.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)
for command in (demo, run, replicate, report, findings, simulate, datasets, trackers, selfcheck):
    command.register(app)


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
    """Measure how wrong feature tracks are: bias, covariance, drift, outlier ratio and lifetime."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its status.

    Parameters
    ----------
    arguments
        Without the program's name; by default those of the process.
    """
    terminal = Terminal()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that lacks a sign shall not lose the rest
    try:
        status = typer.main.get_command(app).main(
            args=arguments, prog_name="tracknoise", standalone_mode=False, obj=terminal
        )
    except typer.TyperException as error:
        if message := error.format_message():  # none where the help was printed in place of it
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
        terminal.error(f"internal error ({type(error).__name__}: {error}); --debug shows where")
        status = 1
    if status == _INTERRUPTED:
        terminal.error("interrupted; a run goes on where it stopped when it is started again")
    sys.exit(status)
