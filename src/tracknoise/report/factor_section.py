"""The section on the effects of factors, compared with the paper where a run repeats one of its experiments."""

from collections.abc import Callable, Mapping
from itertools import groupby
from typing import Any

import polars as pl

from tracknoise.report import paper
from tracknoise.report.cells import Cells
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import Verdict
from tracknoise.words import (
    DASH,
    SPACE,
    STATISTICS,
    bound_text,
    count,
    effect_text,
    listing,
    number,
    percent,
    size_text,
)

_MARKS = {"agree": "✓", "disagree": "✗", "undecided": "?"}
_UNITS = {"px": "px", "px^2": "px²", "frames": "frames", "share": ""}


def heading(data: ReportData) -> str:
    """Title of the section."""
    return "Comparison with the paper" if data.settings.get("paper") else "Factor effects"


def side_by_side(table: pl.DataFrame) -> pl.DataFrame:
    """Paired verdicts of every factor and tracker, one row per statistic: columns ``FACTOR, TRACKER: HEADING``.

    Where the paper has verdicts, they stand before those of the run, by the paper's yardstick and paired. These have a
    mark for their agreement with the paper. `table`: schema `tracknoise.report.paper.COMPARISON`.
    """
    columns: dict[str, list[str]] = {"statistic": [_unbroken(name) for name in STATISTICS.values()]}
    for key, group in table.group_by("factor", "tracker", maintain_order=True):
        rows = {row["role"]: row for row in group.to_dicts()}
        name = ", ".join(str(part) for part in key if part)
        headings = list(_CELLS) if group["paper"].count() else ["paired"]
        columns |= {f"{name}: {title}": [_CELLS[title](rows.get(role)) for role in STATISTICS] for title in headings}
    return pl.DataFrame(columns)


def verdicts(data: ReportData) -> Cells:
    """The table of `side_by_side`."""
    table = side_by_side(data.comparison)
    parts = [name.rpartition(": ") for name in table.columns]
    groups = [(group, len(list(names))) for group, names in groupby(group for group, _, _ in parts)]
    marks = ", ".join(f"{mark} {word}" for word, mark in _MARKS.items()) if data.comparison["paper"].count() else ""
    caption = f"Does the factor change the statistic?{f' ({marks})' if marks else ''}"
    return Cells(caption, [name for _, _, name in parts], [*map(list, table.rows())], [False] * len(parts), groups)


def _paper_cell(row: Mapping[str, Any] | None) -> str:
    return str((row or {}).get("paper") or DASH)


def _yardstick_cell(row: Mapping[str, Any] | None) -> str:
    return _judged(row, "yardstick_", effect_text((row or {}).get("yardstick_effect")))


def _paired_cell(row: Mapping[str, Any] | None) -> str:
    return _judged(row, "", "" if row is None else size_text(row).replace(" (", ", ").replace(")", ""))


def _judged(row: Mapping[str, Any] | None, prefix: str, size: str) -> str:
    """A verdict with its size and mark."""
    if row is None or row[f"{prefix}verdict"] is None:
        return DASH
    mark = _MARKS.get(row[f"{prefix}agreement"] or "", "")
    return _unbroken(" ".join(filter(None, [row[f"{prefix}verdict"], f"({size})" if size else "", mark])))


def _unbroken(text: str) -> str:
    return text.replace(" ", SPACE)


_CELLS: Mapping[str, Callable[[Mapping[str, Any] | None], str]] = {
    "paper": _paper_cell,
    "paper's yardstick": _yardstick_cell,
    "paired": _paired_cell,
}


def sentences(data: ReportData) -> list[str]:
    """Count of agreements with the paper, and warnings."""
    table = data.comparison
    texts = [_tally(data, table)] if table["paper"].count() else []
    if table.is_empty():
        texts.append("This run varies no factor, so there is nothing to compare.")
    share = "yardstick_share_of_absolute"
    slight = table.filter(pl.col(share) <= pl.col("yardstick_margin"), yardstick_verdict="yes")
    if slight.height:
        largest = percent(slight[share].max())  # type: ignore[arg-type]
        texts.append(
            "Caution: by the paper's yardstick, the yes for the mean error of "
            f"{listing(_asked(row) for row in slight.to_dicts())} may be chance. There is hardly any bias, so the "
            "common variation is small. Even a small difference then exceeds the margin. "
            f"These means differ by at most {largest} of the variation of the mean absolute error."
        )
    return texts


def intervals(data: ReportData) -> Cells | None:
    """Ratio or difference of each question with its interval, and why a verdict is undecided. None without any."""
    rows = [_interval(data, row) for row in data.comparison.to_dicts() if row["verdict"] is not None]
    headings = ["factor", "tracker", "statistic", "verdict", "levels", "ratio or difference", "better", "where"]
    headings += ["margin", "scenes", "more scenes needed", "why"]
    caption = "Differences between levels, paired by scene"
    return Cells(caption, headings, rows, [False] * 8 + [True] * 3 + [False]) if rows else None


def _interval(data: ReportData, row: Mapping[str, Any]) -> list[str]:
    return [
        *_question(row),
        row["verdict"],
        DASH if row["effect"] is None else f"{row['level_a']} and {row['level_b']}",
        size_text(row) or DASH,
        row["better"] if row["better"] and row["verdict"] != Verdict.undecided else DASH,
        _where(data, row),
        bound_text(row["margin"], row["unit"]) or DASH,
        str(row["n_scenes"]),
        DASH if row["more_scenes"] is None else number(row["more_scenes"]),
        row["why"] or "",
    ]


def _where(data: ReportData, row: Mapping[str, Any]) -> str:
    """Where the levels were compared."""
    if row["effect"] is None:
        return DASH
    if row["horizon"] is not None:
        return f"to {count(int(row['horizon']), 'frame')}"
    if row["at"] is None:
        return DASH if row["n_places"] is None else f"{count(row['n_places'], data.axis.name)}, u and v"
    return _unbroken(f"{row['coordinate']}, {data.axis.place(row['at'])}")


def _question(row: Mapping[str, Any]) -> list[str]:
    return [row["factor"], row["tracker"] or DASH, _unbroken(STATISTICS[row["role"]])]


def details(data: ReportData) -> Cells:
    """What decided the paper's yardstick: one row per factor, tracker and statistic."""
    headings = ["factor", "tracker", "statistic", "verdict", "levels", "where", "pairs"]
    headings += ["difference", "variation", "effect", "share of mean |error|"]
    decided = data.comparison.filter(pl.col("yardstick_verdict").is_not_null())
    rows = [_detail(data, row) for row in decided.to_dicts()]
    caption = "The paper's yardstick: the largest difference of each factor, relative to the common variation"
    return Cells(caption, headings, rows, [False] * 6 + [True] * 5)


def _detail(data: ReportData, row: Mapping[str, Any]) -> list[str]:
    columns = {name.removeprefix("yardstick_"): value for name, value in row.items() if name.startswith("yardstick_")}
    question = [*_question(row), columns["verdict"]]
    if columns["effect"] is None:
        return [*question, columns["why"], *[DASH] * 6]
    where = "" if columns["at"] is None else _unbroken(f"{columns['coordinate']}, {data.axis.place(columns['at'])}")
    pairs = f"{columns['n_pairs']} of {columns['n_levels'] * (columns['n_levels'] - 1) // 2}"
    compared = f"{columns['level_a']} and {columns['level_b']}" + (f" ({columns['why']})" if columns["why"] else "")
    sizes = [_size(columns["difference"], columns["unit"]), _size(columns["common"], columns["unit"])]
    share = DASH if columns["share_of_absolute"] is None else percent(columns["share_of_absolute"])
    return [*question, compared, where, pairs, *sizes, effect_text(columns["effect"]), share]


def _size(value: float, unit: str) -> str:
    return f"{number(value)} {_UNITS[unit]}".strip()


def _asked(row: Mapping[str, Any]) -> str:
    return f"{row['tracker']} by {row['factor']}" if row["tracker"] else "the trackers"


def _tally(data: ReportData, table: pl.DataFrame) -> str:
    yardstick, paired = paper.tally(table, of="yardstick_agreement"), paper.tally(table)
    cells = count(sum(paired.values()), "cell")
    return (
        f"The paper's table for {paper.title(data.settings['paper'])} has {cells} that this run can be compared with. "
        f"By the paper's yardstick, {_agreeing(yardstick)}. By paired verdicts, {_agreeing(paired)}."
    )


def _agreeing(counts: Mapping[str, int]) -> str:
    parts = [f"{number(counts['agree'])} agree with the paper", f"{number(counts['disagree'])} disagree"]
    parts += [f"{number(counts['undecided'])} are undecided"] if counts["undecided"] else []
    return listing(parts)
