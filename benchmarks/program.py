"""How a program of this folder ends: an error of the package is one line, and the exit status 1."""

import sys
from collections.abc import Callable, Iterable

from tracknoise.cli.text_table import show
from tracknoise.exceptions import TracknoiseError
from tracknoise.report.cells import Cells


def ended(act: Callable[[], int]) -> int:
    """Exit status of a function, or 1 if it raises an error that names what was found and expected."""
    try:
        return act()
    except TracknoiseError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1


def print_tables(tables: Iterable[Cells]) -> None:
    """Print tables, each after an empty line."""
    for cells in tables:
        print()
        show(print, cells)
