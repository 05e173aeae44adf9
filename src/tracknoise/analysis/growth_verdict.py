"""How errors behave over time: a verdict, its reason, and whether long-lived tracks differ.

Tracks that live long
---------------------

Where tracks with large errors are lost early, those that are left have smaller errors, and the curve over the ages is
not that of any track. Therefore the tracks that live to an age A are compared with the others. If they are like the
others at every earlier age k (exchange),

    sum over k < A of (sum(e^2) of the n tracks that live to A - n M(k)), is zero on average

where M is the second moment of all N tracks of the scene at k. What is summed is n (N - n) / N times the difference
between these tracks and the others. Divided by the sum of n (N - n) / N times M(k), it is their relative difference.
Scenes count by that weight, whatever their scale. Scenes in which no track is lost do not count. All A are tested
together, as in `tracknoise.analysis.growth_models`. What matters to the curve is by how much these tracks differ from
all: the sum above, divided by that of n M(k).

Scenes may differ in how many tracks they lose because of large errors, so that the variation between them hides the
effect. If tracks are independent, a second test shows it better. At the last age before A, the sum of one age above has
the variance n (N - n) / (N - 1) times that of e^2 among the N tracks (drawn), as of n tracks drawn without replacement.
Tracks may depend on each other. This test therefore refuses only where the first points the same way.

Verdict
-------

Whether errors grow is decided by (growth ratio): the RMS at the reference age over that at the first, of the tracks
that live to it. They grow if all of its interval is above 1 + margin. They do not if all of it is below. Otherwise it
is undecided.

How they grow (behaviour) is decided by the parts that are established: those whose interval in a scene of typical scale
does not reach 0. The first of these rules that applies decides. The models are those of
`tracknoise.analysis.growth_models`:

1. undecided: the tracks that live long have other errors than all tracks at the same age. The loss of tracks then
   shapes the curve.
2. The polynomial of (growth) is not refused by the curve or by the autocorrelations: its part that grows, of two the
   larger. White, if no part that grows is established, and errors do not grow. Otherwise undecided.
3. The model of (saturating) is not refused: the same with its parts. The time constant must be known.
4. none: none of the models fits.

The verdicts mean:

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

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.analysis.growth_models import ALPHA, Agreement, by_chance
from tracknoise.inference.estimates import Estimate
from tracknoise.tables.enumerations import Behaviour, Verdict
from tracknoise.words import SPACE, format_as, format_estimate, number, percent

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

    Shapes: n, squares (units, ages), since (ages,) frames, fourth (units, ages).
    """
    compared = [_compared(n, squares, since, at_least, *of) for at_least, of in sorted(lived.items())]
    enough = [part for part in compared if np.count_nonzero(part.size) >= _MIN_UNITS]
    if not enough:
        return None
    p = by_chance(np.stack([part.difference for part in enough]), np.sum([part.size for part in enough], axis=0))
    most = max(enough, key=lambda part: abs(part.excess))
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
    sums, early = (weight * second).sum(axis=1), np.where(since < at_least, n_lived, 0.0)
    whole = (early * second).sum(axis=1)
    size = np.where(sums > 0, weight.sum(axis=1), 0.0)
    excess = _all_and_without(more / np.where(whole > 0, whole, 1.0), early.sum(axis=1))[0]
    return _Compared(at_least, _all_and_without(more / np.where(sums > 0, sums, 1.0), size), size, float(excess))


def _drawn(
    n: Array, squares: Array, fourth: Array, since: Array, at_least: int, n_lived: Array, of_lived: Array
) -> float:
    """P-value of (drawn) at the last age before `at_least` at which there are both kinds of tracks."""
    places = np.flatnonzero((since < at_least) & ((n_lived > 0) & (n > n_lived)).any(axis=0))
    if not len(places):
        return 1.0
    count, total, powers, drawn, sums = (table[:, places[-1]] for table in (n, squares, fourth, n_lived, of_lived))
    second = total / np.maximum(count, 1)
    usable = (drawn > 0) & (count > drawn) & (second > 0)
    scale = np.where(usable, second, 1.0)
    spread = np.maximum(powers / np.maximum(count, 1) - second**2, 0.0) * count / np.maximum(count - 1, 1)
    variance = np.where(usable, drawn * (count - drawn) / np.maximum(count, 1) * spread / scale**2, 0.0)
    more = np.where(usable, (sums - drawn * second) / scale, 0.0)
    return float(2 * special.ndtr(-abs(more.sum()) / max(np.sqrt(variance.sum()), _LEAST)))


def _all_and_without(excess: Array, size: Array) -> Array:
    """Mean over units by their size, of all and of all but each, (1 + units,)."""
    total, weight = (excess * size).sum(), size.sum()
    left = weight - size
    without = (total - excess * size) / np.where(left > 0, left, 1.0)
    return np.append(total / max(weight, _LEAST), np.where(left > 0, without, total / max(weight, _LEAST)))


_BEHAVIOURS: Mapping[str, Behaviour] = {
    "white": Behaviour.white,
    "walk": Behaviour.random_walk,
    "drift": Behaviour.drift,
    "saturating": Behaviour.saturating,
}
_NAMES: Mapping[str, str] = {**_BEHAVIOURS, "white": "constant part", "saturating": "saturating part"}
_INDEPENDENT = -0.25
"""Half way between the autocorrelations of independent errors and of a constant offset."""


@dataclass(frozen=True, slots=True)
class Growth:
    """What the verdict is made from.

    Attributes
    ----------
    ratio
        (growth ratio); None where there is none.
    sizes
        By term, of all errors together: white, saturating_white and saturating (px), walk (px per sqrt(frame)), drift
        (px per frame), and time_constant (frames). Those of (saturating) are there where it was fitted.
    geometric
        Of the terms of the polynomial: geometric means over scenes.
    polynomial, saturating
        How the models agree; the latter where the polynomial is refused.
    loss
        How long-lived tracks differ from all; None where unknown.
    longest
        Frames over which the fit goes.
    """

    ratio: Estimate | None
    sizes: Mapping[str, Estimate]
    geometric: Mapping[str, Estimate]
    polynomial: Agreement
    saturating: Agreement | None
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


def grows(ratio: Estimate | None, margin: float) -> Verdict:
    """Whether errors grow, by (growth ratio). `margin`: relative; growth by less counts as none."""
    if ratio is not None and ratio.above(1 + margin):
        return Verdict.yes
    return Verdict.no if ratio is not None and ratio.below(1 + margin) else Verdict.undecided


def behaves(growth: Growth, changes: Changes, margin: float) -> tuple[Behaviour, str]:
    """Verdict by (behaviour), and the reason in words."""
    if growth.loss is not None and growth.loss.refused:
        return Behaviour.undecided, _lost(growth.loss)
    rising = grows(growth.ratio, margin)
    if not growth.polynomial.refused:
        return _of_parts(growth.geometric, ("walk", "drift"), changes, growth.longest, rising)
    if growth.saturating is None or growth.saturating.refused:
        return Behaviour.none, _missed(growth.polynomial)
    constant = growth.sizes["time_constant"]
    if not constant.below(growth.longest):
        seen = f"the time constant is {format_estimate(constant)}, and ages are up to {number(int(growth.longest))}"
        return Behaviour.undecided, f"errors grow more slowly than a random walk, but not how: {seen}"
    sizes = {**growth.sizes, "white": growth.sizes["saturating_white"]}
    return _of_parts(sizes, ("saturating",), changes, growth.longest, rising)


def _of_parts(
    sizes: Mapping[str, Estimate], growing: tuple[str, ...], changes: Changes, longest: float, rising: Verdict
) -> tuple[Behaviour, str]:
    """The established part that grows, of two the one that is larger at the longest age, or that none does."""
    established = [term for term in ("white", *growing) if sizes[term].above(0.0)]
    parts = sorted(established, key=lambda term: -_reaches(term, sizes[term], longest))
    terms = [term for term in parts if term != "white"]
    if terms:
        return _BEHAVIOURS[terms[0]], "; ".join(_part(term, sizes, changes) for term in parts)
    if rising == Verdict.no:
        return Behaviour.white, _white(sizes["white"], changes.autocorrelation)
    sought = [_NAMES[term] for term in growing] if rising == Verdict.yes else ["growth", "its absence"]
    none = f"neither {' nor '.join(sought)}" if len(sought) > 1 else f"no {sought[0]}"
    return Behaviour.undecided, f"{none} is established"


def _reaches(term: str, size: Estimate, longest: float) -> float:
    """RMS of a part at the longest age, px."""
    return float((size.value or 0.0) * {"walk": longest**0.5, "drift": longest}.get(term, 1.0))


def _part(term: str, sizes: Mapping[str, Estimate], changes: Changes) -> str:
    """A part with its size."""
    text = f"{_NAMES[term]}: {format_estimate(sizes[term])}"
    if term == "saturating":
        return f"{text} with a time constant of {format_estimate(sizes['time_constant'])}"
    if term == "drift" and changes.mean_px_per_frame is not None:
        return f"{text}, of which the mean has {number(changes.mean_px_per_frame)}{SPACE}px per frame"
    return text


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


def _white(size: Estimate, related: Estimate | None) -> str:
    reason = f"constant: {format_estimate(size)}"
    if related is not None and related.below(_INDEPENDENT):
        return f"{reason}, independent from frame to frame"
    if related is not None and related.above(_INDEPENDENT):
        return f"{reason}, mostly the same offset from frame to frame"
    return reason


def _two(value: float) -> str:
    return format_as(Estimate(value), lambda given: f"{given:.2f}".replace("-", "\N{MINUS SIGN}"))
