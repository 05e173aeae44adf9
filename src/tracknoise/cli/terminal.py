"""Output of the command line: results on stdout; messages and progress on stderr. Control characters are escaped."""

import sys

from tracknoise.printable import printable

_LAYOUT = "\n\t"


class Terminal:
    """The output of one invocation.

    Attributes
    ----------
    debug
        Show tracebacks.
    quiet
        Print nothing on stderr but errors and warnings.
    """

    def __init__(self) -> None:
        self.debug = False
        self.quiet = False

    def result(self, text: str) -> None:
        """Print a result."""
        sys.stdout.write(f"{printable(text, keep=_LAYOUT)}\n")

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
