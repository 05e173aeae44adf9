"""What an audit says about each parameter."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.audit.assessment import ALPHA, MARGIN, POWER, Assessment
from tracknoise.audit.jackknife import condition_number
from tracknoise.audit.parameters import NUMBERS, Parameter
from tracknoise.audit.resampled_fit import ResampledFit
from tracknoise.audit.selection import Selection
from tracknoise.tables.audit_schema import AuditVerdict


@dataclass(frozen=True, slots=True)
class Judged:
    """The verdict on a parameter.

    Attributes
    ----------
    parameter, verdict
        Which, and what.
    rank
        Place among the named faults, from 1; None if it is not one.
    condition
        Condition number of the fit that shows what cannot be distinguished.
    visible_above : (k,) float64
        A change smaller than this would have been missed, of each component, in units of the fit.
    """

    parameter: Parameter
    verdict: AuditVerdict
    rank: int | None
    condition: float
    visible_above: NDArray[np.float64]


def judge(selection: Selection) -> list[Judged]:
    """Verdicts on all parameters: named faults first, in their order."""
    names = [one.parameter for one in selection.named]
    faults = [
        Judged(one.parameter, AuditVerdict.fault, rank, _condition(one.assessment), visible_above(one.assessment))
        for rank, one in enumerate(selection.named, start=1)
    ]
    return faults + [_judged(selection, name) for name in selection.beside_bias.assessed if name not in names]


def _judged(selection: Selection, name: Parameter) -> Judged:
    beside = selection.last.assessed[name]
    visible = visible_above(beside)
    if selection.last.is_significant(name):
        visible = np.maximum(visible, np.abs(beside.estimate))
    return Judged(name, _verdict(selection, name), None, _condition(beside), visible)


def _verdict(selection: Selection, name: Parameter) -> AuditVerdict:
    """Why a parameter is not a fault."""
    first, last = selection.beside_bias, selection.last
    if last.is_significant(name) and not last.assessed[name].is_agreed:
        return AuditVerdict.disagreement
    if last.passes(name):
        return AuditVerdict.fault
    if selection.named and first.passes(name):
        return AuditVerdict.explained
    if not selection.named and selection.alone.passes(name):
        return AuditVerdict.like_bias
    if last.is_significant(name):
        return AuditVerdict.small if last.assessed[name].is_small else AuditVerdict.undetermined
    return AuditVerdict.undetermined if _is_wide(last.assessed[name]) else AuditVerdict.none


def _is_wide(one: Assessment) -> bool:
    """Whether the data would not show a change worth correcting, or no change that is tried."""
    numbers = NUMBERS[one.parameter]
    largest = 1.0 if numbers.is_kind else numbers.furthest
    return bool(np.any(one.half_widths > numbers.plausible) or np.any(visible_above(one) > largest))


def visible_above(one: Assessment) -> NDArray[np.float64]:
    """Change of each component that would have been significant with a probability of 90 %, and explained enough.

    It is the largest of three: that of the test, that of the interval, and that by which the loss falls by `MARGIN`.
    """
    own = np.diag(np.linalg.inv(one.fitted.equations.information))[one.places]
    explaining = np.sqrt(MARGIN * float(one.tested.losses(one.scale).sum()) * own)
    tested = _significant_above(one.tested, one.places, ALPHA / len(Parameter))
    by_interval = _significant_above(one.resampled, one.places, ALPHA)
    return np.asarray(np.max([tested, by_interval, explaining], axis=0))


def _significant_above(found: ResampledFit, places: NDArray[np.intp], alpha: float) -> NDArray[np.float64]:
    """Size of each number at which a two-sided test at level alpha finds it with a probability of 90 %."""
    freedom = found.moves.freedom[places]
    reach = special.stdtrit(freedom, 1.0 - 0.5 * alpha) + special.stdtrit(freedom, POWER)
    return np.asarray(reach * found.moves.standard_errors[places])


def _condition(one: Assessment) -> float:
    return condition_number(one.fitted.equations)
