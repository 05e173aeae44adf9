"""A comparison of runs for readers: words, tables, Markdown and a page.

- Effects, conditions and answers of a comparison in words.
- Effect and interval of a row as places on a line, in margins: what is worse lies to the right.
- A comparison in Markdown, for a pull request.
- A comparison as one HTML page that needs no network.
"""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

from tracknoise.analysis.estimand import Estimand
from tracknoise.analysis.paired_tests import Unit
from tracknoise.analysis.run_changes import (
    Compared,
    Comparison,
    GateResult,
    GateRow,
    Row,
    RunSide,
    place_words,
)
from tracknoise.report.cells import Cells
from tracknoise.report.templates import template
from tracknoise.tables.enumerations import ChangeVerdict
from tracknoise.text import printable
from tracknoise.words import DASH, MINUS, SPACE, count, interval_text, listing, number, pixels, sentence_case

OUTCOMES = {
    "pass": "The gate passes.",
    "worse": "The gate fails: something is worse than its tolerance.",
    "undecided": "The gate is undecided: this is neither a pass nor a failure.",
}
_FACTORS = (0.5, 2.0)
"""Ratios between these are written as changes in percent."""
_MOST_NAMED = 8
_VARYING = ("dataset", "lighting", "rotation", "direction", "camera", "speed")


def effect_words(row: Row | GateRow) -> str:
    """An effect with its interval, if it has one: ``+21 % (+10 to +33)``; a dash without data."""
    if row.effect is None:
        return DASH
    bounds = [bound for bound in (row.low, row.high) if bound is not None]
    (value, *ends), unit = _in_unit(row.estimand, [row.effect, *bounds])
    factor = "factor " if unit is None else ""
    written = f"{factor}{value}{unit or ''}"
    if not ends:
        return written
    if row.high is None:
        return f"{written} ({ends[0]} or more)"
    return f"{written} (up to {ends[0]})" if row.low is None else f"{written} ({' to '.join(ends)})"


def _in_unit(estimand: Estimand, values: Sequence[float]) -> tuple[list[str], str | None]:
    """Values as text, and their unit; None for factors."""
    if estimand.unit == Unit.px:
        return [_signed(pixels(abs(one)), one) for one in values], f"{SPACE}px"
    if estimand.unit == Unit.share:
        return [_percent(100 * one) for one in values], " percentage points"
    if all(_FACTORS[0] <= one <= _FACTORS[1] for one in values):
        return [_percent(100 * (one - 1)) for one in values], f"{SPACE}%"
    return [number(one) for one in values], None


def tolerance_words(row: GateRow) -> str:
    """A tolerance in the unit of its statistic."""
    if row.estimand.unit == Unit.px:
        return f"{pixels(row.tolerance)}{SPACE}px"
    unit = "percentage points" if row.estimand.unit == Unit.share else "%"
    return f"{number(100 * row.tolerance)}{SPACE}{unit}"


def where_words(row: Row) -> str:
    """Age, frame or window of the effect, and its coordinate; empty for the mean over all."""
    place = "" if row.at is None or row.axis is None else place_words(row.axis, row.at)
    return place if row.coordinate is None else f"{place} in {row.coordinate}".strip()


def condition_words(of: Compared, varying: Sequence[str]) -> str:
    """Trackers of a row, and what else distinguishes it from other rows."""
    trackers = of.tracker if of.tracker == of.other_tracker else f"{of.other_tracker} against {of.tracker}"
    return ", ".join([trackers, *_distinct(of, varying)])


def _distinct(of: Compared, varying: Sequence[str]) -> list[str]:
    return [f"{name} {getattr(of, name)}" for name in varying if name in _VARYING]


def varying(rows: Sequence[Row | GateRow]) -> list[str]:
    """Fields of the conditions that have several values."""
    names = [field.name for field in fields(Compared)]
    return [name for name in names if len({getattr(row.of, name) for row in rows}) > 1]


def answers(rows: Sequence[Row]) -> list[str]:
    """One sentence per verdict that occurs: its statistics, or how many rows have no difference or are undecided."""
    named = varying(rows)
    several = len({row.of for row in rows}) > 1
    sentences = []
    for verdict in ChangeVerdict:
        found = [_named(row, named) for row in rows if row.verdict == verdict]
        if several and verdict in (ChangeVerdict.none, ChangeVerdict.undecided):
            found = [f"{len(found)} of {count(len(rows), 'row')}"] if found else []
        rest = [f"{len(found) - _MOST_NAMED} more"] if len(found) > _MOST_NAMED else []
        why = _why_of_all([row for row in rows if row.verdict == verdict])
        if found:
            reason = f", because {why}" if why else ""
            sentences.append(f"{sentence_case(verdict)}: {listing([*found[:_MOST_NAMED], *rest])}{reason}.")
    return sentences


def _why_of_all(rows: Sequence[Row]) -> str:
    """The remark that all rows have, where there are several; else empty."""
    remarks = {row.why or "" for row in rows}
    return remarks.pop() if len(rows) > 1 and len(remarks) == 1 else ""


def clearest(rows: Sequence[Row]) -> list[str]:
    """One sentence per statistic that is worse or better, with its effect; the worse ones first. Then what it is of."""
    named = varying(rows)
    ordered = sorted(rows, key=lambda row: list(ChangeVerdict).index(row.verdict))
    found = [row for row in ordered if row.verdict in (ChangeVerdict.worse, ChangeVerdict.better)][:_MOST_NAMED]
    effects = [
        f"{sentence_case(_named(row, named))} is {row.verdict}: {effect_words(row)}{_at_age(row)}." for row in found
    ]
    are_ratios = any(row.estimand.unit == Unit.ratio for row in found)
    return [*effects, *(["Factors and percentages are geometric means over scenes."] if are_ratios else [])]


def gate_sentences(result: GateResult) -> list[str]:
    """The outcome, and what is missing."""
    return [OUTCOMES[result.outcome], *(f"{sentence_case(reason.removesuffix('.'))}." for reason in result.missing)]


def intervals_words(rows: Sequence[Row], level: float) -> str:
    """How the intervals of a condition were made; empty where there are none."""
    made = [row for row in rows if row.resampled is not None and row.effect is not None]
    if not made:
        return ""
    return interval_text(level, str(made[0].resampled), [row.n_scenes for row in made])


def by_run(comparison: Comparison) -> dict[str, list[Row]]:
    """Rows of each run that is compared with the first."""
    return {side.name: [row for row in comparison.rows if row.of.run == side.name] for side in comparison.others}


def _at_age(row: Row) -> str:
    where = where_words(row)
    return f", {where}" if where else ""


def _named(row: Row, named: Sequence[str]) -> str:
    """The statistic, and the condition where there are several."""
    if "tracker" in named:
        return f"{row.estimand.title} ({condition_words(row.of, named)})"
    distinct = ", ".join(_distinct(row.of, named))
    return f"{row.estimand.title} ({distinct})" if distinct else row.estimand.title


def _signed(text: str, value: float) -> str:
    return f"+{text}" if value > 0 else f"{MINUS}{text}" if value < 0 else text


def _percent(value: float) -> str:
    """To three digits, and no finer than a tenth."""
    digits = f"{abs(value):.1f}" if abs(round(value, 1)) < 10 else f"{abs(value):.0f}"
    return _signed(digits, 0.0 if float(digits) == 0 else value)


_HEADINGS = ("statistic", "verdict", "change (interval)", "where", "scenes", "remark")
_NUMERIC = (False, False, True, False, True, False)
_GATE_HEADINGS = ("statistic", "outcome", "change (interval)", "tolerance", "why undecided")


def verdict_cells(comparison: Comparison, run: str, rows: Sequence[Row]) -> list[Cells]:
    """One table per condition: verdicts and effects of all statistics.

    Parameters
    ----------
    comparison
        The comparison.
    run
        Name of the run that is compared with the first.
    rows
        Its rows.
    """
    tables = []
    for condition, intervals, shown in _by_condition(rows, comparison.level):
        title = f"{run} compared with {comparison.first.name}: {condition}"
        common = _why_of_all(shown)
        about = "; ".join(filter(None, [intervals, common]))
        cells = [[*_cells(row), "" if common else row.why or ""] for row in shown]
        tables.append(Cells(f"{title} ({about})" if about else title, _HEADINGS, cells, _NUMERIC))
    return tables


def _by_condition(rows: Sequence[Row], level: float) -> list[tuple[str, str, list[Row]]]:
    """The rows of each condition, with its name and how its intervals were made."""
    named = varying(rows)
    found = {of: [row for row in rows if row.of == of] for of in dict.fromkeys(row.of for row in rows)}
    return [(condition_words(of, named), intervals_words(shown, level), shown) for of, shown in found.items()]


def _cells(row: Row) -> list[str]:
    where = where_words(row) or ("mean" if row.effect is not None else DASH)
    return [row.estimand.title, str(row.verdict), effect_words(row), where, str(row.n_scenes)]


def gate_cells(result: GateResult) -> Cells:
    """The rows of a gate."""
    named = varying(result.rows)
    several = len({row.of for row in result.rows}) > 1
    rows = [
        [
            *([_condition(row, named)] if several else []),
            row.estimand.title,
            row.outcome,
            effect_words(row),
            tolerance_words(row),
            row.why or "",
        ]
        for row in result.rows
    ]
    headings = [*(["condition"] if several else []), *_GATE_HEADINGS]
    return Cells("Gate", headings, rows, [name in _GATE_HEADINGS[2:4] for name in headings])


def _condition(row: GateRow, named: Sequence[str]) -> str:
    words = condition_words(row.of, named)
    return f"{row.of.run}: {words}" if "run" in named else words


WIDTH = 300.0
"""Length of the line, px."""
_INSET = 6.0
"""Room for the marks at both ends, px."""
_MOST_MARGINS = 20.0
"""Changes of so many margins, and larger ones, lie at its ends."""


@dataclass(frozen=True, slots=True)
class Plot:
    """Places on the line, px from its left end.

    Attributes
    ----------
    effect, low, high
        The effect and its interval; `low` is left of `high`.
    inner
        Bounds of the margin.
    scenes
        Effects of single scenes, with their names.
    """

    effect: float
    low: float
    high: float
    inner: tuple[float, float]
    scenes: tuple[tuple[str, float], ...]


def plot_of(row: Row) -> Plot | None:
    """Places of a row; None where it has no effect or no margin."""
    if row.effect is None or row.low is None or row.high is None or row.margin is None:
        return None
    low, high = sorted((_place(row, row.low), _place(row, row.high)))
    scenes = tuple((name, _place(row, value)) for name, value in row.scenes.items())
    return Plot(_place(row, row.effect), low, high, (_place_of(-1.0), _place_of(1.0)), scenes)


def _place(row: Row, value: float) -> float:
    sign = -1.0 if row.estimand.larger_is_better else 1.0
    assert row.margin is not None
    if row.estimand.unit == Unit.ratio:
        return _place_of(sign * math.log(value) / math.log(row.margin))
    return _place_of(sign * value / row.margin)


def _place_of(margins: float) -> float:
    """Place of a number of margins: the more of them, the closer they lie."""
    inside = max(-_MOST_MARGINS, min(_MOST_MARGINS, margins))
    share = math.copysign(math.log1p(abs(inside)) / math.log1p(_MOST_MARGINS), inside)
    return round(WIDTH / 2 + (WIDTH / 2 - _INSET) * share, 1)


_SIGNS = re.compile(r"([\\`*_\[\]|~$])")
_LINKING = re.compile(r"[@#]|:(?=//)|\bwww(?=\.)|\b(?:mailto|xmpp):|\bGH-(?=\d)", re.IGNORECASE)
"""What makes a mention, a reference or a link of the text behind it, where Markdown is read as GitHub reads it."""
_NO_SPACE = "&#8203;"


def comparison_markdown(comparison: Comparison) -> str:
    """The answer, the gate, and one folded table per condition."""
    return "\n".join(_lines(comparison))


def _lines(comparison: Comparison) -> Iterator[str]:
    names = ", ".join(side.name for side in comparison.others)
    yield f"## {_escaped(names)} compared with {_escaped(comparison.first.name)}"
    yield ""
    if comparison.gate is not None:
        outcome, *reasons = gate_sentences(comparison.gate)
        yield f"**{outcome}**"
        yield from (f"- {_escaped(reason)}" for reason in reasons)
        yield from _table(gate_cells(comparison.gate))
    yield from (f"- {_escaped(doubt)}" for doubt in comparison.doubts)
    for side, rows in zip(comparison.others, by_run(comparison).values(), strict=True):
        if len(comparison.others) > 1:
            yield f"### {_escaped(side.name)}\n"
        yield from (f"- {_escaped(sentence)}" for sentence in [*answers(rows), *clearest(rows)])
        for cells in verdict_cells(comparison, side.name, rows):
            yield from ("", "<details>", f"<summary>{_in_html(cells.caption)}</summary>")
            yield from _table(cells)
            yield "</details>"
        yield from _markdown_differences(side)
    yield from ("", f"Margin: {100 * comparison.margin:g} %. Every number is paired by scene; see docs/compare.md.", "")


def _markdown_differences(side: RunSide) -> Iterator[str]:
    if side.differs or side.notes:
        yield ""
    yield from (
        f"- {_escaped(name)}: {_escaped(there)} before, {_escaped(here)} now" for name, there, here in side.differs
    )
    yield from (f"- {_escaped(note)}" for note in side.notes)


def _table(cells: Cells) -> Iterator[str]:
    yield ""
    rules = ["--:" if right else "---" for right in cells.numeric]
    for row in (map(_escaped, cells.headings), rules, *(map(_escaped, row) for row in cells.rows)):
        yield f"| {' | '.join(row)} |"
    yield ""


def _escaped(text: str) -> str:
    """Text that Markdown shows as it is, in one line; it notifies and links nothing."""
    return _SIGNS.sub(r"\\\1", _in_html(text))


def _in_html(text: str) -> str:
    """The same where Markdown has HTML."""
    plain = printable(text).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return _LINKING.sub(lambda found: found[0] + _NO_SPACE, plain)


_MOST_OPEN = 4
"""Conditions whose tables are unfolded."""


def comparison_page(comparison: Comparison) -> str:
    """The page: the answer first, then every statistic with its interval, and what the runs differ in."""
    parts = [
        (side, answers(rows), clearest(rows), _by_condition(rows, comparison.level))
        for side, rows in zip(comparison.others, by_run(comparison).values(), strict=True)
    ]
    gate = None if comparison.gate is None else (gate_sentences(comparison.gate), gate_cells(comparison.gate))
    return template("compare.html.j2").render(
        comparison=comparison,
        parts=parts,
        gate=gate,
        most_open=_MOST_OPEN,
        effect_words=effect_words,
        where_words=where_words,
        plot_of=plot_of,
        estimands=comparison.estimands.values(),
        differences=[_page_differences(side.name, side.differs) for side in comparison.others],
    )


def _page_differences(run: str, differs: Sequence[tuple[str, str, str]]) -> Cells:
    return Cells(f"What differs in {run}", ["setting", "first run", run], differs, [False] * 3)
