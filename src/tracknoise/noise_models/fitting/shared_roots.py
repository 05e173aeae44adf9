"""Where several decreasing functions of one number are zero, if each evaluation gives the values of all of them."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MOST_WIDENED, _MOST_ROUNDS = 12, 4
"""Steps by which a range is widened at most, at either end, and rounds of interpolation."""


def shared_roots(values: Callable[[float], Array], start: Array, *, close: float) -> Array:
    """Roots of n smooth decreasing functions, (n,), by repeated linear interpolation.

    Parameters
    ----------
    values
        Of all functions, (n,).
    start : (points,)
        Where they are evaluated first, increasing in equal steps. The range is widened by such steps until it contains
        all roots, or until it is `_MOST_WIDENED` steps longer at an end. A root beyond is taken to be there.
    close
        Interpolation is repeated until the functions are known this close to each root.
    """
    known = {float(at): values(float(at)) for at in start}
    step = float(start[1] - start[0])
    _widen(known, values, -step)
    _widen(known, values, step)
    for _ in range(_MOST_ROUNDS):
        roots = _interpolated(known)
        for root in roots.tolist():
            if min(abs(root - at) for at in known) > close:
                known[root] = values(root)
    return _interpolated(known)


def _widen(known: dict[float, Array], values: Callable[[float], Array], step: float) -> None:
    """Add places below all others (negative step) or above them, as long as a root is beyond."""
    for _ in range(_MOST_WIDENED):
        end = min(known) if step < 0.0 else max(known)
        if not (known[end] * step > 0.0).any():
            return
        known[end + step] = values(end + step)


def _interpolated(known: dict[float, Array]) -> Array:
    places = sorted(known)
    table = -np.array([known[at] for at in places])
    return np.array([np.interp(0.0, column, places) for column in table.T])
