"""Effect and interval of a row as places on a line, in margins: what is worse lies to the right."""

import math
from dataclasses import dataclass

from tracknoise.findings.comparison.estimands import Unit
from tracknoise.findings.comparison.result import Row

WIDTH = 300.0
"""Length of the line, px."""
_INSET = 6.0
"""Room for the marks at both ends, px."""
_MOST_MARGINS = 20.0
"""Changes of so many margins, and larger ones, lie at its ends."""


@dataclass(frozen=True, slots=True)
class Plot:
    """Places on the line, px from its left end.

    Attributes
    ----------
    effect, low, high
        The effect and its interval; `low` is left of `high`.
    inner
        Bounds of the margin.
    scenes
        Effects of single scenes, with their names.
    """

    effect: float
    low: float
    high: float
    inner: tuple[float, float]
    scenes: tuple[tuple[str, float], ...]


def plot_of(row: Row) -> Plot | None:
    """Places of a row; None where it has no effect or no margin."""
    if row.effect is None or row.low is None or row.high is None or row.margin is None:
        return None
    low, high = sorted((_place(row, row.low), _place(row, row.high)))
    scenes = tuple((name, _place(row, value)) for name, value in row.scenes.items())
    return Plot(_place(row, row.effect), low, high, (_at(-1.0), _at(1.0)), scenes)


def _place(row: Row, value: float) -> float:
    sign = -1.0 if row.estimand.larger_is_better else 1.0
    assert row.margin is not None
    if row.estimand.unit == Unit.ratio:
        return _at(sign * math.log(value) / math.log(row.margin))
    return _at(sign * value / row.margin)


def _at(margins: float) -> float:
    """Place of a number of margins: the more of them, the closer they lie."""
    inside = max(-_MOST_MARGINS, min(_MOST_MARGINS, margins))
    share = math.copysign(math.log1p(abs(inside)) / math.log1p(_MOST_MARGINS), inside)
    return round(WIDTH / 2 + (WIDTH / 2 - _INSET) * share, 1)
