"""Trackers ranked: which are shown to differ, and what accuracy costs.

- Ranks by typical error, RMS, lifetime and outlier ratio, where three or more trackers are compared.
- What to set in an estimator against the CPU time of a step, where a tournament measured it.
"""

from collections.abc import Mapping, Sequence

import altair as alt
import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.report.answer import noise_to_set
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure, Sections
from tracknoise.report.figures.panels import Panel, arranged, layered
from tracknoise.report.leaderboard import TITLES, leaderboard, roles_of
from tracknoise.report.report_data import ReportData
from tracknoise.report.style import PAPER, QUIET
from tracknoise.tables.costs import read_costs
from tracknoise.topics.answer_summary import NoiseToSet
from tracknoise.topics.factor_topic import ranks_by_role
from tracknoise.words import listing

_RANKING, _COST = "ranking", "cost-of-trackers"
_PANEL_WIDTH, _ROW_HEIGHT = 150, 22
_COST_SIZE = (520, 320)
_MOST_NAMED = 4
"""Trackers that the title of the plot names."""
_LETTER_PX, _LINE_PX = 7.0, 12.0
_STEPS_PX = (0.0, 12.0, -12.0, 24.0, -24.0, 36.0, -36.0)
"""Moves of a label that are tried."""


def ranking_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """Ranges of ranks, a panel for each statistic."""
    ranks, board = ranks_by_role(data), leaderboard(data)
    if board is None:
        return []
    order, roles = [one.tracker for one in board.rows], roles_of(ranks)
    panels = [Panel(_span_chart(ranks.filter(role=role), order, data.colour, first=role == roles[0])) for role in roles]
    best = {role: ranks.filter(role=role, best=1)["tracker"].to_list() for role in roles}
    told = [f"By {TITLES[role]}: {listing(names)}." for role, names in best.items() if len(names) < len(order)]
    return [
        Figure(
            _RANKING,
            "Ranks of trackers",
            f"A bar goes from the best to the worst rank that a tracker may have. {board.reading} Every two trackers "
            "are compared within scenes.",
            f"Trackers of rank 1. {' '.join(told)}" if told else "No tracker is shown to be better than another.",
            arranged(panels, columns=len(panels)),
            _message(best.get("core", []), len(order)),
        )
    ]


def _message(best: Sequence[str], n: int) -> str:
    """Which trackers have the smallest typical error, where these are fewer than all."""
    if not 0 < len(best) < n:
        return ""
    if len(best) == 1:
        return f"{best[0]} has the smallest typical error of {n} trackers"
    first = listing(best) if len(best) <= 3 else f"{len(best)} of {n} trackers"
    return f"{first} share rank 1 in typical error"


def _span_chart(ranks: pl.DataFrame, order: Sequence[str], colours: Mapping[str, str], *, first: bool) -> alt.Chart:
    title = TITLES[ranks["role"][0]]
    bars = ranks.select("tracker", low=pl.col("best") - 0.4, high=pl.col("worst") + 0.4, best="best", worst="worst")
    highest = max(ranks["n_trackers"].to_list())
    scale = alt.Scale(domain=[0.5, highest + 0.5], nice=False)
    axis = alt.Axis(tickMinStep=1, format="d")
    names = alt.Axis(labelLimit=160) if first else None
    chart = alt.Chart(marks.rows(bars), title=title, width=_PANEL_WIDTH, height=_ROW_HEIGHT * len(order))
    drawn: alt.Chart = chart.mark_bar(height=10).encode(
        x=alt.X("low:Q", scale=scale, axis=axis, title="rank"),
        x2="high:Q",
        y=alt.Y("tracker:N", sort=list(order), title=None, axis=names),
        color=alt.Color("tracker:N", scale=marks.scale(colours), legend=None),
        tooltip=["tracker:N", "best:Q", "worst:Q"],
    )
    return drawn


def cost_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """What to set against the cost of a step."""
    settings = list(noise_to_set(data))
    sigmas = {setting.tracker: setting.sigma.value for setting in settings if setting.sigma.value}
    costs = {name: cost for name, cost in read_costs(data.run).items() if cost > 0.0}
    trackers = [name for name in data.trackers if name in sigmas and name in costs]
    if not trackers:
        return []
    points = pl.DataFrame(
        {"tracker": trackers, "ms": [costs[name] for name in trackers], "px": [sigmas[name] for name in trackers]},
        schema={"tracker": pl.String, "ms": pl.Float64, "px": pl.Float64},
    ).sort("ms", "px")
    front = points.filter(pl.col("px") < pl.col("px").cum_min().shift(1).fill_null(float("inf")))
    names = front["tracker"].to_list()
    return [
        Figure(
            _COST,
            "Accuracy against cost",
            "What to set in an estimator against the CPU time of a step on this machine, of each tracker alone, in the "
            f"first frames of one sequence. The line joins trackers that no other one beats in both.{_bound(settings)}",
            f"No tracker is both cheaper and more accurate than {listing(names)}.",
            arranged([Panel(_cost_chart(points, front, data.colour))], columns=1),
            f"No tracker is cheaper and more accurate than {listing(names)}" if len(names) <= _MOST_NAMED else "",
        )
    ]


def _bound(settings: Sequence[NoiseToSet]) -> str:
    return (
        " The truth is not trusted: each sigma is an upper bound."
        if any(setting.is_bound for setting in settings)
        else ""
    )


def _cost_chart(points: pl.DataFrame, front: pl.DataFrame, colours: Mapping[str, str]) -> alt.LayerChart:
    width, height = _COST_SIZE
    ms, px = points["ms"].to_numpy(), points["px"].to_numpy()
    (left, most), (low, high) = (0.8 * ms.min(), 2.5 * ms.max()), (0.7 * px.min(), 1.2 * px.max())
    across, upward = (alt.Scale(type="log", domain=ends, nice=False) for ends in ([left, most], [low, high]))
    right, up = width * np.log(ms / left) / np.log(most / left), height * np.log(px / low) / np.log(high / low)
    label = up + _apart(right, up, points["tracker"].to_list())
    points = points.with_columns(label=pl.Series(low * (high / low) ** (label / height)))
    x = alt.X("ms:Q", title="CPU time of a step, ms", scale=across)
    y = alt.Y("px:Q", title="sigma to set, px", scale=upward)
    colour = alt.Color("tracker:N", scale=marks.scale(colours), legend=None)
    base = alt.Chart(marks.rows(points), width=width, height=height)
    line = alt.Chart(marks.rows(front)).mark_line(interpolate="step-after", color="gray", strokeDash=[4, 3])
    named = base.encode(x=x, y=alt.Y("label:Q", scale=upward), text="tracker:N")
    names = named.mark_text(align="left", dx=8, fontSize=12)
    halo = named.mark_text(align="left", dx=8, fontSize=12, stroke=PAPER, strokeWidth=4, strokeJoin="round")
    points_drawn = base.mark_circle(size=70).encode(x=x, y=y, color=colour, tooltip=["tracker:N", "ms:Q", "px:Q"])
    moved = alt.Chart(marks.rows(points.filter(pl.col("label") != pl.col("px")))).mark_rule(color=QUIET, opacity=0.5)
    to_name = moved.encode(x=x, y=y, y2="label:Q")
    return layered(line.encode(x=x, y=y), to_name, halo, points_drawn, names)  # lines may pass behind a name


def _apart(right: NDArray[np.float64], up: NDArray[np.float64], names: Sequence[str]) -> NDArray[np.float64]:
    """How far labels (n,) beside points are moved up, px, so that they do not cover each other or points."""
    moved, taken = np.zeros(len(names)), [(x - 5.0, x + 5.0, y) for x, y in zip(right, up, strict=True)]
    for place, name in enumerate(names):
        start, end = right[place] + 8.0, right[place] + 8.0 + _LETTER_PX * len(name)
        free = (
            step
            for step in _STEPS_PX
            if not any(a < end and start < b and abs(y - up[place] - step) < _LINE_PX for a, b, y in taken)
        )
        moved[place] = next(free, 0.0)
        taken.append((start, end, up[place] + moved[place]))
    return moved


FIGURES: Sections = {"error-by-tracker": (ranking_figures, cost_figures)}
"""What this module draws, by the section of the report."""
