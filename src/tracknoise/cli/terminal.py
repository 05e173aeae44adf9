"""What the user sees: results on stdout; messages and progress on stderr."""

import sys
from typing import Annotated

import typer


class Terminal:
    """The user's side of one invocation.

    Attributes
    ----------
    debug
        Show tracebacks.
    quiet
        Say nothing on stderr but errors and warnings.
    """

    def __init__(self) -> None:
        self.debug = False
        self.quiet = False

    def result(self, text: str) -> None:
        """Print a result."""
        sys.stdout.write(f"{text}\n")

    def say(self, text: str) -> None:
        """Print a remark, unless quiet."""
        if not self.quiet:
            self._line(text)

    def warn(self, text: str) -> None:
        """Print a warning."""
        self._line(f"tracknoise: warning: {text}")

    def error(self, text: str) -> None:
        """Print an error as one line."""
        self._line(f"tracknoise: error: {' '.join(text.split())}")

    def _line(self, text: str) -> None:
        sys.stderr.write(f"{text}\n")
        sys.stderr.flush()


def _remember_debug(context: typer.Context, value: bool) -> bool:
    context.obj.debug = value
    return value


def _remember_quiet(context: typer.Context, value: bool) -> bool:
    context.obj.quiet = value
    return value


DebugOption = Annotated[
    bool, typer.Option("--debug", help="Show a traceback on errors.", callback=_remember_debug, is_eager=True)
]
QuietOption = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print results and errors only.", callback=_remember_quiet, is_eager=True)
]
