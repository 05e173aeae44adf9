"""The one rule by which all readers doubt the unit that times are taken to be in.

Times with a rate that no camera has are refused, unless their unit is stated: then a recording may be as slow or as
fast as it is.
"""

from collections.abc import Callable
from collections.abc import Sequence as Items
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.sequences.sequence import Sequence, has_stated_times, times_of
from tracknoise.sequences.views import View
from tracknoise.text import significant
from tracknoise.time_units import (
    FASTEST_HZ,
    LATEST_S,
    SHORTEST_S,
    SLOWEST_HZ,
    TimeUnit,
    is_likely,
    likely_unit,
    rate_of,
    unit_of_clock,
)

_SAME_RATE = 3.0
"""Poses as frequent as frames to this factor have the unit of frames."""

StatedBy = Callable[[TimeUnit], str]
"""How a user states a unit, in words for a message."""


def by_argument(unit: TimeUnit) -> str:
    """How the unit of times is stated in a call."""
    return f"time_unit = '{unit}'"


def require_seconds(
    times_s: NDArray[np.float64],
    places: Items[str],
    stated_by: StatedBy | None = None,
    *,
    taken: TimeUnit = TimeUnit.s,
) -> None:
    """Check that times, (n,) float64, can be seconds; `stated_by`, `taken` as in `require_likely_rate`."""
    for index in np.flatnonzero(~(np.abs(times_s) <= LATEST_S))[:1]:
        number = float(times_s[index]) * taken.per_second
        unit = unit_of_clock(number)
        how = "convert it to seconds" if stated_by is None else stated_by(unit)
        probably = f"; it is probably in {unit}: {how}" if np.isfinite(number) else ""
        stated = "" if taken is TimeUnit.s else f" {taken}"
        raise DataError(places[index], f"a timestamp of {number:g}{stated}", f"seconds, up to {LATEST_S:g}{probably}")


def require_likely_rate(
    times_s: NDArray[np.float64] | None,
    place: str | Path,
    stated_by: StatedBy | None,
    *,
    taken: TimeUnit = TimeUnit.s,
    what: str = "frames",
    instead: str = "",
) -> None:
    """Refuse times whose rate is not likely.

    Parameters
    ----------
    times_s
        (n,) float64, seconds, increasing; None where unknown.
    place
        Their origin, for the message.
    stated_by
        How the user states the unit; None where only the reader can.
    taken
        Unit that the numbers in the file were taken to be in.
    what
        What has these times, in the plural.
    instead
        How the user chooses other times, if there are any.

    Raises
    ------
    DataError
        If the rate is not likely. The message names the likely unit.
    """
    rate = rate_of(times_s)
    if rate is not None and not is_likely(rate):
        found, expected = _unlikely(rate, stated_by, taken, what)
        raise DataError(place, found, f"{expected}; other times: {instead}" if instead else expected)


def seconds_of(
    times: NDArray[np.float64], unit: TimeUnit | None, place: str | Path, places: Items[str], stated_by: StatedBy
) -> NDArray[np.float64]:
    """Seconds from the times of frames, (n,) float64, that a file has in a unit; None for one that is not stated.

    Times that do not increase are left to who reads them.

    Raises
    ------
    DataError
        If the unit is not stated, and is probably not seconds.
    """
    times_s: NDArray[np.float64] = times / (unit or TimeUnit.s).per_second
    if np.all(np.diff(times_s) > SHORTEST_S):  # not of NaN
        require_seconds(times_s, places, stated_by, taken=unit or TimeUnit.s)
        if unit is None:
            require_likely_rate(times_s, place, stated_by)
    return times_s


def require_pose_rate(
    times_s: NDArray[np.float64],
    frames_s: NDArray[np.float64],
    place: str | Path,
    stated_by: StatedBy,
    *,
    taken: TimeUnit,
) -> None:
    """Refuse times of poses whose rate is neither likely nor about that of the frames.

    Parameters are those of `require_likely_rate`; `frames_s`: (m,) float64, times of the frames, seconds.

    Raises
    ------
    DataError
        As `require_likely_rate`.
    """
    rate, of_frames = rate_of(times_s), rate_of(frames_s)
    if rate is None or (of_frames is not None and 1.0 / _SAME_RATE <= rate / of_frames <= _SAME_RATE):
        return
    require_likely_rate(times_s, place, stated_by, taken=taken, what="poses")


def require_likely_times(sequence: Sequence) -> None:
    """Refuse a sequence, or the one that a view shows, with times of an unlikely rate whose unit is not stated.

    Raises
    ------
    DataError
        As `require_likely_rate`.
    """
    while isinstance(sequence, View):
        sequence = sequence.sequence
    if not has_stated_times(sequence):
        require_likely_rate(times_of(sequence), sequence.source, None)


def _unlikely(rate: float, stated_by: StatedBy | None, taken: TimeUnit, what: str) -> tuple[str, str]:
    """What was found and expected; where the user cannot state a unit, the reader can."""
    found = f"{what} at {significant(rate, 3)} Hz, with times taken as {taken}"
    expected, likely = f"{SLOWEST_HZ:g} to {FASTEST_HZ:g} Hz", likely_unit(rate, taken)
    if likely is not None:
        expected += f"; the times are probably in {likely[0]} ({significant(likely[1], 3)} Hz)"
    if stated_by is None:
        return found, f"{expected}; its reader gives seconds, or time_unit_stated = True if the rate is right"
    if likely is None:
        return found, f"{expected}; if the rate is right: {stated_by(taken)}"
    return found, f"{expected}: {stated_by(likely[0])} ({taken} if the rate is right)"
