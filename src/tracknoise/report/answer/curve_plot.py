"""Error by age on the first screen: RMS of every tracker in u and v, as SVG that stands in the page."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import polars as pl
from markupsafe import Markup

from tracknoise.report.report_data import ReportData

WIDTH, HEIGHT = 268, 132
_LEFT, _RIGHT, _TOP, _BOTTOM = 34, 6, 16, 20
_TICKS = 4


@dataclass(frozen=True, slots=True)
class _Axes:
    """Places of ages and errors in one panel, px."""

    first: float
    last: float
    most: float

    def x(self, at: float) -> float:
        return _LEFT + (WIDTH - _LEFT - _RIGHT) * (at - self.first) / ((self.last - self.first) or 1.0)

    def y(self, value: float) -> float:
        return HEIGHT - _BOTTOM - (HEIGHT - _TOP - _BOTTOM) * min(max(value, 0.0), self.most) / self.most


def curves(data: ReportData) -> list[Markup]:
    """Panels of u and v; empty where there are no curves, or where points are fitted to the tracks."""
    points = data.nominal(data.points).filter(role="second", trimming=data.trimming, population=data.population)
    if points.is_empty() or data.truth_is_fitted:
        return []
    axes = _axes(points)
    return [_panel(data, points.sort("at"), axes, coordinate) for coordinate in "uv"]


def curves_caption(data: ReportData) -> str:
    """What the panels show."""
    return f"RMS error by {data.axis.name}; bands are intervals. Colours are those of the cards."


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
    title = f"RMS error in {coordinate} (px) by {data.axis.name}"
    return Markup(
        '<svg class="curves" role="img" aria-label="{title}: one curve per tracker, with intervals as bands" '
        'viewBox="0 0 {width} {height}">{parts}<text x="2" y="10" class="title">{title}</text></svg>'
    ).format(title=title, width=WIDTH, height=HEIGHT, parts=Markup("").join(parts))


def _grid(axes: _Axes) -> list[Markup]:
    lines = [
        Markup(
            '<line class="axis" x1="{left}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>'
            '<text x="{text}" y="{base:.1f}" text-anchor="end">{label}</text>'
        ).format(left=_LEFT, right=WIDTH - _RIGHT, y=axes.y(v), text=_LEFT - 4, base=axes.y(v) + 3.5, label=f"{v:g}")
        for v in _round_steps(0.0, axes.most)
    ]
    ages = [
        Markup('<text x="{x:.1f}" y="{y}" text-anchor="middle">{label}</text>').format(
            x=axes.x(at), y=HEIGHT - 6, label=f"{at:g}"
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
