"""Estimates as text: ``0.410 px (0.380 to 0.450)``."""

import math
from collections.abc import Callable, Mapping
from typing import TypeAlias

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.wording import SPACE, number, percent, pixels

_WHOLE = 1e-6
"""A number this near to a whole one, relative to it, is written as such."""
Write: TypeAlias = Callable[[float | None], str]
"""Writes a number without its unit."""


def format_estimate(estimate: Estimate) -> str:
    """Write a value with its unit, and its interval in brackets where there is one."""
    unit = "" if estimate.unit in ("", "share") else f"{SPACE}{_unit(estimate)}"
    return format_as(estimate, _WRITTEN.get(estimate.unit, number), unit=unit)


def format_as(estimate: Estimate, write: Write, *, unit: str = "") -> str:
    """The same with numbers written in a given way.

    Parameters
    ----------
    estimate
        What to write.
    write
        Writes the value and either bound.
    unit
        What follows the value.
    """
    text = f"{write(estimate.value)}{unit}"
    if estimate.low is None and estimate.high is None:
        return text
    if estimate.low is None:
        return f"{text} (up to {write(estimate.high)})"
    if estimate.high is None:
        return f"{text} ({write(estimate.low)} or more)"
    return f"{text} ({write(estimate.low)} to {write(estimate.high)})"


def _unit(estimate: Estimate) -> str:
    return "frame" if estimate.unit == "frames" and estimate.value == 1 else estimate.unit


def _frames(value: float | None) -> str:
    """Frames, which are mostly whole: also where one machine rounds to a whole number and another next to it."""
    if value is None or not math.isclose(value, round(value), rel_tol=_WHOLE):
        return number(value)
    return number(round(value))


_WRITTEN: Mapping[str, Write] = {"share": percent, "px": pixels, "frames": _frames}
"""How numbers of a unit are written; others to three digits."""
