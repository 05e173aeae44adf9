"""What an audit says about each parameter."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.audit.assessment import Assessment
from tracknoise.audit.jackknife import condition_number
from tracknoise.audit.parameters import NUMBERS, Parameter
from tracknoise.audit.selection import Selection
from tracknoise.audit.visible import visible_above
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
        Size of an error of each component of which 90 % would have been named, in units of the fit; or infinite.
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
    verdict = _verdict(selection, name, visible)
    if selection.last.is_significant(name):
        visible = np.maximum(visible, np.abs(beside.estimate))
    return Judged(name, verdict, None, _condition(beside), visible)


def _verdict(selection: Selection, name: Parameter, visible: NDArray[np.float64]) -> AuditVerdict:
    """Why a parameter is not a fault, given the errors that would have been seen."""
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
    return AuditVerdict.undetermined if _is_wide(last.assessed[name], visible) else AuditVerdict.none


def _is_wide(one: Assessment, visible: NDArray[np.float64]) -> bool:
    """Whether the data would not show a change worth correcting, or no change that is tried."""
    plausible = NUMBERS[one.parameter].plausible
    return bool(np.any(one.half_widths > plausible) or np.any(np.isinf(visible)))


def _condition(one: Assessment) -> float:
    return condition_number(one.fitted.equations)
