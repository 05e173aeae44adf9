"""The command line of tracknoise, called in this process."""

import contextlib
import io
import os

from tracknoise.cli.app import main

SCENE = ["--motion", "sideways", "--frames", "5", "--option", "width=96", "--option", "height=72", "--quiet"]
"""Options of a simulated scene that is measured at once."""


def call(arguments: list[str]) -> tuple[object, str, str]:
    """Exit status of a command, and what it printed on stdout and on stderr."""
    shown, said = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(shown), contextlib.redirect_stderr(said):
        try:
            main(arguments)
        except SystemExit as ended:
            return ended.code or 0, shown.getvalue(), said.getvalue()
    return 0, shown.getvalue(), said.getvalue()


def memory_folder() -> str | None:
    """Where files are written fastest: a manifest waits for the disk."""
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
