"""The section that says which factors matter, beside what the paper finds where a run repeats it."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import polars as pl

from tracknoise.findings.wording import DASH, SPACE, count, effect_text, number, percent
from tracknoise.report import paper
from tracknoise.report.evidence import Evidence
from tracknoise.report.sentences import listing
from tracknoise.report.tables import Cells

_MARKS = {"agree": "✓", "disagree": "✗", "undecided": "?"}
_UNITS = {"px": "px", "px^2": "px²", "frames": "frames", "share": ""}


def heading(evidence: Evidence) -> str:
    """Of the section."""
    return "Beside the paper" if evidence.settings.get("paper") else "What matters"


def verdicts(evidence: Evidence) -> Cells:
    """A row a statistic: for every factor and tracker the verdict with its effect, and the paper's with a mark."""
    table = paper.side_by_side(evidence)
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
    marks += ["yes? or no?: by the effect alone, undecided by its interval"] if asks else []
    legend = f" ({', '.join(marks)})" if marks else ""
    return Cells(f"Does it matter?{legend}", [name for _, _, name in parts], rows, [False] * len(parts), groups)


def _mark(agreement: str, point_agreement: str) -> str:
    """Whether the paper is agreed with; in brackets if only the effect says so, and its interval does not decide."""
    if agreement == "undecided" != point_agreement:
        return f"({_MARKS[point_agreement]})"
    return _MARKS.get(agreement, "")


def sentences(evidence: Evidence) -> list[str]:
    """What the verdicts come to."""
    table = paper.comparison(evidence)
    told = [_tally(evidence, table)] if table["paper"].count() else []
    if table.is_empty():
        told.append("Nothing was varied in this run, so there is nothing to compare.")
    slight = table.filter(pl.col("share_of_absolute") <= pl.col("margin"), verdict="yes")
    if slight.height:
        largest = percent(slight["share_of_absolute"].max())  # type: ignore[arg-type]
        told.append(
            f"Mind the mean error of {listing(_asked(row) for row in slight.to_dicts())}: where there is hardly a "
            "bias, hardly anything varies in common, and chance alone makes a difference by this rule. There, means "
            f"differ by at most {largest} of the variation of the mean absolute error."
        )
    return told


def intervals(evidence: Evidence) -> Cells | None:
    """The interval of each effect, and why it does not decide where it does not; None where there are no intervals."""
    rows = [_interval(row) for row in paper.comparison(evidence).to_dicts() if row["n_scenes"] is not None]
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


def details(evidence: Evidence) -> Cells:
    """What decided the point rule: one row a factor, tracker and statistic."""
    headings = ["factor", "tracker", "statistic", "point rule", "most apart", "where", "pairs"]
    headings += ["differ by", "common", "effect", "of mean |error|"]
    rows = [_detail(evidence, row) for row in paper.comparison(evidence).to_dicts()]
    return Cells("What decided the point rule", headings, rows, [False] * 6 + [True] * 5)


def _detail(evidence: Evidence, row: Mapping[str, Any]) -> list[str]:
    asked = [*_question(row), row["point_verdict"]]
    if row["effect"] is None:
        return [*asked, row["point_why"], *[DASH] * 6]
    where = "" if row["at"] is None else f"{row['coordinate']}, {evidence.axis.place(row['at'])}".replace(" ", SPACE)
    pairs = f"{row['n_pairs']} of {row['n_levels'] * (row['n_levels'] - 1) // 2}"
    compared = f"{row['level_a']} and {row['level_b']}" + (f" ({row['point_why']})" if row["point_why"] else "")
    sizes = [_size(row["difference"], row["unit"]), _size(row["common"], row["unit"]), effect_text(row["effect"])]
    share = DASH if row["share_of_absolute"] is None else percent(row["share_of_absolute"])
    return [*asked, compared, where, pairs, *sizes, share]


def _size(value: float, unit: str) -> str:
    return f"{number(value)} {_UNITS[unit]}".strip()


def _asked(row: Mapping[str, Any]) -> str:
    return f"{row['tracker']} by {row['factor']}" if row["tracker"] else "the trackers"


def _tally(evidence: Evidence, table: pl.DataFrame) -> str:
    counts, alone = paper.tally(table), paper.tally(table, of="point_agreement")
    effects = f" By their effects alone, {_agreeing(alone)}." if alone != counts else ""
    return (
        f"Of the {count(sum(counts.values()), 'cell')} of the paper's table for "
        f"{paper.title(evidence.settings['paper'])}, {_agreeing(counts)}.{effects}"
    )


def _agreeing(counts: Mapping[str, int]) -> str:
    parts = [
        f"{number(counts['agree'])} of the verdicts agree with the paper's",
        f"{number(counts['disagree'])} do not",
    ]
    parts += [f"{number(counts['undecided'])} cannot be given"] if counts["undecided"] else []
    return listing(parts)
