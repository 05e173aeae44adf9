"""Whether tracks that live long have other errors at the same age than all tracks.

Where tracks with large errors are lost early, those that are left have smaller errors, and the curve over the ages is
not that of any track. Under (exchange) the tracks that live to an age A are like the others at every earlier age k:

    sum over k < A of (sum(e^2) of the n tracks that live to A - n M(k)), is zero on average

where M is the second moment of all N tracks of the scene at k. What is summed is n (N - n) / N times the difference
between these tracks and the others. Divided by the sum of n (N - n) / N times M(k), it is their relative difference.
Scenes count by that weight, whatever their scale; scenes in which no track is lost do not count. All A are tested
together, as in `tracknoise.findings.growth.agreement`. What matters to the curve is by how much these tracks differ
from all: the sum above, divided by that of n M(k).

Scenes may differ in how many tracks they lose because of large errors, so that the variation between them hides the
effect. If tracks are independent, a second test shows it better: at the last age before A, the sum of one age above has
the variance n (N - n) / (N - 1) times that of e^2 among the N tracks (drawn), as of n tracks drawn without replacement.
Tracks may depend on each other. This test therefore refuses only where the first points the same way.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.findings.growth.agreement import ALPHA, by_chance

Array = NDArray[np.float64]

_MIN_UNITS = 2
_LEAST = 1e-300
POINTS_THE_SAME_WAY = 0.3
"""P-value of scenes up to which they support what tracks show."""
TOLERANCE = 0.05
"""By how much the second moment of long-lived tracks may differ, relative to that of all."""


@dataclass(frozen=True, slots=True)
class Loss:
    """How tracks that live long differ from all tracks.

    Attributes
    ----------
    p
        P-value of (exchange) for all ages A together, with scenes as units.
    p_of_tracks
        The same by (drawn), with tracks as units; 1 where unknown.
    at_least
        The age A at which they differ most.
    excess
        By how much their second moment is larger, relative to that of all; negative where it is smaller.
    """

    p: float
    p_of_tracks: float
    at_least: int
    excess: float

    @property
    def refused(self) -> bool:
        """Whether they differ by more than chance and tolerance explain."""
        by_tracks = self.p_of_tracks <= ALPHA and self.p <= POINTS_THE_SAME_WAY
        return abs(self.excess) > TOLERANCE and (self.p <= ALPHA or by_tracks)


def loss(
    n: Array, squares: Array, since: Array, lived: Mapping[int, tuple[Array, Array]], fourth: Array | None = None
) -> Loss | None:
    """Compare the tracks that live to given ages with all; None where there is nothing to compare.

    Parameters
    ----------
    n, squares : (units, ages)
        Number of errors of one coordinate, and the sum of their squares.
    since : (ages,)
        Frames.
    lived
        The same by age A, of the tracks that were seen at that age or later.
    fourth : (units, ages)
        Sum of the fourth powers of errors, where it is known.
    """
    compared = [_compared(n, squares, since, at_least, *of) for at_least, of in sorted(lived.items())]
    known = [one for one in compared if np.count_nonzero(one.size) >= _MIN_UNITS]
    if not known:
        return None
    p = by_chance(np.stack([one.difference for one in known]), np.sum([one.size for one in known], axis=0))
    most = max(known, key=lambda one: abs(one.excess))
    of_tracks = [] if fourth is None else [_drawn(n, squares, fourth, since, at, *lived[at]) for at in lived]
    return Loss(p, min(1.0, len(lived) * min(of_tracks, default=1.0)), most.at_least, most.excess)


@dataclass(frozen=True, slots=True)
class _Compared:
    """Tracks that live to an age, and the others.

    Attributes
    ----------
    at_least
        That age.
    difference : (1 + units,)
        Of their second moments, relative to that of all: of all units and of all but each.
    size : (units,)
        How well it is known in each unit: the weight of (exchange).
    excess
        As in `Loss`.
    """

    at_least: int
    difference: Array
    size: Array
    excess: float


def _compared(n: Array, squares: Array, since: Array, at_least: int, n_lived: Array, of_lived: Array) -> _Compared:
    """Compare at the ages before `at_least` at which there are both kinds of tracks."""
    second = squares / np.maximum(n, 1)
    both = (since < at_least) & (n_lived > 0) & (n > n_lived)
    more = np.where(both, of_lived - n_lived * second, 0.0).sum(axis=1)
    weight = np.where(both, n_lived * (n - n_lived) / np.maximum(n, 1), 0.0)
    known, early = (weight * second).sum(axis=1), np.where(since < at_least, n_lived, 0.0)
    whole = (early * second).sum(axis=1)
    size = np.where(known > 0, weight.sum(axis=1), 0.0)
    excess = _all_and_without(more / np.where(whole > 0, whole, 1.0), early.sum(axis=1))[0]
    return _Compared(at_least, _all_and_without(more / np.where(known > 0, known, 1.0), size), size, float(excess))


def _drawn(
    n: Array, squares: Array, fourth: Array, since: Array, at_least: int, n_lived: Array, of_lived: Array
) -> float:
    """P-value of (drawn) at the last age before `at_least` at which there are both kinds of tracks."""
    places = np.flatnonzero((since < at_least) & ((n_lived > 0) & (n > n_lived)).any(axis=0))
    if not len(places):
        return 1.0
    count, total, powers, drawn, sums = (table[:, places[-1]] for table in (n, squares, fourth, n_lived, of_lived))
    second = total / np.maximum(count, 1)
    known = (drawn > 0) & (count > drawn) & (second > 0)
    scale = np.where(known, second, 1.0)
    spread = np.maximum(powers / np.maximum(count, 1) - second**2, 0.0) * count / np.maximum(count - 1, 1)
    variance = np.where(known, drawn * (count - drawn) / np.maximum(count, 1) * spread / scale**2, 0.0)
    more = np.where(known, (sums - drawn * second) / scale, 0.0)
    return float(2 * special.ndtr(-abs(more.sum()) / max(np.sqrt(variance.sum()), _LEAST)))


def _all_and_without(excess: Array, size: Array) -> Array:
    """Mean over units by their size, of all and of all but each, (1 + units,)."""
    total, weight = (excess * size).sum(), size.sum()
    left = weight - size
    without = (total - excess * size) / np.where(left > 0, left, 1.0)
    return np.append(total / max(weight, _LEAST), np.where(left > 0, without, total / max(weight, _LEAST)))
