"""A comparison of runs for readers: words, tables, Markdown and a page.

- Effects and conditions of a comparison in words.
- Effect and interval of a row as places on a line, in margins: what is worse lies to the right.
- A comparison in Markdown, for a pull request.
- A comparison as one HTML page that needs no network.
"""

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from tracknoise.analysis.comparison import Comparison, RunSide
from tracknoise.analysis.conclusion import common_reason, condition_text, varying
from tracknoise.analysis.paired_tests import Unit
from tracknoise.analysis.run_changes import Compared, GateResult, GateRow, Row, place_words
from tracknoise.inference.estimates import Estimate
from tracknoise.report.cells import Cells
from tracknoise.report.templates import template
from tracknoise.tables.enumerations import ChangeVerdict
from tracknoise.text import printable
from tracknoise.words import (
    DASH,
    MINUS,
    SPACE,
    Write,
    count,
    format_as,
    interval_text,
    listing,
    number,
    pixels,
    ratio,
    sentence_case,
)

OUTCOMES = {
    "pass": "The gate passes.",
    "worse": "The gate fails: something is worse than its tolerance.",
    "undecided": "The gate is undecided: this is neither a pass nor a failure.",
}
_FACTORS = (0.5, 2.0)
"""Ratios between these are written as changes in percent."""
_MOST_NAMED = 8
_VARYING = ("dataset", "lighting", "rotation", "direction", "camera", "speed")

_OF_RESIDUALS = ("residual_sigma", "overconfidence")
_CHANGED = (ChangeVerdict.worse, ChangeVerdict.better)


def effect_words(row: Row | GateRow) -> str:
    """An effect with its interval, if it has one: ``+21 % (+10 to +33)``; a dash without data."""
    if row.effect is None:
        return DASH
    ends = [end for end in (row.effect, row.low, row.high) if end is not None]
    if row.estimand.unit == Unit.ratio and not all(map(_is_near_one, ends)):
        return f"factor {format_as(Estimate(row.effect, row.low, row.high), number)}"
    change, write, unit = _change(row)
    return format_as(change, lambda value: _signed(write, value), unit=unit)


def _is_near_one(value: float) -> bool:
    return _FACTORS[0] <= value <= _FACTORS[1]


def _change(row: Row | GateRow) -> tuple[Estimate, Write, str]:
    """An effect with a sign, how it is written without one, and its unit."""
    effect = Estimate(row.effect, row.low, row.high)
    if row.estimand.unit == Unit.px:
        return effect, pixels, f"{SPACE}px"
    if row.estimand.unit == Unit.share:
        return effect.times(100), _to_tenths, " percentage points"
    return _each(effect, lambda end: 100 * (end - 1)), _to_tenths, f"{SPACE}%"


def _each(effect: Estimate, of: Callable[[float], float | None], *, is_reversed: bool = False) -> Estimate:
    """A function of an estimate and its bounds, which it swaps if it is a falling one."""
    bounds = (effect.high, effect.low) if is_reversed else (effect.low, effect.high)
    value, low, high = (None if end is None else of(end) for end in (effect.value, *bounds))
    return Estimate(value, low, high)


def _signed(write: Write, value: float | None) -> str:
    """A number with its sign, but for one that is written as zero."""
    text = write(abs(value or 0))
    return text if not text.strip("0.") else f"{'+' if (value or 0) > 0 else MINUS}{text}"


def _to_tenths(value: float | None) -> str:
    """To three digits, and no finer than a tenth."""
    number = value or 0.0
    return (f"{number:.1f}" if abs(round(number, 1)) < 10 else f"{number:.0f}").replace("-", MINUS)


def _times(value: float | None) -> str:
    """To two digits."""
    return ratio(value) if value is not None and value >= _FACTORS[1] else number(value, digits=2)


def change_sentences(comparison: Comparison, side: RunSide) -> list[str]:
    """What is worse or better in a run, a sentence for each: first what conclusions name first. Then what is not."""
    rows, names = comparison.rows_of(side), comparison.names(side)
    found = [row for row in rows if row.verdict in _CHANGED]
    found.sort(key=lambda row: row.estimand.wording.is_secondary)
    more = f"The tables have {count(len(found) - _MOST_NAMED, 'more change')}." if len(found) > _MOST_NAMED else ""
    are_ratios = any(row.estimand.unit == Unit.ratio for row in found)
    mean = "Factors and percentages are geometric means over scenes." if are_ratios else ""
    of_residuals = any(row.estimand.name in _OF_RESIDUALS for row in found)
    why = "Residuals do not show errors that look like another depth." if of_residuals else ""
    named = varying(rows)
    return [
        *(_effect_sentence(row, names, named) for row in found[:_MOST_NAMED]),
        *filter(None, [why, more, *_unchanged(rows), mean]),
    ]


def _effect_sentence(row: Row, names: tuple[str, str], named: Sequence[str]) -> str:
    """An effect in words, by the run that has more if it is a factor: ``Tracks live 2.5 times as long in w7``."""
    assert row.effect is not None
    words, whose = row.estimand.wording, names[1]
    write: Write
    if row.estimand.unit == Unit.ratio and not _is_near_one(row.effect):
        effect, write, unit = Estimate(row.effect, row.low, row.high), _times, f"{SPACE}times as {words.as_much}"
        if row.effect < 1:
            effect, whose = _each(effect, lambda end: 1 / end if end else None, is_reversed=True), names[0]
    else:
        effect, write, unit = _change(row)
        neutral = 1 if row.estimand.unit == Unit.ratio else 0
        if row.effect < neutral:
            effect = _each(effect, lambda end: -end, is_reversed=True)
        unit = f"{unit} {words.less if row.effect < neutral else words.more}"
    joint = "in" if row.of.tracker == row.of.other_tracker else "with"
    size = format_as(effect, write, unit=f"{unit} {joint} {whose}")
    said = ", ".join(filter(None, [condition_text(row.of, named), f"{words.subject} {size}", where_words(row)]))
    return f"{sentence_case(said)}."


def _unchanged(rows: Sequence[Row]) -> list[str]:
    """What is not shown to differ, and what is undecided, of a single condition that has something else, too."""
    sentences = []
    for verdict in (ChangeVerdict.none, ChangeVerdict.undecided):
        found = [row.estimand.title for row in rows if row.verdict == verdict]
        if found and len(found) < len(rows) and len({row.of for row in rows}) == 1:
            rest = [f"{len(found) - _MOST_NAMED} more"] if len(found) > _MOST_NAMED else []
            sentences.append(f"{sentence_case(verdict)}: {listing([*found[:_MOST_NAMED], *rest])}.")
    return sentences


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
    """The tracker of a row, if it is the same in both runs, and what else distinguishes it from other rows."""
    tracker = [of.tracker] if of.tracker == of.other_tracker else []
    return ", ".join([*tracker, *(f"{name} {getattr(of, name)}" for name in varying if name in _VARYING)])


def gate_sentences(result: GateResult) -> list[str]:
    """The outcome, and what is missing."""
    return [OUTCOMES[result.outcome], *(f"{sentence_case(reason.removesuffix('.'))}." for reason in result.missing)]


def intervals_words(rows: Sequence[Row], level: float) -> str:
    """How the intervals of a condition were made; empty where there are none."""
    made = [row for row in rows if row.resampled is not None and row.effect is not None]
    if not made:
        return ""
    return interval_text(level, str(made[0].resampled), [row.n_scenes for row in made])


_HEADINGS = ("statistic", "verdict", "change (interval)", "where", "scenes", "remark")
_NUMERIC = (False, False, True, False, True, False)
_GATE_HEADINGS = ("statistic", "outcome", "change (interval)", "tolerance", "remark")


def title_words(comparison: Comparison, *sides: RunSide) -> str:
    """Which runs, or trackers, are compared with which."""
    names = [comparison.names(side) for side in sides]
    return f"{listing(second for _, second in names)} compared with {names[0][0]}"


def verdict_cells(comparison: Comparison, side: RunSide) -> list[Cells]:
    """One table per condition: verdicts and effects of all statistics of a run.

    Parameters
    ----------
    comparison
        The comparison.
    side
        The run that is compared with the first.
    """
    tables = []
    for condition, intervals, shown in _by_condition(comparison.rows_of(side), comparison.level):
        title = ": ".join(filter(None, [title_words(comparison, side), condition]))
        common = common_reason(shown)
        about = "; ".join(filter(None, [intervals, common]))
        cells = [[*_cells(row), "" if common else row.why or ""] for row in shown]
        tables.append(Cells(f"{title} ({about})" if about else title, _HEADINGS, cells, _NUMERIC))
    return tables


def _by_condition(rows: Sequence[Row], level: float) -> list[tuple[str, str, list[Row]]]:
    """The rows of each condition, with its name and how its intervals were made; those that changed come first."""
    named = varying(rows)
    found = {of: [row for row in rows if row.of == of] for of in dict.fromkeys(row.of for row in rows)}
    first = sorted(found.items(), key=lambda pair: not any(row.verdict in _CHANGED for row in pair[1]))
    return [(condition_words(of, named), intervals_words(shown, level), shown) for of, shown in first]


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
    return ": ".join(filter(None, [row.of.run if "run" in named else "", condition_words(row.of, named)]))


WIDTH = 300.0
"""Length of the line, px."""
_INSET = 10.0
"""Room for the marks at both ends, px."""
_MOST_MARGINS = 20.0
"""Changes of so many margins lie at its ends, and larger ones are arrows there."""


@dataclass(frozen=True, slots=True)
class Mark:
    """A place on the line, px from its left end, and where the number lies if it is off the line."""

    place: float
    beyond: int  # -1 for further left, 1 for further right, 0 where the place is right


@dataclass(frozen=True, slots=True)
class Plot:
    """What is drawn along the line.

    Attributes
    ----------
    effect, low, high
        The effect and its interval; `low` is left of `high`.
    inner
        Bounds of the margin.
    scenes
        Effects of single scenes, with their names.
    """

    effect: Mark
    low: Mark
    high: Mark
    inner: tuple[float, float]
    scenes: tuple[tuple[str, Mark], ...]


def plot_of(row: Row) -> Plot | None:
    """Places of a row; None where it has no effect, interval or margin."""
    if row.effect is None or row.margin is None or (row.low is None and row.high is None):
        return None
    least = 0.0 if row.estimand.unit == Unit.ratio else -math.inf
    ends = (least if row.low is None else row.low, math.inf if row.high is None else row.high)
    low, high = sorted((_mark(row, row.margin, end) for end in ends), key=lambda mark: mark.place)
    scenes = tuple((name, _mark(row, row.margin, value)) for name, value in row.scenes.items())
    inner = (_mark_at(-1.0).place, _mark_at(1.0).place)
    return Plot(_mark(row, row.margin, row.effect), low, high, inner, scenes)


def _mark(row: Row, margin: float, value: float) -> Mark:
    sign = -1.0 if row.estimand.larger_is_better else 1.0
    if row.estimand.unit == Unit.ratio:
        return _mark_at(sign * (math.log(value) / math.log(margin) if value > 0 else -math.inf))
    return _mark_at(sign * value / margin)


def _mark_at(margins: float) -> Mark:
    """Place of a number of margins: the more of them, the closer they lie."""
    inside = max(-_MOST_MARGINS, min(_MOST_MARGINS, margins))
    share = math.copysign(math.log1p(abs(inside)) / math.log1p(_MOST_MARGINS), inside)
    return Mark(round(WIDTH / 2 + (WIDTH / 2 - _INSET) * share, 1), (margins > inside) - (margins < inside))


_SIGNS = re.compile(r"([\\`*_\[\]|~$])")
_LINKING = re.compile(r"[@#]|:(?=//)|\bwww(?=\.)|\b(?:mailto|xmpp):|\bGH-(?=\d)", re.IGNORECASE)
"""What makes a mention, a reference or a link of the text behind it, where Markdown is read as GitHub reads it."""
_NO_SPACE = "&#8203;"


def comparison_markdown(comparison: Comparison) -> str:
    """The outcome of the gate, conclusions, and one folded table per condition."""
    return "\n".join(_lines(comparison))


def _lines(comparison: Comparison) -> Iterator[str]:
    yield f"## {_escaped(title_words(comparison, *comparison.others))}"
    if comparison.gate is not None:
        outcome, *reasons = gate_sentences(comparison.gate)
        yield from ("", f"**{outcome}**", *(f"- {_escaped(reason)}" for reason in reasons))
    for sentence in comparison.conclusions:
        yield from ("", f"**{_escaped(sentence)}**")
    yield from [""] if comparison.gate is None else _table(gate_cells(comparison.gate))
    yield from (f"- {_escaped(doubt)}" for doubt in comparison.doubts)
    for side in comparison.others:
        if len(comparison.others) > 1:
            yield f"### {_escaped(side.name)}\n"
        yield from (f"- {_escaped(sentence)}" for sentence in change_sentences(comparison, side))
        for cells in verdict_cells(comparison, side):
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
        (
            comparison.names(side)[1] if len(comparison.others) > 1 else "What changed",
            side.notes,
            change_sentences(comparison, side),
            _by_condition(comparison.rows_of(side), comparison.level),
        )
        for side in comparison.others
    ]
    gate = None if comparison.gate is None else (gate_sentences(comparison.gate), gate_cells(comparison.gate))
    return template("compare.html.j2").render(
        comparison=comparison,
        title=title_words(comparison, *comparison.others),
        first=comparison.names(comparison.others[0])[0],
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
