"""What errors do as time goes by: a verdict from how their second moment grows, and a sentence that says it.

The verdict (behaviour) is `none` where (growth) misses the second moment by a quarter of it or more, so that it neither
stays, nor grows as any of the three does; otherwise the term whose share of the fitted second moment is above a half,
and whose size is above zero, with all of their intervals; otherwise `undecided`.

What each means:

- white: the error is as large in the first frame after birth as later. Errors that are independent from frame to frame
  do so, and so does an offset that stays. Changes tell them apart: the autocorrelation at one step is -1/2 for the
  first, and near 0 for the second.
- random walk: small errors, independent of each other, add up.
- drift: errors grow in proportion to time, whether all tracks drift the same way, so that the mean error grows, or each
  its own.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from tracknoise.findings.growth.fit import TERMS
from tracknoise.findings.shape.verdict import Interval
from tracknoise.findings.wording import SPACE, number, percent

MAX_MISFIT = 0.25
"""Relative; from here on the fit says nothing."""
MAJORITY = 0.5
_NAMES = dict(zip(TERMS, ("white", "random walk", "drift"), strict=True))
_INDEPENDENT = -0.25
"""Half way between the autocorrelations of errors that are independent and of an offset that stays."""


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
        Of changes, at one step.
    mean_px_per_frame
        Mean change of the error per frame of the sequence, NaN where unknown.
    misfit
        Of the fit, relative.
    """

    sizes: Mapping[str, Interval]
    shares: Mapping[str, Interval]
    autocorrelation: Interval
    mean_px_per_frame: float
    misfit: float


def behaves(growth: Growth) -> tuple[str, str]:
    """Verdict by (behaviour), one of `BEHAVIOUR`, and a sentence without its subject, the error.

    Parameters
    ----------
    growth
        Of one condition, trimming and coordinate.
    """
    if growth.misfit >= MAX_MISFIT:
        return "none", f"neither stays nor grows steadily: the fit misses its square by {percent(growth.misfit)}"
    for term in TERMS:
        if growth.shares[term].above(MAJORITY) and growth.sizes[term].above(0.0):
            others = [f"; besides, it {_BESIDES[other](growth)}" for other in TERMS if _is_besides(growth, other, term)]
            return _NAMES[term], _SENTENCES[term](growth) + "".join(others)
    shares = ", ".join(f"{_NAMES[term]} {_percents(growth.shares[term])}" for term in TERMS)
    return "undecided", f"shares of its square: {shares}: none is more than half of it for certain"


def _is_besides(growth: Growth, other: str, term: str) -> bool:
    """Whether a term that is less than half of the second moment is certainly there."""
    return other != term and growth.sizes[other].above(0.0)


def _white(growth: Growth) -> str:
    rising = any(_is_besides(growth, other, "white") for other in TERMS)
    said = f"is {'mostly ' if rising else ''}as large at first as later: {_size(growth, 'white', 'px')}"
    if growth.autocorrelation.below(_INDEPENDENT):
        return f"{said}, and differs from frame to frame as independent errors do"
    if growth.autocorrelation.above(_INDEPENDENT):
        return f"{said}, and mostly stays what it is from frame to frame"
    return said


def _walk(growth: Growth) -> str:
    return f"behaves like a random walk: {_size(growth, 'walk', 'px per sqrt(frame)')}"


def _drift(growth: Growth) -> str:
    said = f"drifts: {_size(growth, 'drift', 'px per frame')}"
    mean = growth.mean_px_per_frame
    return said if math.isnan(mean) else f"{said}; its mean changes by {number(mean)}{SPACE}px per frame"


_SENTENCES = {"white": _white, "walk": _walk, "drift": _drift}
_BESIDES = {
    "white": lambda growth: f"has a constant part of {_size(growth, 'white', 'px')}",
    "walk": lambda growth: f"wanders by {_size(growth, 'walk', 'px per sqrt(frame)')}",
    "drift": lambda growth: f"drifts by {_size(growth, 'drift', 'px per frame')}",
}


def _size(growth: Growth, term: str, unit: str) -> str:
    interval = growth.sizes[term]
    return f"{number(interval.value)}{SPACE}{unit} [{number(interval.low)}, {number(interval.high)}]"


def _percents(share: Interval) -> str:
    if math.isnan(share.low):
        return percent(share.value)
    return f"{percent(share.value)} [{percent(share.low)}, {percent(share.high)}]"
