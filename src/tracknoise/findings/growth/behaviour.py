"""How errors behave over time: a verdict from how their second moment grows, and the reason in words.

The verdict (behaviour) is `none` where (growth) misses the second moment by a quarter of it or more: it is then neither
constant nor does it grow as any of the three terms. Otherwise the verdict is the term whose share of the fitted second
moment is above a half, and whose size is above zero, with all of their intervals. Otherwise it is `undecided`.

What each means:

- white: the error is as large in the first frame after birth as later. Errors that are independent from frame to frame
  are white, and so is a constant offset. The autocorrelation of changes at one step distinguishes them: it is -1/2 for
  independent errors, and near 0 for an offset.
- random walk: small errors, independent of each other, add up.
- drift: errors grow in proportion to time, whether all tracks drift the same way, so that the mean error grows, or each
  its own.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_as, format_estimate
from tracknoise.findings.growth.fit import TERMS
from tracknoise.findings.wording import SPACE, number, percent
from tracknoise.tables.enumerations import Behaviour

MAX_MISFIT = 0.25
"""Relative; with this misfit or more, the fit is not used."""
MAJORITY = 0.5
_BEHAVIOURS: Mapping[str, Behaviour] = dict(
    zip(TERMS, (Behaviour.white, Behaviour.random_walk, Behaviour.drift), strict=True)
)
_INDEPENDENT = -0.25
"""Half way between the autocorrelations of independent errors and of a constant offset."""
_BESIDES = {"white": "a constant part", "walk": "a random walk", "drift": "a drift"}


@dataclass(frozen=True, slots=True)
class Growth:
    """What the verdict is made from.

    Attributes
    ----------
    sizes
        By term: white (px), walk (px per sqrt(frame)) and drift (px per frame).
    shares
        By term, of the fitted second moment.
    autocorrelation
        Of changes, at one step; None where there are none.
    mean_px_per_frame
        Mean change of the error per frame of the sequence; None where unknown.
    misfit
        Of the fit, relative.
    """

    sizes: Mapping[str, Estimate]
    shares: Mapping[str, Estimate]
    autocorrelation: Estimate | None
    mean_px_per_frame: float | None
    misfit: float


def behaves(growth: Growth) -> tuple[Behaviour, str]:
    """Verdict by (behaviour), and the reason in words.

    Parameters
    ----------
    growth
        Of one condition, trimming and coordinate.
    """
    if growth.misfit >= MAX_MISFIT:
        missed = f"the fit misses the second moment by {percent(growth.misfit)}"
        return Behaviour.none, f"neither constant nor growing steadily: {missed}"
    for term in TERMS:
        if growth.shares[term].above(MAJORITY) and growth.sizes[term].above(0.0):
            others = [f"; also {_BESIDES[other]} of {_size(growth, other)}" for other in _besides(growth, term)]
            return _BEHAVIOURS[term], _REASONS[term](growth) + "".join(others)
    shares = ", ".join(f"{_BEHAVIOURS[term]} {format_as(growth.shares[term], percent)}" for term in TERMS)
    return Behaviour.undecided, f"the intervals do not show which term dominates the second moment: {shares}"


def _besides(growth: Growth, term: str) -> list[str]:
    """The other terms whose intervals exclude zero."""
    return [other for other in TERMS if other != term and growth.sizes[other].above(0.0)]


def _white(growth: Growth) -> str:
    reason = f"{'mostly ' if _besides(growth, 'white') else ''}constant: {_size(growth, 'white')}"
    related = growth.autocorrelation
    if related is not None and related.below(_INDEPENDENT):
        return f"{reason}, independent from frame to frame"
    if related is not None and related.above(_INDEPENDENT):
        return f"{reason}, mostly the same offset from frame to frame"
    return reason


def _walk(growth: Growth) -> str:
    return f"random walk: {_size(growth, 'walk')}"


def _drift(growth: Growth) -> str:
    reason, mean = f"drift: {_size(growth, 'drift')}", growth.mean_px_per_frame
    return reason if mean is None else f"{reason}; the mean changes by {number(mean)}{SPACE}px per frame"


_REASONS = {"white": _white, "walk": _walk, "drift": _drift}


def _size(growth: Growth, term: str) -> str:
    return format_estimate(growth.sizes[term])
