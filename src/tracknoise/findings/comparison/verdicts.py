"""Verdicts of a comparison: worse, better, no difference or undecided, for all statistics together.

A statistic is `worse` or `better` if its p-value is at most 1 - level after Holm's correction over all rows. The
probability of any false claim in the whole comparison is then at most 1 - level. It has `no difference` if a change by
the margin is excluded in both directions, at half of 1 - level and by Benjamini and Hochberg over all rows. Otherwise
it is `undecided`.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.comparison.asked import Asked, Tested
from tracknoise.findings.comparison.change import Change, mean_of_points
from tracknoise.findings.comparison.estimands import Unit
from tracknoise.findings.comparison.result import Row, place_words
from tracknoise.findings.sampling.multiplicity import benjamini_hochberg, holm
from tracknoise.tables.defaults import LEVEL, MARGIN
from tracknoise.tables.enumerations import ChangeVerdict, ComparedAges

SHARE_MARGIN = 0.2
"""Margin of differences of shares, relative to that of ratios: 0.02 where ratios have 0.1."""
UNSURE = "a larger change cannot be excluded at each age and coordinate"
"""Why an answer about several ages or coordinates is undecided."""
_ROUNDING = 1e-12


def verdicts(
    asked: Sequence[Asked],
    *,
    margin: float = MARGIN,
    level: float = LEVEL,
    ages: ComparedAges = ComparedAges.every,
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
        Probability that an interval contains the true change; any false claim has a probability of at most 1 - level.
    ages
        Whether single ages are tested besides their mean.
    """
    margins = [margin_of(one, margin) for one in asked]
    tested = [one.tested(limit, level=level, ages=ages) for one, limit in zip(asked, margins, strict=True)]
    p_change = [None if one.found is None else one.found.p_change for one in tested]
    p_none = [None if one.found is None else one.found.p_none for one in tested]
    adjusted, q_none = holm(p_change), benjamini_hochberg(p_none)
    rows = []
    for place, (one, tests) in enumerate(zip(asked, tested, strict=True)):
        verdict, why = _verdict(one, tests, margins[place], adjusted[place], q_none[place], level)
        numbers: dict[str, Any] = {
            "margin": known(one.in_unit(margins[place])),
            "p_change": p_change[place],
            "p_adjusted": known(adjusted[place]),
            "p_none": p_none[place],
        }
        rows.append(Row(one.of, one.statistic, verdict, why, **numbers, **described(one, tests)))
    return rows


def margin_of(asked: Asked, margin: float) -> float:
    """Margin of a question: of logarithms for ratios, a share of the core for px; NaN where it is unknown."""
    if asked.estimand.unit == Unit.ratio:
        return float(np.log1p(margin))
    if asked.estimand.unit == Unit.share:
        return SHARE_MARGIN * margin
    return margin * (np.nan if asked.values.scale_px is None else asked.values.scale_px)


def described(asked: Asked, tested: Tested) -> dict[str, Any]:
    """Columns of a row that do not depend on the verdict."""
    values = asked.values
    columns: dict[str, Any] = dict.fromkeys(("effect", "low", "high", "coordinate", "at_low", "at_high"))
    found = _untested(asked) if tested.found is None else _tested(asked, tested.found)
    return {
        **columns,
        "at": values.place(0) if values.change.shape[1] == 1 else None,  # a single value is not a mean over places
        **found,
        "axis": asked.axis,
        "horizon": values.horizon,
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
    first, second = values.scarce
    unbounded = {"high": None} if first and found.effect > 0 else {"low": None} if second and found.effect < 0 else {}
    return {
        **{name: known(asked.in_unit(getattr(found, name))) for name in ("effect", "low", "high")},
        **unbounded,
        **columns,
        "at_low": places[0],
        "at_high": places[-1],
        "scenes": _by_scene(asked, found.scenes),
    }


def _untested(asked: Asked) -> dict[str, Any]:
    """Mean change where scenes are too few for a test, without an interval; of mean errors, none."""
    change = asked.values.change
    scenes = mean_of_points(change, np.ones(change.shape[1], dtype=np.bool_))
    there = scenes[~np.isnan(scenes)]
    if asked.values.total is not None or not len(there):
        return {"scenes": {}}
    return {"effect": known(asked.in_unit(float(there.mean()))), "scenes": _by_scene(asked, scenes)}


def _by_scene(asked: Asked, changes: NDArray[np.float64]) -> dict[str, float]:
    """Changes in the unit of the statistic, of scenes that have one."""
    pairs = zip(asked.scenes, changes, strict=True)
    return {name: asked.in_unit(float(change)) for name, change in pairs if not np.isnan(change)}


def straddles(found: Change, margin: float) -> bool:
    """Whether the interval contains the margin of either direction."""
    return found.low <= margin <= found.high or found.low <= -margin <= found.high


def known(value: float) -> float | None:
    """A finite number; None for others."""
    return float(value) if np.isfinite(value) else None


def _verdict(
    asked: Asked, tested: Tested, margin: float, adjusted: float, q_none: float, level: float
) -> tuple[ChangeVerdict, str | None]:
    found, largest = tested.found, 1 - level + _ROUNDING
    if found is None:
        return ChangeVerdict.undecided, tested.gap
    if adjusted <= largest:
        verdict = ChangeVerdict.worse if found.direction == asked.worse else ChangeVerdict.better
        return verdict, _contrary(asked, found, level)
    if tested.gap is None and found.p_none <= (1 - level) / 2 + _ROUNDING and q_none <= largest:
        return ChangeVerdict.none, None
    return ChangeVerdict.undecided, tested.gap or _open(found, margin, level)


def _contrary(asked: Asked, found: Change, level: float) -> str | None:
    """A remark where single ages changed in the other direction."""
    other = found.sides[-found.direction]
    if other.p_beyond > 1 - level or other.point is None:
        return None
    at = asked.values.place(other.point)
    where = "elsewhere" if asked.axis is None or at is None else place_words(asked.axis, at)
    return f"the change has the opposite sign {where}"


def _open(found: Change, margin: float, level: float) -> str:
    """Why an answer is undecided although there are enough scenes."""
    if found.p_change <= 1 - level or found.p_none <= (1 - level) / 2:
        return "not significant after the correction for multiple tests"
    return "the interval contains the margin" if straddles(found, margin) else UNSURE
