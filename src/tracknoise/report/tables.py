"""Tables as CSV, as LaTeX, and as the cells of an HTML table."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import polars as pl

from tracknoise.findings.wording import DASH, MINUS, TIMES, number, percent, pixels
from tracknoise.report import paper
from tracknoise.report.evidence import Evidence

_LATEX = {
    "\\": r"\textbackslash{}",
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    MINUS: "$-$",
    DASH: "--",
    TIMES: r"$\times$",
}
_SHARES = ("outlier_ratio", "pooled_ratio", "dropped_share", "survival")


@dataclass(frozen=True, slots=True)
class Export:
    """A table that is written beside the page.

    Attributes
    ----------
    id
        File name without extension.
    title
        What it holds.
    make
        Picks it from the evidence.
    """

    id: str
    title: str
    make: Callable[[Evidence], pl.DataFrame]


def _intervals(evidence: Evidence) -> pl.DataFrame:
    """Of all conditions they are too many to be read."""
    return evidence.reference(evidence.intervals)


EXPORTS: tuple[Export, ...] = (
    Export("summary", "the first numbers of every condition", lambda evidence: evidence.summary),
    Export("curves", "error by age, where curves are not cut", lambda evidence: evidence.curves.filter(~pl.col("cut"))),
    Export("lifetimes", "lifetimes and survival", lambda evidence: evidence.lifetimes),
    Export("outliers", "outlier ratios", lambda evidence: evidence.outliers),
    Export("trims", "what trimming dropped", lambda evidence: evidence.trims),
    Export("what-matters", "which factors matter", paper.side_by_side),
    Export("effects", "how much they do", lambda evidence: evidence.effects),
    Export("findings", "what was found", lambda evidence: evidence.findings),
    Export("intervals", "intervals, in the view that figures are about", _intervals),
    Export("zero-mean", "whether mean errors are zero", lambda evidence: evidence.zero_mean),
    Export("gaussianity", "whether errors are Gaussian", lambda evidence: evidence.gaussianity),
    Export("time-structure", "how errors grow", lambda evidence: evidence.time_structure),
    Export("changes", "how errors change from frame to frame", lambda evidence: evidence.changes),
    Export("dependence", "which factors matter, with intervals", lambda evidence: evidence.dependence),
    Export("counts", "truth statuses and track ends", lambda evidence: evidence.counts),
)


def to_csv(table: pl.DataFrame) -> str:
    """Write a table as CSV: full precision, nothing where a value is missing."""
    return table.write_csv()


def to_latex(table: pl.DataFrame) -> str:
    """Write a table as a LaTeX ``tabular`` without packages: numbers to four digits, a dash where one is missing."""
    alignment = "".join("r" if kind.is_numeric() else "l" for kind in table.dtypes)
    heading = " & ".join(map(escape_latex, table.columns))
    lines = [_latex_row(row) for row in table.iter_rows()]
    body = [f"\\begin{{tabular}}{{{alignment}}}", "\\hline", f"{heading} \\\\", "\\hline", *lines, "\\hline"]
    return "\n".join([*body, "\\end{tabular}", ""])


def escape_latex(text: str) -> str:
    """Text that LaTeX prints as it stands."""
    return "".join(_LATEX.get(sign, sign) for sign in text)


def _latex_row(values: Sequence[object]) -> str:
    cells = [format(value, ".4g") if isinstance(value, float) else "--" if value is None else value for value in values]
    return " & ".join(escape_latex(str(cell)) if cell != "--" else "--" for cell in cells) + " \\\\"


@dataclass(frozen=True, slots=True)
class Cells:
    """A table as the page prints it.

    Attributes
    ----------
    caption
        What it shows.
    headings
        Of the columns.
    rows
        Text of each cell.
    numeric
        Which columns are numbers, and set flush right.
    groups
        Headings over several columns, with the count of these; empty where there are none.
    """

    caption: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    numeric: Sequence[bool]
    groups: Sequence[tuple[str, int]] = ()


def cells(
    table: pl.DataFrame, columns: Mapping[str, str], caption: str, *, groups: Sequence[tuple[str, int]] = ()
) -> Cells:
    """Format the columns that `columns` names, under its headings; shares in percent."""
    chosen = table.select(list(columns))
    rows = [[_cell(value, name) for value, name in zip(row, columns, strict=True)] for row in chosen.iter_rows()]
    return Cells(caption, list(columns.values()), rows, [kind.is_numeric() for kind in chosen.dtypes], groups)


def _cell(value: object, column: str) -> str:
    if not isinstance(value, int | float | None):
        return str(value)
    if value is not None and column in _SHARES:
        return percent(value)
    return pixels(value) if column.endswith("_px") else number(value)
