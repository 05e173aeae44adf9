"""The table files of the report, as CSV; those of the paper as LaTeX too."""

from collections.abc import Callable
from dataclasses import dataclass

import polars as pl
import polars.selectors as cs

from tracknoise.report import factor_section
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.truth_errors import with_floor
from tracknoise.tables.run_table import RunTable
from tracknoise.text import printable
from tracknoise.topics.catalogue import RUN_TABLES
from tracknoise.topics.headlines import findings_of
from tracknoise.words import DASH, MINUS, TIMES

_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_LATEX = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        **{sign: f"\\{sign}" for sign in "&%$#_{}"},
        **{sign: f"{{{sign}}}" for sign in "[]*"},  # after the end of a row they would be arguments of it
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "<": r"\textless{}",
        ">": r"\textgreater{}",
        MINUS: "$-$",
        DASH: "--",
        TIMES: r"$\times$",
    }
)


@dataclass(frozen=True, slots=True)
class Export:
    """A table file.

    Attributes
    ----------
    id
        File name without extension.
    title
        What it holds.
    make
        Takes it from the data.
    kinds
        Of its files: LaTeX for what the paper prints.
    """

    id: str
    title: str
    make: Callable[[ReportData], pl.DataFrame]
    kinds: tuple[str, ...] = ("csv",)


_MADE: tuple[Export, ...] = (
    Export(
        "curves",
        "error by age or frame, with the truth floor",
        lambda data: with_floor(data["curves"].filter(~pl.col("cut")), data["floor"]),
    ),
    Export("truth-floor", "truth floor, by what causes it", lambda data: data["floor"]),
    Export(
        "factor-effects",
        "verdicts on factors",
        lambda data: factor_section.side_by_side(data.comparison),
        ("csv", "tex"),
    ),
    Export("findings", "findings, with the ids of their rows of results", lambda data: _findings(data)),
    Export("results", "rows of results that the findings rest on", lambda data: _cited(data)),
    Export("intervals", "intervals, for the view shown in the figures", lambda data: data.reference(data.intervals)),
    Export(
        "incidence",
        "causes of track ends, for the view shown in the figures",
        lambda data: data.reference(data["incidence"]),
    ),
)
"""Files that are made of tables."""


def _as_it_is(table: RunTable) -> Export:
    return Export(table.name.replace("_", "-"), table.title, lambda data: data[table.name])


EXPORTS: tuple[Export, ...] = (*_MADE, *(_as_it_is(table) for table in RUN_TABLES.values() if table.title))
"""Files of a report, among them one of each table that has a title."""


def _findings(data: ReportData) -> pl.DataFrame:
    """The findings without their parts."""
    return findings_of(data.tables).drop("opening", "closing", "parts").with_columns(pl.col("rows").list.join(" "))


def _cited(data: ReportData) -> pl.DataFrame:
    """The rows of results whose numbers the findings have, without columns that are empty in all of them."""
    rows = data.results(findings_of(data.tables)["rows"].explode().drop_nulls().unique().to_list())
    used = [name for name in rows.columns if rows[name].null_count() < rows.height]
    return rows.select(used).with_columns(
        cs.by_name("caveats", require_all=False).cast(pl.List(pl.String)).list.join("; ")
    )


def to_csv(table: pl.DataFrame) -> str:
    """Write a table as CSV: full precision, nothing where a value is missing.

    Text that a spreadsheet would take for a formula gets a quote in front. Control characters are escaped.
    """
    return _written(table).write_csv()


def _written(table: pl.DataFrame) -> pl.DataFrame:
    """A table with the text of its cells and headings as CSV has it."""
    return table.with_columns(map(_changed, table.select(cs.string(include_categorical=True) | cs.enum()))).rename(
        _cell
    )


def _changed(column: pl.Series) -> pl.Series:
    text = column.cast(pl.String)
    names = text.drop_nulls().unique()
    return text.replace(names, names.map_elements(_cell, return_dtype=pl.String))


def _cell(text: str) -> str:
    return printable(f"'{text}" if text.startswith(_FORMULA) else text)


def to_latex(table: pl.DataFrame) -> str:
    """Write a table as a LaTeX ``tabular`` without packages: numbers to four digits, a dash where one is missing."""
    alignment = "".join("r" if kind.is_numeric() else "l" for kind in table.dtypes)
    heading = " & ".join(map(escape_latex, table.columns))
    lines = [" & ".join(cells) + " \\\\" for cells in zip(*map(_latex_cells, table), strict=True)]
    body = [f"\\begin{{tabular}}{{{alignment}}}", "\\hline", f"{heading} \\\\", "\\hline", *lines, "\\hline"]
    return "\n".join([*body, "\\end{tabular}", ""])


def escape_latex(text: str) -> str:
    """Escape text for LaTeX, and its control characters."""
    return printable(text).translate(_LATEX)


def _latex_cells(column: pl.Series) -> list[str]:
    """Cells of a column. A text that occurs often is escaped once."""
    values = column.to_list()
    if column.dtype.is_float():
        return ["--" if value is None else format(value, ".4g") for value in values]
    texts = {value: escape_latex(str(value)) for value in dict.fromkeys(values)} | {None: "--"}
    return [texts[value] for value in values]
