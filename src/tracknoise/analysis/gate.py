"""The verdicts of a comparison of runs, and whether changes for the worse pass a gate of tolerances.

Statistics form families, each with the whole level: sizes (core, second moment and sigma for depths), ends of tracks
(lifetime and outlier ratio), and the others.

- `worse` or `better`: the p-value is at most 1 - level after Holm's correction over all rows of the family. The
  probability of any false claim in a family is then at most 1 - level, and what else is compared does not count.
- `no difference`: a change by the margin is excluded in both directions, at half of 1 - level and by Benjamini and
  Hochberg over all rows of the same statistic.
- `undecided`: all other cases.

A gate tests each tolerance in the direction of a change for the worse only:

- `worse`: the change exceeds the tolerance, at 1 - level after Holm's correction over all tolerances and conditions.
- `pass`: a change by the tolerance is excluded, at half of 1 - level.
- `undecided`: neither is shown. This is neither a pass nor a failure.

The gate passes if every row does, so that no correction is needed for a pass.
"""

import json
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.analysis.factors import family
from tracknoise.analysis.paired_tests import Change, Unit, decided, is_below, is_beyond, mean_of_points, why_open
from tracknoise.analysis.run_changes import (
    ESTIMANDS,
    Asked,
    Compared,
    Comparison,
    GateResult,
    GateRow,
    Row,
    Tested,
    place_words,
)
from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.multiple_tests import benjamini_hochberg, holm, in_families
from tracknoise.tables.defaults import MARGIN
from tracknoise.tables.enumerations import ChangeVerdict, ComparedAges
from tracknoise.tables.schema import VIEW
from tracknoise.words import condition_name

UNSURE = "a larger change cannot be excluded at each age and coordinate"
"""Why an answer about several ages or coordinates is undecided."""


def verdicts(
    asked: Sequence[Asked], *, margin: float = MARGIN, level: float = LEVEL, ages: ComparedAges = ComparedAges.every
) -> list[Row]:
    """One row per question, in their order.

    Parameters
    ----------
    asked
        All questions of a comparison.
    margin
        Largest relative change that counts as no difference: 0.1 for ratios of 1.1, for mean errors 10 % of the core,
        and for shares 0.02.
    level
        Probability that an interval contains the true change; any false claim in a family has a probability of at most
        1 - level.
    ages
        Whether single ages are tested besides their mean.
    """
    margins = [one.estimand.unit.margin(margin, one.values.scale_px) for one in asked]
    tested = [one.tested(limit, level=level, ages=ages) for one, limit in zip(asked, margins, strict=True)]
    p_change = [None if one.found is None else one.found.p_change for one in tested]
    p_none = [None if one.found is None else one.found.p_none for one in tested]
    statistics = [one.statistic for one in asked]
    adjusted = in_families(holm, p_change, [family(name) for name in statistics])
    q_none = in_families(benjamini_hochberg, p_none, statistics)
    rows = []
    for place, (one, tests) in enumerate(zip(asked, tested, strict=True)):
        verdict, why = _verdict(one, tests, margins[place], adjusted[place], q_none[place], level)
        numbers: dict[str, Any] = {
            "margin": known(one.estimand.unit.of(margins[place])),
            "p_change": p_change[place],
            "p_adjusted": known(adjusted[place]),
            "p_none": p_none[place],
        }
        rows.append(Row(one.of, one.statistic, verdict, why, **numbers, **described(one, tests)))
    return rows


def described(asked: Asked, tested: Tested) -> dict[str, Any]:
    """Columns of a row that do not depend on the verdict."""
    values = asked.values
    columns: dict[str, Any] = dict.fromkeys(("effect", "low", "high", "coordinate", "at_low", "at_high"))
    found = _untested(asked) if tested.found is None else _tested(asked, tested.found)
    return {
        **columns,
        "at": values.place(0) if values.values.shape[2] == 1 else None,  # a single value is not a mean over places
        **found,
        "axis": asked.axis,
        "horizon": known(values.horizon[0]),
        "n_scenes": asked.n_scenes,
        "resampled": None if tested.resampled is None else str(tested.resampled),
    }


def _tested(asked: Asked, found: Change) -> dict[str, Any]:
    """Effect, interval and place of a change that was tested."""
    values, columns = asked.values, {}
    places = [values.place(int(point)) for point in np.flatnonzero(found.compared)]
    if found.point is not None:
        columns = {"at": values.place(found.point), "coordinate": values.coordinate(found.point)}
    elif found.coordinate is not None:
        columns = {"coordinate": values.coordinate(found.coordinate)}
    second, first = values.scarce[0]
    unbounded = {"high": None} if first and found.effect > 0 else {"low": None} if second and found.effect < 0 else {}
    return {
        **{name: known(asked.estimand.unit.of(getattr(found, name))) for name in ("effect", "low", "high")},
        **unbounded,
        **columns,
        "at_low": places[0],
        "at_high": places[-1],
        "scenes": _by_scene(asked, found.scenes),
    }


def _untested(asked: Asked) -> dict[str, Any]:
    """Mean change where scenes are too few for a test, without an interval; of mean errors, none."""
    change = asked.values.values[:, 0]
    scenes = mean_of_points(change, np.ones(change.shape[1], dtype=np.bool_))
    there = scenes[~np.isnan(scenes)]
    if asked.values.total is not None or not len(there):
        return {"scenes": {}}
    return {"effect": known(asked.estimand.unit.of(float(there.mean()))), "scenes": _by_scene(asked, scenes)}


def _by_scene(asked: Asked, changes: NDArray[np.float64]) -> dict[str, float]:
    """Changes in the unit of the statistic, of scenes that have one."""
    pairs = zip(asked.scenes, changes, strict=True)
    return {name: asked.estimand.unit.of(float(change)) for name, change in pairs if not np.isnan(change)}


def known(value: float) -> float | None:
    """A finite number; None for others."""
    return float(value) if np.isfinite(value) else None


def _verdict(
    asked: Asked, tested: Tested, margin: float, adjusted: float, q_none: float, level: float
) -> tuple[ChangeVerdict, str | None]:
    found, gap = tested.found, tested.gap
    if found is None:
        return ChangeVerdict.undecided, gap
    is_shown = decided(found.p_none, adjusted, q_none, level, has_gap=gap is not None)
    if is_shown:
        verdict = ChangeVerdict.worse if found.direction == asked.worse else ChangeVerdict.better
        return verdict, _contrary(asked, found, level)
    if is_shown is not None:
        return ChangeVerdict.none, None
    contains = found.straddles(margin)
    why = why_open(found.p_change, found.p_none, level, contains=contains, otherwise=UNSURE)
    return ChangeVerdict.undecided, gap or why


def _contrary(asked: Asked, found: Change, level: float) -> str | None:
    """A remark where single ages changed in the other direction."""
    other = found.sides[-found.direction]
    if other.p_beyond > 1 - level or other.point is None:
        return None
    at = asked.values.place(other.point)
    where = "elsewhere" if asked.axis is None or at is None else place_words(asked.axis, at)
    return f"the change has the opposite sign {where}"


PASS, WORSE, UNDECIDED = "pass", "worse", "undecided"


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
    poses
        Which poses have to lead in all runs: refined or stated; None for any.
    """

    tolerances: Mapping[str, float]
    trackers: tuple[str, ...] | None = None
    speeds: tuple[int, ...] | None = None
    level: float = LEVEL
    ages: ComparedAges = ComparedAges.every
    poses: str | None = None

    def covers(self, of: Compared) -> bool:
        """Whether a condition is one of the gate."""
        return (self.trackers is None or of.tracker in self.trackers) and (
            self.speeds is None or of.speed in self.speeds
        )

    def about(self, asked: Asked) -> bool:
        """Whether a question is one of the gate."""
        return asked.statistic in self.tolerances and self.covers(asked.of)


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
    chosen = [one for one in asked if gate.about(one)]
    tested = [one.tested(_margin(gate, one), level=gate.level, ages=gate.ages) for one in chosen]
    adjusted = holm([_p_worse(one, tests) for one, tests in zip(chosen, tested, strict=True)])
    rows = [_row(gate, one, tests, beyond) for one, tests, beyond in zip(chosen, tested, adjusted, strict=True)]
    lacking = [*missing, *_unanswered(gate, [one for one in asked if gate.covers(one.of)], expected)]
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
    if is_beyond(beyond, gate.level):
        return WORSE, None
    if tested.gap is None and is_below(found.sides[asked.worse].p_within, gate.level):
        return PASS, None
    contains = found.straddles(_margin(gate, asked))
    return UNDECIDED, tested.gap or ("the interval contains the tolerance" if contains else UNSURE)


def _unanswered(gate: Gate, asked: Sequence[Asked], expected: Sequence[Compared]) -> Iterator[str]:
    """What the gate is about and the runs do not share; of several runs, with the name of the one."""
    known = [*expected, *(one.of for one in asked)]
    runs = list(dict.fromkeys(one.run for one in known))
    for run in runs:
        wanted = list(dict.fromkeys(one for one in known if one.run == run and gate.covers(one)))
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
        without = [named for one, named in _names(measured).items() if name not in measured[one]]
        if len(without) == len(measured):
            yield f"{name} was not measured in both runs"
        else:
            yield from (f"{name} of {named} was not measured in both runs" for named in without)


def _names(conditions: Iterable[Compared]) -> dict[Compared, str]:
    """Names of conditions, with the parts of the view of which there are several."""
    known = list(conditions)
    several = [name for name in VIEW if len({getattr(one, name) for one in known}) > 1]
    return {one: condition_name({name: getattr(one, name) for name in ("tracker", "speed", *several)}) for one in known}


def _outcome(rows: Sequence[GateRow], lacking: Sequence[str]) -> str:
    outcomes = {row.outcome for row in rows}
    if WORSE in outcomes:
        return WORSE
    return UNDECIDED if lacking or not rows or UNDECIDED in outcomes else PASS


FORMAT = 1


def comparison_json(comparison: Comparison) -> str:
    """Write a comparison.

    Returns
    -------
    str
        An object with `format`, the fields of `Comparison`, and `estimands`: title, meaning and unit of every statistic
        that occurs. What is missing is null.
    """
    statistics = {row.statistic for row in comparison.rows}
    estimands = {name: asdict(estimand) for name, estimand in ESTIMANDS.items() if name in statistics}
    document: dict[str, Any] = {"format": FORMAT, **asdict(comparison), "estimands": estimands}
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
