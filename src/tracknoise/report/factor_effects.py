"""The section on the effects of factors, compared with the paper where a run repeats one of its experiments."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import polars as pl

from tracknoise.findings.wording import DASH, SPACE, count, effect_text, listing, number, percent
from tracknoise.report import paper
from tracknoise.report.cells import Cells
from tracknoise.report.report_data import ReportData

_MARKS = {"agree": "✓", "disagree": "✗", "undecided": "?"}
_UNITS = {"px": "px", "px^2": "px²", "frames": "frames", "share": ""}


def heading(data: ReportData) -> str:
    """Title of the section."""
    return "Comparison with the paper" if data.settings.get("paper") else "Factor effects"


def verdicts(data: ReportData) -> Cells:
    """One row per statistic: verdict and effect for every factor and tracker, and the paper's verdict with a mark."""
    table = paper.side_by_side(data.comparison)
    columns: dict[str, Sequence[str]] = {"statistic": [name.replace(" ", SPACE) for name in table["statistic"]]}
    for name in table.columns[1:]:
        group, _, heading = name.rpartition(": ")
        if heading == "paper":
            cells = zip(table[name], table[f"{group}: verdicts"], table[f"{group}: effects"], strict=True)
            columns[name] = [f"{said}{SPACE}{_mark(verdict, effect)}" for said, verdict, effect in cells]
        elif heading == "here":
            columns[name] = table[name].to_list()
    parts = [name.rpartition(": ") for name in columns]
    groups = [(group, len(list(names))) for group, names in groupby(group for group, _, _ in parts)]
    rows = list(zip(*columns.values(), strict=True))
    marks = [] if table.width == len(columns) else [f"{mark} {word}" for word, mark in _MARKS.items()]
    asks = any("?" in cell for name in columns if name.endswith(": here") for cell in columns[name])
    marks += ["yes? or no?: verdict of the effect alone, undecided with its interval"] if asks else []
    legend = f" ({', '.join(marks)})" if marks else ""
    return Cells(
        f"Does the factor change the statistic?{legend}",
        [name for _, _, name in parts],
        rows,
        [False] * len(parts),
        groups,
    )


def _mark(agreement: str, point_agreement: str) -> str:
    """Whether the verdict agrees with the paper's. In brackets if it rests on the effect alone."""
    if agreement == "undecided" != point_agreement:
        return f"({_MARKS[point_agreement]})"
    return _MARKS.get(agreement, "")


def sentences(data: ReportData) -> list[str]:
    """Count of agreements with the paper, and warnings."""
    table = data.comparison
    made = [_tally(data, table)] if table["paper"].count() else []
    if table.is_empty():
        made.append("This run varies no factor, so there is nothing to compare.")
    slight = table.filter(pl.col("share_of_absolute") <= pl.col("margin"), verdict="yes")
    if slight.height:
        largest = percent(slight["share_of_absolute"].max())  # type: ignore[arg-type]
        made.append(
            f"Caution: the yes for the mean error of {listing(_asked(row) for row in slight.to_dicts())} may be "
            "chance. There is hardly any bias, so the common variation is small. Even a small difference then exceeds "
            "the margin. "
            f"These means differ by at most {largest} of the variation of the mean absolute error."
        )
    return made


def intervals(data: ReportData) -> Cells | None:
    """Interval of each effect, and why a verdict is undecided. None where there are no intervals."""
    rows = [_interval(row) for row in data.comparison.to_dicts() if row["n_scenes"] is not None]
    headings = ["factor", "tracker", "statistic", "verdict", "effect", "interval", "scenes", "by the point rule", "why"]
    caption = "Verdicts with intervals"
    return Cells(caption, headings, rows, [False] * 4 + [True] * 3 + [False] * 2) if rows else None


def _interval(row: Mapping[str, Any]) -> list[str]:
    ends = [effect_text(row[name]) for name in ("low", "high")]
    point = f"{row['point_verdict']} ({effect_text(row['effect'])})" if row["effect"] is not None else DASH
    return [
        *_question(row),
        row["verdict"],
        effect_text(row["interval_effect"]) or DASH,
        " to ".join(ends) if all(ends) else DASH,
        str(row["n_scenes"]),
        point,
        row["why"] or "",
    ]


def _question(row: Mapping[str, Any]) -> list[str]:
    return [row["factor"], row["tracker"] or DASH, paper.STATISTICS[row["role"]].replace(" ", SPACE)]


def details(data: ReportData) -> Cells:
    """What decided the point rule: one row per factor, tracker and statistic."""
    headings = ["factor", "tracker", "statistic", "point rule", "levels", "where", "pairs"]
    headings += ["difference", "variation", "effect", "share of mean |error|"]
    rows = [_detail(data, row) for row in data.comparison.to_dicts()]
    return Cells("Point rule: the largest difference of each factor", headings, rows, [False] * 6 + [True] * 5)


def _detail(data: ReportData, row: Mapping[str, Any]) -> list[str]:
    asked = [*_question(row), row["point_verdict"]]
    if row["effect"] is None:
        return [*asked, row["point_why"], *[DASH] * 6]
    where = "" if row["at"] is None else f"{row['coordinate']}, {data.axis.place(row['at'])}".replace(" ", SPACE)
    pairs = f"{row['n_pairs']} of {row['n_levels'] * (row['n_levels'] - 1) // 2}"
    compared = f"{row['level_a']} and {row['level_b']}" + (f" ({row['point_why']})" if row["point_why"] else "")
    sizes = [_size(row["difference"], row["unit"]), _size(row["common"], row["unit"]), effect_text(row["effect"])]
    share = DASH if row["share_of_absolute"] is None else percent(row["share_of_absolute"])
    return [*asked, compared, where, pairs, *sizes, share]


def _size(value: float, unit: str) -> str:
    return f"{number(value)} {_UNITS[unit]}".strip()


def _asked(row: Mapping[str, Any]) -> str:
    return f"{row['tracker']} by {row['factor']}" if row["tracker"] else "the trackers"


def _tally(data: ReportData, table: pl.DataFrame) -> str:
    counts, alone = paper.tally(table), paper.tally(table, of="point_agreement")
    effects = f" Judged by the effects alone, {_agreeing(alone)}." if alone != counts else ""
    cells = count(sum(counts.values()), "cell")
    return (
        f"The paper's table for {paper.title(data.settings['paper'])} has {cells} that this run can be compared with. "
        f"Here {_agreeing(counts)}.{effects}"
    )


def _agreeing(counts: Mapping[str, int]) -> str:
    parts = [f"{number(counts['agree'])} agree with the paper", f"{number(counts['disagree'])} disagree"]
    parts += [f"{number(counts['undecided'])} are undecided"] if counts["undecided"] else []
    return listing(parts)
