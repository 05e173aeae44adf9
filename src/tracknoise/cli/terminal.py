"""Output of the command line: results on stdout; messages and progress on stderr.

- Output of the command line: results on stdout; messages and progress on stderr. Control characters are escaped.
- Format a registry as text: one name and its description per line.
"""

import os
import sys
import textwrap
from collections.abc import Mapping

from tracknoise.exceptions import TracknoiseError
from tracknoise.processes import error_of_stdout
from tracknoise.text import printable

_LAYOUT = "\n\t"
WIDTH = 110
"""Characters of a line of prose, at most."""


def write_result(text: str) -> None:
    """Write a text to stdout as it is."""
    sys.stdout.write(text)


def finish_results() -> None:
    """Write what is still in memory to stdout."""
    error = error_of_stdout()
    if error is not None:
        raise TracknoiseError(f"standard output cannot be written ({error.strerror})") from error


class Terminal:
    """The output of one invocation.

    Attributes
    ----------
    debug
        Show tracebacks.
    quiet
        Print nothing on stderr but errors and warnings.
    to_resume
        How a command that was interrupted is resumed; empty where it would start over.
    """

    def __init__(self) -> None:
        self.debug = False
        self.quiet = False
        self.to_resume = ""

    def resumes(self, *, fresh: bool) -> None:
        """Say that the command resumes what it began. `fresh`: with --fresh, which would delete that."""
        self.to_resume = f"run the same command again{' without --fresh' if fresh else ''} to resume"

    def result(self, text: str, *, coloured: str = "", colour: str = "") -> None:
        """Print a result. In a terminal, the first `coloured` in it has a colour, unless NO_COLOR is set."""
        shown = printable(text, keep=_LAYOUT)
        if colour and sys.stdout.isatty() and not os.environ.get("NO_COLOR"):
            from rich.console import Console
            from rich.text import Text

            before, middle, after = shown.partition(coloured)
            Console(highlight=False).print(Text.assemble(before, (middle, colour), after), soft_wrap=True)
        else:
            write_result(f"{shown}\n")

    def say(self, text: str) -> None:
        """Print a message, unless quiet."""
        if not self.quiet:
            self._line(text)

    def warn(self, text: str) -> None:
        """Print a warning."""
        self._line(f"tracknoise: warning: {text}")

    def error(self, text: str) -> None:
        """Print an error as one line."""
        self._line(f"tracknoise: error: {' '.join(text.split())}")

    def _line(self, text: str) -> None:
        sys.stderr.write(f"{printable(text, keep=_LAYOUT)}\n")
        sys.stderr.flush()


def wrapped(text: str) -> list[str]:
    """A text as lines of at most `WIDTH` columns; names are not broken."""
    return textwrap.wrap(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def listing(descriptions: Mapping[str, str]) -> str:
    """Names and descriptions in two aligned columns, sorted by name."""
    width = max(map(len, descriptions), default=0)
    return "\n".join(f"{name.ljust(width)}  {text}" for name, text in sorted(descriptions.items()))
