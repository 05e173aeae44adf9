"""Files of `tracknoise effects`: the table as CSV and Markdown, the figure as SVG and PNG."""

from pathlib import Path

import polars as pl

from tracknoise.report.effect_table import effect_cells, markdown
from tracknoise.report.export import render, specification
from tracknoise.report.figures.effect_sizes import effect_sizes
from tracknoise.report.table_files import to_csv
from tracknoise.tables.files import write_atomically

_FORMATS = ("svg", "png")


def write_effects(folder: Path, changes: pl.DataFrame, *, level: float) -> list[Path]:
    """Write ``effects.csv``, ``effects.md``, ``effects.svg`` and ``effects.png``.

    Parameters
    ----------
    folder
        Where.
    changes
        Schema `EFFECT_CHANGES`. The figure shows its first age.
    level
        Of the intervals.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    StoreError
        If they cannot be written.
    """
    text = "\n".join(map(markdown, effect_cells(changes, level=level)))
    figure = effect_sizes(changes.filter(age=changes["age"].first()))
    drawn = render(specification(figure), _FORMATS)
    contents = {"csv": to_csv(changes).encode(), "md": text.encode(), **drawn}
    paths = {folder / f"effects.{ending}": content for ending, content in contents.items()}
    for path, content in paths.items():
        write_atomically(path, content)
    return list(paths)
