"""Whether changes for the worse pass a gate of tolerances, and files of such gates.

A gate tests each tolerance in the direction of a change for the worse only:

- `worse`: the change exceeds the tolerance, at 1 - level after Holm's correction over all tolerances and conditions.
- `pass`: a change by the tolerance is excluded, at half of 1 - level.
- `undecided`: neither is shown. This is neither a pass nor a failure.

The gate passes if every row does, so that no correction is needed for a pass.
"""

from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tracknoise.analysis.paired_tests import Unit, is_below, is_beyond
from tracknoise.analysis.run_changes import UNSURE, Asked, Compared, GateResult, GateRow, Tested
from tracknoise.exceptions import DataError, SettingsError, UnknownNameError
from tracknoise.foreign_files import MIB, read_text
from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.multiple_tests import holm
from tracknoise.tables.enumerations import ComparedAges
from tracknoise.tables.manifest import LEADING
from tracknoise.tables.schema import VIEW
from tracknoise.text import parse_toml
from tracknoise.words import condition_name

PASS, WORSE, UNDECIDED = "pass", "worse", "undecided"


@dataclass(frozen=True, slots=True)
class Gate:
    """What must not become worse."""

    tolerances: Mapping[str, float]  # largest change for the worse: relative for ratios, otherwise in px or as a share
    trackers: tuple[str, ...] | None = None  # names in the first run; None for all
    speeds: tuple[int, ...] | None = None  # None for all
    level: float = LEVEL  # one less the probability of a false answer
    ages: ComparedAges = ComparedAges.every  # whether every single age must pass, or their mean
    poses: str | None = None  # which have to lead in all runs: refined or stated; None for any

    def covers(self, of: Compared) -> bool:
        """Whether a condition is one of the gate."""
        return (self.trackers is None or of.tracker in self.trackers) and (
            self.speeds is None or of.speed in self.speeds
        )

    def about(self, asked: Asked) -> bool:
        """Whether a question is one of the gate."""
        return asked.statistic in self.tolerances and self.covers(asked.of)

    def margin(self, asked: Asked) -> float:
        """Tolerance of a question: of logarithms for ratios."""
        tolerance = self.tolerances[asked.statistic]
        return float(np.log1p(tolerance)) if asked.estimand.unit == Unit.ratio else tolerance


def judge(
    gate: Gate, asked: Sequence[Asked], missing: Sequence[str] = (), expected: Sequence[Compared] = ()
) -> GateResult:
    """Apply a gate.

    Parameters
    ----------
    gate
        The tolerances.
    asked
        All questions of a comparison.
    missing
        Reasons why the comparison is incomplete.
    expected
        Conditions that the first run measured, so that the others have to.
    """
    chosen = [question for question in asked if gate.about(question)]
    tested = [question.tested(gate.margin(question), level=gate.level, ages=gate.ages) for question in chosen]
    p_worse = [
        None if question.change is None else question.change.sides[question.asked.worse].p_beyond for question in tested
    ]
    rows = [_row(gate, question, beyond) for question, beyond in zip(tested, holm(p_worse), strict=True)]
    lacking = [*missing, *_unanswered(gate, [question for question in asked if gate.covers(question.of)], expected)]
    return GateResult(_outcome(rows, lacking), tuple(rows), tuple(lacking))


def _row(gate: Gate, tested: Tested, beyond: float) -> GateRow:
    asked, columns = tested.asked, tested.columns()
    outcome, why = _answer(gate, tested, beyond)
    effect, low, high = (columns[name] for name in ("effect", "low", "high"))
    return GateRow(asked.of, asked.estimand, gate.tolerances[asked.statistic], outcome, why, effect, low, high)


def _answer(gate: Gate, tested: Tested, beyond: float) -> tuple[str, str | None]:
    """Outcome of a row, and why it is undecided. `beyond`: adjusted p-value of a change for the worse."""
    tests = tested.change
    if tests is None:
        return UNDECIDED, tested.gap
    if is_beyond(beyond, gate.level):
        return WORSE, None
    gap = tested.gap or tested.asked.hides_worse
    if gap is None and is_below(tests.sides[tested.asked.worse].p_within, gate.level):
        return PASS, tested.asked.until
    contains = tests.straddles(gate.margin(tested.asked))
    return UNDECIDED, gap or ("the interval contains the tolerance" if contains else UNSURE)


def _unanswered(gate: Gate, asked: Sequence[Asked], expected: Sequence[Compared]) -> Iterator[str]:
    """What the gate is about and the runs do not share; of several runs, with the name of the one."""
    conditions = [*expected, *(one.of for one in asked)]
    runs = list(dict.fromkeys(one.run for one in conditions))
    for run in runs:
        wanted = list(dict.fromkeys(one for one in conditions if one.run == run and gate.covers(one)))
        measured = {one: {ask.statistic for ask in asked if ask.of == one} for one in wanted}
        measured = {one: found for one, found in measured.items() if found}
        ending = f" ({run})" if len(runs) > 1 else ""
        for sentence in (*_unshared(gate, wanted, measured), *_unmeasured(gate, measured)):
            yield f"{sentence}{ending}"


def _unshared(gate: Gate, wanted: Sequence[Compared], measured: Container[Compared]) -> Iterator[str]:
    """Trackers, speeds and other conditions that two runs do not share."""
    there = [one for one in wanted if one in measured]
    trackers, speeds = {one.tracker for one in there}, {one.speed for one in there}
    for name in gate.trackers or sorted({one.tracker for one in wanted}):
        if name not in trackers:
            yield f"tracker {name} is not in both runs"
    for speed in gate.speeds or sorted({one.speed for one in wanted}):
        if speed not in speeds:
            yield f"speed {speed} is not in both runs"
    for one, named in _names(wanted).items():
        if one not in measured and one.tracker in trackers and one.speed in speeds:
            yield f"{named} is not in both runs"


def _unmeasured(gate: Gate, measured: Mapping[Compared, Container[str]]) -> Iterator[str]:
    """Statistics of shared conditions that were not measured in both runs."""
    for name in gate.tolerances:
        without = [named for condition, named in _names(measured).items() if name not in measured[condition]]
        if len(without) == len(measured):
            yield f"{name} was not measured in both runs"
        else:
            yield from (f"{name} of {named} was not measured in both runs" for named in without)


def _names(conditions: Iterable[Compared]) -> dict[Compared, str]:
    """Names of conditions, with the parts of the view of which there are several."""
    listed = list(conditions)
    several = [name for name in VIEW if len({getattr(condition, name) for condition in listed}) > 1]
    return {
        condition: condition_name({name: getattr(condition, name) for name in ("tracker", "speed", *several)})
        for condition in listed
    }


def _outcome(rows: Sequence[GateRow], lacking: Sequence[str]) -> str:
    outcomes = {row.outcome for row in rows}
    if WORSE in outcomes:
        return WORSE
    return UNDECIDED if lacking or not rows or UNDECIDED in outcomes else PASS


_MOST = 1000
"""Largest tolerance."""
_RENAMED = {
    "window_sigma": "residual_sigma, its name now, or consistent_sigma, which makes depths of points right",
}
"""Former names of statistics, and what to write instead."""


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_list_of(kind: type) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, list) and bool(value) and all(type(item) is kind for item in value)


_KEYS: Mapping[str, tuple[str, Callable[[Any], bool], Callable[[Any], Any]]] = {
    "trackers": ("a list of names", _is_list_of(str), tuple),
    "speeds": ("a list of whole numbers", _is_list_of(int), tuple),
    "level": ("a number from 0.5 to 0.99", lambda value: _is_number(value) and 0.5 <= value <= 0.99, float),
    "ages": (f"one of {', '.join(ComparedAges)}", lambda value: value in list(ComparedAges), ComparedAges),
    "poses": (f"one of {', '.join(LEADING)}", lambda value: value in LEADING, str),
}
"""What else a gate may have: expected values, whether one is right, and how `Gate` has it."""


def read_gate(path: Path, statistics: Collection[str]) -> Gate:
    """Read and check a gate.

    Parameters
    ----------
    path
        A TOML file with a table ``tolerances``, and optionally ``trackers``, ``speeds``, ``level``, ``ages`` and
        ``poses``.
    statistics
        Names that may have a tolerance.

    Raises
    ------
    SettingsError, UnknownNameError
        If it cannot be read, or a key or value is wrong.
    """
    content = dict(_loaded(path))
    if misplaced := [name for name in content if name in statistics]:
        raise SettingsError(f"{path}: {misplaced[0]}: found outside of a table, expected it below a line [tolerances]")
    tolerances = _tolerances(path, content.pop("tolerances", {}), statistics)
    for key, value in content.items():
        if key not in _KEYS:
            raise UnknownNameError(f"key in {path}", key, ("tolerances", *_KEYS))
        expected, is_right, _ = _KEYS[key]
        if not is_right(value):
            raise SettingsError(f"{path}: {key}: found {value!r}, expected {expected}")
    return Gate(tolerances, **{key: _KEYS[key][-1](value) for key, value in content.items()})


def _loaded(path: Path) -> Mapping[str, Any]:
    try:
        return parse_toml(read_text(path, "a file of tolerances", most=MIB))
    except DataError as error:
        raise SettingsError(f"{path}: cannot be read ({error.found}), expected TOML with tolerances") from error
    except ValueError as error:
        problem, _, expected = str(error).partition(", expected ")
        kind = f"TOML with {expected}" if expected not in ("", "TOML") else "TOML"
        raise SettingsError(f"{path}: {problem}, expected {kind}") from error


def _tolerances(path: Path, given: object, statistics: Collection[str]) -> dict[str, float]:
    if not isinstance(given, dict) or not given:
        raise SettingsError(f"{path}: tolerances: found {given!r}, expected a table with at least one statistic")
    for name, value in given.items():
        if name in _RENAMED:
            raise SettingsError(f"{path}: tolerances: found the former name {name!r}, expected {_RENAMED[name]}")
        if name not in statistics:
            raise UnknownNameError(f"statistic in {path}", name, statistics)
        if not _is_number(value) or not 0 < value <= _MOST:
            raise SettingsError(f"{path}: tolerances.{name}: found {value!r}, expected more than 0, at most {_MOST}")
    return {name: float(value) for name, value in given.items()}
