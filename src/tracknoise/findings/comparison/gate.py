"""A gate: tolerances for changes for the worse, and whether two runs are within them.

Each tolerance is tested in the direction of a change for the worse only:

- `worse`: the change exceeds the tolerance, at 1 - level after Holm's correction over all tolerances and conditions.
- `pass`: a change by the tolerance is excluded, at half of 1 - level.
- `undecided`: neither is shown. This is neither a pass nor a failure.

The gate passes if every row does, so that no correction is needed for a pass.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tracknoise.findings.comparison.asked import Asked, Tested
from tracknoise.findings.comparison.estimands import Unit
from tracknoise.findings.comparison.result import GateResult, GateRow
from tracknoise.findings.comparison.verdicts import UNSURE, described, straddles
from tracknoise.findings.sampling.multiplicity import holm
from tracknoise.tables.defaults import LEVEL
from tracknoise.tables.enumerations import ComparedAges

PASS, WORSE, UNDECIDED = "pass", "worse", "undecided"
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True)
class Gate:
    """What must not become worse.

    Attributes
    ----------
    tolerances
        Largest change for the worse, by statistic: relative for ratios, otherwise in px or as a share.
    trackers
        Names in the first run; None for all.
    speeds
        None for all.
    level
        One less the probability of a false answer.
    ages
        Whether every single age must pass, or their mean.
    """

    tolerances: Mapping[str, float]
    trackers: tuple[str, ...] | None = None
    speeds: tuple[int, ...] | None = None
    level: float = LEVEL
    ages: ComparedAges = ComparedAges.every

    def about(self, asked: Asked) -> bool:
        """Whether a question is one of the gate."""
        tracker = self.trackers is None or asked.of.tracker in self.trackers
        return tracker and asked.statistic in self.tolerances and (self.speeds is None or asked.of.speed in self.speeds)


def judge(gate: Gate, asked: Sequence[Asked], missing: Sequence[str] = ()) -> GateResult:
    """Apply a gate.

    Parameters
    ----------
    gate
        The tolerances.
    asked
        All questions of a comparison.
    missing
        Reasons why the comparison is incomplete.
    """
    chosen = [one for one in asked if gate.about(one)]
    tested = [one.tested(_margin(gate, one), level=gate.level, ages=gate.ages) for one in chosen]
    adjusted = holm([_p_worse(one, tests) for one, tests in zip(chosen, tested, strict=True)])
    rows = [_row(gate, one, tests, beyond) for one, tests, beyond in zip(chosen, tested, adjusted, strict=True)]
    lacking = [*missing, *_unanswered(gate, chosen)]
    return GateResult(_outcome(rows, lacking), tuple(rows), tuple(lacking))


def _margin(gate: Gate, asked: Asked) -> float:
    tolerance = gate.tolerances[asked.statistic]
    return float(np.log1p(tolerance)) if asked.estimand.unit == Unit.ratio else tolerance


def _p_worse(asked: Asked, tested: Tested) -> float | None:
    return None if tested.found is None else tested.found.sides[asked.worse].p_beyond


def _row(gate: Gate, asked: Asked, tested: Tested, beyond: float) -> GateRow:
    outcome, why = _answer(gate, asked, tested, beyond)
    columns = described(asked, tested)
    effect, low, high = (columns[name] for name in ("effect", "low", "high"))
    return GateRow(asked.of, asked.statistic, gate.tolerances[asked.statistic], outcome, why, effect, low, high)


def _answer(gate: Gate, asked: Asked, tested: Tested, beyond: float) -> tuple[str, str | None]:
    """Outcome of a row, and why it is undecided."""
    found = tested.found
    if found is None:
        return UNDECIDED, tested.gap
    if beyond <= 1 - gate.level + _ROUNDING:
        return WORSE, None
    if tested.gap is None and found.sides[asked.worse].p_within <= (1 - gate.level) / 2 + _ROUNDING:
        return PASS, None
    contains = straddles(found, _margin(gate, asked))
    return UNDECIDED, tested.gap or ("the interval contains the tolerance" if contains else UNSURE)


def _unanswered(gate: Gate, asked: Sequence[Asked]) -> list[str]:
    """What the gate names and the runs did not measure."""
    statistics = {one.statistic for one in asked}
    sentences = [f"{name} was not measured in both runs" for name in gate.tolerances if name not in statistics]
    trackers, speeds = {one.of.tracker for one in asked}, {one.of.speed for one in asked}
    sentences += [f"tracker {name} is not in both runs" for name in gate.trackers or () if name not in trackers]
    return sentences + [f"speed {speed} is not in both runs" for speed in gate.speeds or () if speed not in speeds]


def _outcome(rows: Sequence[GateRow], lacking: Sequence[str]) -> str:
    outcomes = {row.outcome for row in rows}
    if WORSE in outcomes:
        return WORSE
    return UNDECIDED if lacking or not rows or UNDECIDED in outcomes else PASS
