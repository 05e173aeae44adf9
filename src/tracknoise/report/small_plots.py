"""Small drawings that stand in the page as SVG: errors by age, and values with their intervals.

- Error by age on the first screen: RMS of every tracker in u and v, as SVG that stands in the page.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import polars as pl
from markupsafe import Markup, escape

from tracknoise.phrases.answer_summary import Card, Measure, Number
from tracknoise.report.report_data import ReportData
from tracknoise.text import printable
from tracknoise.words import rms_of_tracks

CURVE_PLOT_WIDTH, CURVE_PLOT_HEIGHT = 268, 132
_LEFT, _RIGHT, _TOP, _BOTTOM = 34, 6, 16, 20
_TICKS = 4


@dataclass(frozen=True, slots=True)
class _Axes:
    """Places of ages and errors in one panel, px."""

    first: float
    last: float
    most: float

    def x(self, at: float) -> float:
        return _LEFT + (CURVE_PLOT_WIDTH - _LEFT - _RIGHT) * (at - self.first) / ((self.last - self.first) or 1.0)

    def y(self, value: float) -> float:
        return (
            CURVE_PLOT_HEIGHT
            - _BOTTOM
            - (CURVE_PLOT_HEIGHT - _TOP - _BOTTOM) * min(max(value, 0.0), self.most) / self.most
        )


def curves(data: ReportData) -> list[Markup]:
    """Panels of u and v; empty where there are no curves, or where points are fitted to the tracks."""
    points = data.nominal(data.points).filter(role="second", trimming=data.trimming, population=data.population)
    if points.is_empty() or data.truth_is_fitted:
        return []
    axes = _axes(points)
    return [_panel(data, points.sort("at"), axes, coordinate) for coordinate in "uv"]


def curves_caption(data: ReportData) -> str:
    """What the panels show."""
    return f"{rms_of_tracks(data.trimming)} by {data.axis.name}; bands are intervals. Colours are those of the cards."


def _axes(points: pl.DataFrame) -> _Axes:
    """Axes that hold all curves, and intervals up to twice as high."""
    values = pl.concat([points["u"], points["v"]])
    ends = pl.concat([points["u_high"], points["v_high"]]).drop_nulls()
    highest = float(values.max() or 0.0)  # type: ignore[arg-type]
    widest = float(ends.max()) if ends.len() else highest  # type: ignore[arg-type]
    most = max(highest, min(widest, 2.0 * highest)) or 1.0
    return _Axes(float(points["at"].min()), float(points["at"].max()), 1.05 * most)  # type: ignore[arg-type]


def _panel(data: ReportData, points: pl.DataFrame, axes: _Axes, coordinate: str) -> Markup:
    parts = [*_grid(axes), *(_curve(points.filter(tracker=name), axes, coordinate, data.colour[name])
             for name in data.trackers)]  # fmt: skip
    title = f"{rms_of_tracks(data.trimming)} in {coordinate} (px) by {data.axis.name}"
    return Markup(
        '<svg class="curves" role="img" aria-label="{title}: one curve per tracker, with intervals as bands" '
        'viewBox="0 0 {width} {height}">{parts}<text x="2" y="10" class="title">{title}</text></svg>'
    ).format(title=title, width=CURVE_PLOT_WIDTH, height=CURVE_PLOT_HEIGHT, parts=Markup("").join(parts))


def _grid(axes: _Axes) -> list[Markup]:
    lines = [
        Markup(
            '<line class="axis" x1="{left}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>'
            '<text x="{text}" y="{base:.1f}" text-anchor="end">{label}</text>'
        ).format(
            left=_LEFT,
            right=CURVE_PLOT_WIDTH - _RIGHT,
            y=axes.y(v),
            text=_LEFT - 4,
            base=axes.y(v) + 3.5,
            label=f"{v:g}",
        )
        for v in _round_steps(0.0, axes.most)
    ]
    ages = [
        Markup('<text x="{x:.1f}" y="{y}" text-anchor="middle">{label}</text>').format(
            x=axes.x(at), y=CURVE_PLOT_HEIGHT - 6, label=f"{at:g}"
        )
        for at in _round_steps(axes.first, axes.last)
        if at == int(at)
    ]
    return [*lines, *ages]


def _round_steps(low: float, high: float) -> Sequence[float]:
    """A few round numbers between two others."""
    rough = (high - low) / _TICKS or 1.0
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= rough)
    first = math.ceil(low / step)
    return [place * step for place in range(first, math.floor(high / step) + 1)]


def _curve(points: pl.DataFrame, axes: _Axes, coordinate: str, colour: str) -> Markup:
    line = " ".join(f"{axes.x(at):.1f},{axes.y(v):.1f}" for at, v in points.select("at", coordinate).iter_rows())
    band = points.select("at", f"{coordinate}_low", f"{coordinate}_high").drop_nulls().rows()
    ends = [(at, low) for at, low, _ in band] + [(at, high) for at, _, high in reversed(band)]
    area = " ".join(f"{axes.x(at):.1f},{axes.y(v):.1f}" for at, v in ends)
    return Markup(
        '<polygon points="{area}" fill="{colour}" opacity="0.15"/>'
        '<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="1.8" stroke-linejoin="round"/>'
    ).format(area=area, line=line, colour=colour)


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
    ends = [end for one in numbers for end in (one.value, one.low, one.high) if end is not None]
    ends += [measure.reference for measure in shown if measure.reference is not None]
    if ends and min(ends) > 0.0 and max(ends) > _MANY_TIMES * min(ends):
        return _widened(math.log(min(ends)), math.log(max(ends)), is_log=True)
    return _widened(min([0.0, *ends]), max([0.0, *ends]), is_log=False)


def _widened(low: float, high: float, *, is_log: bool) -> Scale:
    return Scale(low, high if high > low else low + 1.0, is_log)


def scales(cards: Sequence[Card]) -> dict[str, Scale]:
    """Axis of every measure that any card has, by name."""
    names = dict.fromkeys(measure.name for card in cards for measure in card.measures)
    return {name: scale(one for card in cards for one in card.measures if one.name == name) for name in names}


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
