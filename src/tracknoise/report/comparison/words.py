"""Effects, conditions and answers of a comparison in words."""

from collections.abc import Sequence
from dataclasses import fields

from tracknoise.findings.comparison.estimands import Estimand, Unit
from tracknoise.findings.comparison.result import Compared, Comparison, GateResult, GateRow, Row, place_words
from tracknoise.findings.wording import DASH, MINUS, SPACE, count, interval_text, listing, number, pixels, sentence_case
from tracknoise.tables.enumerations import ChangeVerdict

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
        if found:
            sentences.append(f"{sentence_case(verdict)}: {listing([*found[:_MOST_NAMED], *rest])}.")
    return sentences


def clearest(rows: Sequence[Row]) -> list[str]:
    """One sentence per statistic that is worse or better, with its effect; the worse ones first."""
    named = varying(rows)
    ordered = sorted(rows, key=lambda row: list(ChangeVerdict).index(row.verdict))
    return [
        f"{sentence_case(_named(row, named))} is {row.verdict}: {effect_words(row)}{_at(row)}."
        for row in ordered
        if row.verdict in (ChangeVerdict.worse, ChangeVerdict.better)
    ][:_MOST_NAMED]


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


def _at(row: Row) -> str:
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
    digits = f"{abs(value):.1f}" if abs(value) < 10 else f"{abs(value):.0f}"
    return _signed(digits, 0.0 if float(digits) == 0 else value)
