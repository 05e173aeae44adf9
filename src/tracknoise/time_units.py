"""Units of times, and the rates by which a unit is doubted: cameras take 1 to 1,000 images per second."""

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

SLOWEST_HZ, FASTEST_HZ = 1.0, 1000.0
"""Likely rates of cameras, and of recorded poses."""
_ROUNDING = 0.05
"""Share by which a rate may pass them: intervals are not exact."""
_USUAL_HZ = 30.0
SHORTEST_S = 1e-12
"""Shorter times between frames are none: poses between those of two frames could not be computed."""
LATEST_S = 1e11
"""No clock of seconds shows more: it is more than 3000 years."""


class TimeUnit(StrEnum):
    """Unit of the times in a file."""

    s = "s"
    ms = "ms"
    us = "us"
    ns = "ns"

    @property
    def per_second(self) -> int:
        """How many of it are a second."""
        return int(1000 ** list(TimeUnit).index(self))


def rate_of(times_s: NDArray[np.float64] | None) -> float | None:
    """Frames per second by the median interval of times; None without two of them that increase."""
    step = 0.0 if times_s is None or len(times_s) < 2 else float(np.median(np.diff(times_s)))
    return 1.0 / step if step > 0.0 else None


def is_likely(rate_hz: float) -> bool:
    """Whether a camera may have this rate."""
    return SLOWEST_HZ / (1.0 + _ROUNDING) <= rate_hz <= FASTEST_HZ * (1.0 + _ROUNDING)


def likely_unit(rate_hz: float, taken: TimeUnit = TimeUnit.s) -> tuple[TimeUnit, float] | None:
    """The unit in which times have a likely rate, and this rate, where they were taken in another; None without one."""
    rates = {unit: rate_hz * unit.per_second / taken.per_second for unit in TimeUnit}
    likely = [unit for unit, rate in rates.items() if is_likely(rate)]
    best = min(likely, key=lambda unit: abs(np.log(rates[unit] / _USUAL_HZ)), default=None)
    return None if best is None else (best, rates[best])


def unit_of_clock(time: float) -> TimeUnit:
    """The unit in which a large number can be a time since 1970; seconds for a small one."""
    return next((unit for unit in TimeUnit if abs(time) / unit.per_second <= LATEST_S), TimeUnit.ns)
