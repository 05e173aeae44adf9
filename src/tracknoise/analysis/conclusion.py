"""Which of two runs is better for what, in one sentence that follows from the verdicts of a comparison alone.

A statistic that is undecided is never called equal, and a condition is named only where not all have the same verdict.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import fields

from tracknoise.analysis.run_changes import Compared, GateRow, Row
from tracknoise.tables.enumerations import Axis, ChangeVerdict
from tracknoise.words import count, level_text, listing

_VERBS = ("is better for", "has")
"""What the words for a better run begin with."""
_FACTORS = ("tracker", "dataset", "lighting", "rotation", "direction", "camera", "speed")
_MOST_NAMED = 5
"""A sentence names so many statistics of one group of conditions."""
_MOST_LEVELS = 3
_AT_ONE = {Axis.age: "at single ages", Axis.frame: "at single frames", "window": "for single lengths of windows"}
"""Where a statistic changed whose mean over all places is not shown to have changed."""


def conclusion(names: tuple[str, str], rows: Sequence[Row]) -> str:
    """Say which run is better for what, or that none is shown to be.

    Parameters
    ----------
    names
        Of the first run and of the other.
    rows
        Of these two runs.
    """
    first, second = names
    sides = [
        (name, [row for row in rows if row.verdict == verdict])
        for name, verdict in ((second, ChangeVerdict.better), (first, ChangeVerdict.worse))
    ]
    ordered = sorted((side for side in sides if side[1]), key=lambda side: -len(side[1]))
    if not ordered:
        return _without_change(names, rows)
    said = [f"{name} {_advantages(found, rows)}" for name, found in ordered]
    return f"{'; '.join([*said, *_rest(rows)])}."


def _without_change(names: tuple[str, str], rows: Sequence[Row]) -> str:
    first, second = names
    n_open = sum(row.verdict == ChangeVerdict.undecided for row in rows)
    if not rows:
        return f"{first} and {second} have nothing in common that can be compared."
    if n_open == 0:
        return f"{first} and {second} are equal within the margin in {_counted(rows)}."
    if n_open < len(rows):
        rest = "; ".join(_rest(rows))
        return f"Neither {first} nor {second} is shown to be better: {rest}, the others are equal within the margin."
    why = common_reason(rows)
    because = f": {why}" if why else ""
    return f"Undecided: neither {first} nor {second} is shown to be better, nor are they shown to be equal{because}."


def _rest(rows: Sequence[Row]) -> Iterator[str]:
    """What is not better in either run."""
    n_open = sum(row.verdict == ChangeVerdict.undecided for row in rows)
    if n_open:
        yield f"{n_open} of {_counted(rows)} {'is' if n_open == 1 else 'are'} undecided"
    elif any(row.verdict == ChangeVerdict.none for row in rows):
        yield "all else is equal within the margin"


def _counted(rows: Sequence[Row]) -> str:
    return count(len(rows), "comparison" if len({row.of for row in rows}) > 1 else "statistic")


def common_reason(rows: Sequence[Row]) -> str:
    """The remark that all rows have, where there are several; else empty."""
    remarks = {row.why or "" for row in rows}
    return remarks.pop() if len(rows) > 1 and len(remarks) == 1 else ""


def varying(rows: Sequence[Row | GateRow]) -> list[str]:
    """Fields of the conditions that have several values."""
    names = [field.name for field in fields(Compared)]
    return [name for name in names if len({getattr(row.of, name) for row in rows}) > 1]


def condition_text(of: Compared, named: Collection[str]) -> str:
    """Write a condition by the fields of `named`, trackers and speeds among them: ``with patch at speed 4``."""
    return " ".join(_level(name, getattr(of, name)) for name in _FACTORS if name in named)


def _level(name: str, value: object) -> str:
    return f"with {value}" if name == "tracker" else level_text(name, str(value))


def _advantages(found: Sequence[Row], rows: Sequence[Row]) -> str:
    """What a run is good for, and what it has, by where.

    Parameters
    ----------
    found
        Rows in which it is better.
    rows
        All rows.
    """
    named = [row for row in found if not row.estimand.wording.is_secondary] or found
    by_place: dict[str, list[str]] = {}
    for estimand in {row.statistic: row.estimand for row in named}.values():
        where = _where([row for row in named if row.estimand == estimand], rows)
        by_place.setdefault(where, []).append(estimand.wording.better)
    parts = [f"{where} {_predicate(by_place[where])}".strip() for where in sorted(by_place, key=bool)]
    more = ["more in other conditions"] if len(parts) > _MOST_LEVELS else []
    return ", and ".join([*parts[:_MOST_LEVELS], *more])


def _predicate(phrases: Sequence[str]) -> str:
    """Join what is said of a run: ``is better for depths and has fewer outliers and longer tracks``."""
    parts = []
    for verb in _VERBS:
        things = [one.removeprefix(f"{verb} ") for one in phrases if one.startswith(f"{verb} ")]
        if len(things) > _MOST_NAMED:
            things[_MOST_NAMED - 1 :] = [f"{len(things) - _MOST_NAMED + 1} more advantages"]
        parts += [f"{verb} {listing(things)}"] if things else []
    return " and ".join(parts)


def _where(found: Sequence[Row], rows: Sequence[Row]) -> str:
    """The conditions, ages and frames of some rows; empty where these are all conditions, and means over the others."""
    one = next((row.axis for row in found if row.at is not None and row.at_low != row.at_high), None)
    return " ".join(filter(None, [_conditions({row.of for row in found}, rows), _AT_ONE.get(one or "")]))


def _conditions(found: Collection[Compared], rows: Sequence[Row]) -> str:
    """Some conditions, by the levels of one factor if that is possible; empty for all of them."""
    every, named = list(dict.fromkeys(row.of for row in rows)), varying(rows)
    if len(found) == len(every):
        return ""
    for name in [name for name in _FACTORS if name in named]:
        levels = dict.fromkeys(getattr(of, name) for of in every if of in found)
        if len(levels) <= _MOST_LEVELS and sum(getattr(of, name) in levels for of in every) == len(found):
            return listing(_level(name, level) for level in levels)
    if len(found) == 1:
        return condition_text(next(iter(found)), named)
    return f"in {len(found)} of {count(len(every), 'condition')}"
