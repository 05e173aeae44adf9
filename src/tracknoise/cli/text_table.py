"""Tables of the report as text: with lines in a terminal, plain elsewhere."""

import sys
from collections.abc import Callable, Sequence

from tracknoise.report.cells import Cells
from tracknoise.text import printable


def show(write: Callable[[str], None], cells: Cells) -> None:
    """Print a table: as lines and colours in a terminal, otherwise as plain text passed to `write`."""
    if sys.stdout.isatty():
        _show_rich(cells)
    else:
        write(plain(cells))


def plain(cells: Cells) -> str:
    """A table as text: caption, headings and aligned columns."""
    rows = [[_one_line(text) for text in row] for row in (_headings(cells), *cells.rows)]
    lines = aligned(rows, numeric=cells.numeric)
    return "\n".join([cells.caption, *lines[:1], "-" * len(lines[0]), *lines[1:]])


def aligned(rows: Sequence[Sequence[str]], *, numeric: Sequence[bool]) -> list[str]:
    """Format rows of text as aligned columns, two spaces apart. Numeric columns are right-aligned."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, numeric, strict=True)
        ).rstrip()
        for row in rows
    ]


def _headings(cells: Cells) -> list[str]:
    """Headings, each preceded by the heading of its group."""
    if not cells.groups:
        return list(cells.headings)
    groups = [title for title, span in cells.groups for _ in range(span)]
    return [f"{group} {name}".strip() for group, name in zip(groups, cells.headings, strict=True)]


def _one_line(text: str) -> str:
    return printable(" ".join(text.split()))


def _show_rich(cells: Cells) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(_one_line(cells.caption)), title_justify="left")
    for heading, right in zip(_headings(cells), cells.numeric, strict=True):
        table.add_column(Text(_one_line(heading)), justify="right" if right else "left")
    for row in cells.rows:
        table.add_row(*(Text(_one_line(text)) for text in row))
    Console().print(table)
