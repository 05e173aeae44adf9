"""How errors behave over time: a verdict from how their second moment grows, and the reason in words.

The verdict (behaviour) is the first of these that holds:

1. undecided: the tracks that live long have other errors than all tracks at the same age
   (`tracknoise.findings.growth.long_lived`). The loss of tracks then shapes the curve.
2. The polynomial of (growth) is not refused by the curve or by the autocorrelations
   (`tracknoise.findings.growth.agreement`): the term whose share of the fitted second moment is above a half, and whose
   size is above zero, with all of their intervals. Where there is none, undecided.
3. The model of (saturating) is not refused: saturating, or white, in the same way. The time constant must be known.
4. none: none of the models fits.

What each means:

- white: the error is as large in the first frame after birth as later. Errors that are independent from frame to frame
  are white, and so is a constant offset. The autocorrelation of changes at one step distinguishes them: it is -1/2 for
  independent errors, and near 0 for an offset.
- random walk: small errors, independent of each other, add up.
- drift: errors grow in proportion to time, whether all tracks drift the same way, so that the mean error grows, or each
  its own.
- saturating: errors grow like a random walk at first, but something pulls them back, so that they stay within a limit.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_as, format_estimate
from tracknoise.findings.growth.agreement import Agreement
from tracknoise.findings.growth.long_lived import Loss
from tracknoise.findings.growth.models import Model
from tracknoise.findings.wording import SPACE, number, percent
from tracknoise.tables.enumerations import Behaviour

MAJORITY = 0.5
_BEHAVIOURS: Mapping[str, Behaviour] = {
    "white": Behaviour.white,
    "walk": Behaviour.random_walk,
    "drift": Behaviour.drift,
    "saturating": Behaviour.saturating,
}
_INDEPENDENT = -0.25
"""Half way between the autocorrelations of independent errors and of a constant offset."""
_BESIDES = {
    "white": "a constant part",
    "walk": "a random walk",
    "drift": "a drift",
    "saturating": "a saturating part",
}


@dataclass(frozen=True, slots=True)
class Growth:
    """What the verdict is made from.

    Attributes
    ----------
    sizes
        By term, of all errors together: white, saturating_white and saturating (px), walk (px per sqrt(frame)), drift
        (px per frame), and time_constant (frames). Those of (saturating) are there where it was fitted.
    geometric
        Of the terms of the polynomial: geometric means over scenes.
    polynomial, saturating
        The models; the latter where the polynomial is refused.
    loss
        How long-lived tracks differ from all; None where unknown.
    longest
        Frames over which the fit goes.
    """

    sizes: Mapping[str, Estimate]
    geometric: Mapping[str, Estimate]
    polynomial: Model
    saturating: Model | None
    loss: Loss | None
    longest: float


@dataclass(frozen=True, slots=True)
class Changes:
    """Changes of errors of one coordinate.

    Attributes
    ----------
    autocorrelation
        At one step; None where there are none.
    mean_px_per_frame
        Mean change per frame of the sequence; None where unknown.
    """

    autocorrelation: Estimate | None
    mean_px_per_frame: float | None


def behaves(growth: Growth, changes: Changes) -> tuple[Behaviour, str]:
    """Verdict by (behaviour), and the reason in words.

    Parameters
    ----------
    growth, changes
        Of one condition, trimming and coordinate.
    """
    if growth.loss is not None and growth.loss.refused:
        return Behaviour.undecided, _lost(growth.loss)
    if not growth.polynomial.agreement.refused:
        return _dominated(growth.sizes, changes, growth.polynomial)
    if growth.saturating is None or growth.saturating.agreement.refused:
        return Behaviour.none, f"none of the models fits: {_missed(growth.polynomial.agreement)}"
    constant = growth.sizes["time_constant"]
    if not constant.below(growth.longest):
        seen = f"the time constant is {format_estimate(constant)}, and ages are up to {number(int(growth.longest))}"
        return Behaviour.undecided, f"errors grow more slowly than a random walk, but not how: {seen}"
    sizes = {**growth.sizes, "white": growth.sizes["saturating_white"]}
    return _dominated(sizes, changes, growth.saturating)


def _dominated(sizes: Mapping[str, Estimate], changes: Changes, model: Model) -> tuple[Behaviour, str]:
    """The term that dominates a model."""
    terms = list(model.shares)
    for term in terms:
        if model.shares[term].above(MAJORITY) and sizes[term].above(0.0):
            besides = [other for other in terms if other != term and sizes[other].above(0.0)]
            others = [f"; also {_BESIDES[other]} of {format_estimate(sizes[other])}" for other in besides]
            return _BEHAVIOURS[term], _reason(sizes, changes, term, mostly=bool(besides)) + "".join(others)
    shares = ", ".join(f"{_BEHAVIOURS[term]} {format_as(model.shares[term], percent)}" for term in terms)
    return Behaviour.undecided, f"the intervals do not show which term dominates the second moment: {shares}"


def _lost(loss: Loss) -> str:
    less = "smaller" if loss.excess < 0 else "larger"
    return (
        f"the loss of tracks shapes the curve: tracks seen at age {loss.at_least} or later have a second moment "
        f"{percent(abs(loss.excess))} {less} than all tracks at the same ages"
    )


def _missed(agreement: Agreement) -> str:
    """What a model misses most."""
    parts = []
    if agreement.misses_curve:
        parts.append(f"the second moment is missed by {percent(agreement.misfit)}")
    if agreement.misses_lags:
        place = agreement.lag - 1
        measured, predicted = (float(values[place]) for values in (agreement.measured, agreement.predicted))
        parts.append(
            f"the autocorrelation of changes at lag {agreement.lag} is {_two(measured)}, and {_two(predicted)} was "
            "predicted"
        )
    return "; ".join(parts)


def _reason(sizes: Mapping[str, Estimate], changes: Changes, term: str, *, mostly: bool) -> str:
    if term == "white":
        return _white(sizes["white"], changes.autocorrelation, mostly=mostly)
    reason = f"{_BEHAVIOURS[term]}: {format_estimate(sizes[term])}"
    if term == "saturating":
        return f"{reason} with a time constant of {format_estimate(sizes['time_constant'])}"
    if term == "drift" and changes.mean_px_per_frame is not None:
        return f"{reason}; the mean changes by {number(changes.mean_px_per_frame)}{SPACE}px per frame"
    return reason


def _white(size: Estimate, related: Estimate | None, *, mostly: bool) -> str:
    reason = f"{'mostly ' if mostly else ''}constant: {format_estimate(size)}"
    if related is not None and related.below(_INDEPENDENT):
        return f"{reason}, independent from frame to frame"
    if related is not None and related.above(_INDEPENDENT):
        return f"{reason}, mostly the same offset from frame to frame"
    return reason


def _two(value: float) -> str:
    return format_as(Estimate(value), lambda given: f"{given:.2f}".replace("-", "\N{MINUS SIGN}"))
