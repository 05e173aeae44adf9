"""Which components the noise of a tracker has.

A component is dropped if the interval of its variance reaches 0, or if what was left out is not described better with
it: scenes, groups of scenes, or blocks of tracks (`tracknoise.noise_models.fitting.independent`). This is done one at a
time, the least certain first, and the others are fitted again. As there are four components, these intervals have a
quarter of the usual error probability. The order may mislead where components are alike. If others, which are no more
and all certain, describe better what was left out, these are kept.

Some decisions are close. A component that was kept is doubtful if its interval at `ALMOST_CERTAIN` reaches 0. One that
was dropped is doubtful if its interval at the level of the model does not. The opposite decision on each gives an
alternative. What is said of the other components must hold for the alternatives, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tracknoise.noise_models.fitting.equations import NAMES
from tracknoise.noise_models.fitting.independent import independent_noun

if TYPE_CHECKING:
    from tracknoise.noise_models.fitting.weighted_sums import Bounded, WeightedSums

Array = NDArray[np.float64]

ALMOST_CERTAIN = 0.999
"""Level of the interval of a component that is kept without doubt."""
_ROUNDING = 1e-12
"""A variance that is smaller, relative to the largest component, counts as 0."""


@dataclass(frozen=True, slots=True, eq=False)
class Dropped:
    """Why a component was dropped, and how large its standard deviation may be, px; None if that is not known."""

    why: str
    most_px: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """Numbers of the components that were kept, what else they might be, and those that were dropped."""

    active: tuple[int, ...]
    alternatives: tuple[tuple[int, ...], ...]
    dropped: dict[int, Dropped]


def choose(sums: "WeightedSums", *, level: float) -> tuple[int, ...]:
    """Numbers of the components that `select` keeps, with its parameters."""
    return _chosen(sums, _strict(level))[0]


def select(sums: "WeightedSums", *, level: float) -> Selection:
    """Choose the components, and say what is known of the others.

    Parameters
    ----------
    sums
        What they are fitted to.
    level
        Of the intervals of the model.
    """
    strict = _strict(level)
    active, eliminated, dropped = _chosen(sums, strict)
    better = f"other components describe {independent_noun(sums.units)} that were left out better"
    swapped = {one: Dropped(better, _most(sums, (*active, one), strict)) for one in eliminated if one not in active}
    out = {one: why for one, why in {**dropped, **swapped}.items() if one not in active}
    return Selection(active, _alternatives(sums, active, level), out)


def _strict(level: float) -> float:
    return 1.0 - (1.0 - level) / len(NAMES)


def _chosen(sums: "WeightedSums", level: float) -> tuple[tuple[int, ...], tuple[int, ...], dict[int, Dropped]]:
    """What is kept, and what `_eliminated` found."""
    eliminated, dropped = _eliminated(sums, level)
    return _better(sums, eliminated, level), eliminated, dropped


def _eliminated(sums: "WeightedSums", level: float) -> tuple[tuple[int, ...], dict[int, Dropped]]:
    """What is left if components are dropped one at a time, and those that were dropped."""
    active, dropped = list(range(len(NAMES))), dict[int, Dropped]()
    while True:
        found, gains = sums.half_traces(active, scale="linear", level=level), sums.gains(active)
        worst = _least_certain(found, gains)
        if worst is None or len(active) == 1:
            return tuple(active), dropped
        dropped[active[worst]] = _reason(found, gains, worst, independent_noun(sums.units))
        del active[worst]


def _better(sums: "WeightedSums", active: tuple[int, ...], level: float) -> tuple[int, ...]:
    """The components, no more than the active ones, that describe best what was left out."""
    others = [each for size in range(1, len(active) + 1) for each in combinations(range(len(NAMES)), size)]
    own = sums.held_out(active)
    better = {each: found for each in others if (found := sums.held_out(each)) > own}
    certain = [each for each in better if _are_certain(sums.half_traces(each, scale="linear", level=level))]
    return max(certain, key=lambda each: better[each], default=active)


def _are_certain(found: "Bounded") -> bool:
    return bool((found.low > _least(found)).all())


def _least(found: "Bounded") -> float:
    """Variance up to which one counts as 0."""
    return _ROUNDING * float(found.value.max())


def _least_certain(found: "Bounded", gains: Array) -> int | None:
    """Place of the component to drop; None if all are to be kept."""
    least = _least(found)
    reaches = np.where(np.isnan(found.low), found.value <= least, found.low <= least)
    doubtful = reaches | (gains <= 0.0)
    if not doubtful.any():
        return None
    width = np.where(np.isnan(found.low), 1.0, found.value - found.low)
    certainty = found.value / np.where(width > 0.0, width, 1.0)
    return int(np.argmin(np.where(doubtful, certainty, np.inf)))


def _reason(found: "Bounded", gains: Array, place: int, left_out: str) -> Dropped:
    """Why a component is dropped, given the name of what is left out."""
    most = _root(found.high[place])
    if found.low[place] <= _least(found):
        return Dropped("the interval of its variance reaches 0", most)
    if found.value[place] <= 0.0:
        return Dropped("its variance is estimated as 0, without an interval", most)
    return Dropped(
        f"{left_out} that were left out are not described better with it ({gains[place]:+.2g} nat per error)", most
    )


def _most(sums: "WeightedSums", active: Sequence[int], level: float) -> float | None:
    """How large the standard deviation of the last component may be, px."""
    return _root(sums.half_traces(active, scale="linear", level=level).high[-1])


def _root(high: float) -> float | None:
    return None if np.isnan(high) else float(np.sqrt(max(high, 0.0)))


def _alternatives(sums: "WeightedSums", active: Sequence[int], level: float) -> tuple[tuple[int, ...], ...]:
    found = sums.half_traces(active, scale="linear", level=ALMOST_CERTAIN)
    doubtful = [one for one, low in zip(active, found.low, strict=True) if low <= 0.0 and len(active) > 1]
    fewer = [tuple(one for one in active if one != left) for left in doubtful]
    more = [(*active, other) for other in range(len(NAMES)) if other not in active]
    return (*fewer, *(each for each in more if sums.half_traces(each, scale="linear", level=level).low[-1] > 0.0))
