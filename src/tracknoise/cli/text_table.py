"""Tables of the report in the terminal: with lines and colours in one, plain text elsewhere."""

import sys
from collections.abc import Sequence
from itertools import accumulate

from tracknoise.cli.terminal import Terminal
from tracknoise.report.cells import Cells


def show(terminal: Terminal, cells: Cells) -> None:
    """Print a table."""
    if sys.stdout.isatty():
        _show_rich(cells)
    else:
        terminal.result(plain(cells))


def plain(cells: Cells) -> str:
    """A table as text: its caption, its headings, and aligned columns."""
    rows = [[_one_line(text) for text in row] for row in (_headings(cells), *cells.rows)]
    lines = aligned(rows, numeric=cells.numeric)
    return "\n".join([cells.caption, *lines[:1], "-" * len(lines[0]), *lines[1:]])


def aligned(rows: Sequence[Sequence[str]], *, numeric: Sequence[bool]) -> list[str]:
    """Rows of text in columns of the same width, two spaces apart; numbers are set flush right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, numeric, strict=True)
        ).rstrip()
        for row in rows
    ]


def _headings(cells: Cells) -> list[str]:
    """Headings, each after the heading of its group."""
    if not cells.groups:
        return list(cells.headings)
    ends = list(accumulate(span for _, span in cells.groups))
    groups = [next(cells.groups[i][0] for i, end in enumerate(ends) if place < end) for place in range(ends[-1])]
    return [f"{group} {name}".strip() for group, name in zip(groups, cells.headings, strict=True)]


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _show_rich(cells: Cells) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(cells.caption), title_justify="left")
    for heading, right in zip(_headings(cells), cells.numeric, strict=True):
        table.add_column(Text(heading), justify="right" if right else "left")
    for row in cells.rows:
        table.add_row(*map(Text, row))
    Console().print(table)
