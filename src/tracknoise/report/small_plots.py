"""Small drawings that stand in the page as SVG: values with their intervals."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

from tracknoise.text import printable
from tracknoise.topics.answer_summary import Card, Measure, Number

INTERVAL_PLOT_WIDTH, INTERVAL_PLOT_HEIGHT = 76, 16
_EDGE = 4.0
_MANY_TIMES = 20.0
"""Positive values that differ by more than this factor are drawn on a logarithmic axis."""


@dataclass(frozen=True, slots=True)
class Scale:
    """Horizontal axis of the drawings of one measure, the same for all trackers.

    Attributes
    ----------
    low, high
        Its ends; logarithms where it is logarithmic.
    is_log
        Whether it is logarithmic.
    """

    low: float
    high: float
    is_log: bool

    def place(self, value: float) -> float:
        """Horizontal position of a value, px; at the edge if it lies outside."""
        along = math.log(value) if self.is_log and value > 0.0 else self.low if self.is_log else value
        share = (along - self.low) / (self.high - self.low)
        return _EDGE + (INTERVAL_PLOT_WIDTH - 2 * _EDGE) * min(1.0, max(0.0, share))


def scale(measures: Iterable[Measure]) -> Scale:
    """Axis that holds the values and intervals of measures, and zero where it is not logarithmic."""
    shown = list(measures)
    numbers = [measure.number for measure in shown]
    ends = [end for number in numbers for end in (number.value, number.low, number.high) if end is not None]
    ends += [measure.reference for measure in shown if measure.reference is not None]
    if ends and min(ends) > 0.0 and max(ends) > _MANY_TIMES * min(ends):
        return _widened(math.log(min(ends)), math.log(max(ends)), is_log=True)
    return _widened(min([0.0, *ends]), max([0.0, *ends]), is_log=False)


def _widened(low: float, high: float, *, is_log: bool) -> Scale:
    return Scale(low, high if high > low else low + 1.0, is_log)


def scales(cards: Sequence[Card]) -> dict[str, Scale]:
    """Axis of every measure that any card has, by name."""
    names = dict.fromkeys(measure.name for card in cards for measure in card.measures)
    return {
        name: scale(candidate for card in cards for candidate in card.measures if candidate.name == name)
        for name in names
    }


def draw(measure: Measure, axis: Scale, colour: str) -> Markup:
    """Draw the values of a measure as points, their intervals as bars, and the reference as a line."""
    marks = [] if measure.reference is None else [_reference(axis.place(measure.reference))]
    marks += _mark(measure.number, axis, colour)
    label = escape(printable(_label(measure)))
    return Markup(
        '<svg class="interval" role="img" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        'aria-label="{label}"><line class="axis" x1="{edge}" x2="{end}" y1="{y}" y2="{y}"/>{marks}</svg>'
    ).format(
        width=INTERVAL_PLOT_WIDTH,
        height=INTERVAL_PLOT_HEIGHT,
        label=label,
        edge=_EDGE,
        end=INTERVAL_PLOT_WIDTH - _EDGE,
        y=INTERVAL_PLOT_HEIGHT / 2,
        marks=Markup("").join(marks),
    )


def _label(measure: Measure) -> str:
    interval = f", interval {measure.number.interval}" if measure.number.interval else ", no interval"
    return f"{measure.name}: {measure.number.text}{interval}"


def _reference(x: float) -> Markup:
    return Markup('<line class="reference" x1="{x:.1f}" x2="{x:.1f}" y1="1" y2="{end}"/>').format(
        x=x, end=INTERVAL_PLOT_HEIGHT - 1
    )


def _mark(number: Number, axis: Scale, colour: str) -> list[Markup]:
    """A bar for the interval and a point for the value."""
    if number.value is None:
        return []
    y, marks = INTERVAL_PLOT_HEIGHT / 2, []
    if number.low is not None and number.high is not None:
        bar = '<line class="bar" x1="{low:.1f}" x2="{high:.1f}" y1="{y}" y2="{y}" stroke="{colour}"/>'
        low, high = axis.place(number.low), axis.place(number.high)
        marks.append(Markup(bar).format(low=low, high=max(high, low + 1.0), y=y, colour=colour))
    point = '<circle cx="{x:.1f}" cy="{y}" r="3" stroke="{colour}" fill="{colour}"/>'
    return [*marks, Markup(point).format(x=axis.place(number.value), y=y, colour=colour)]
