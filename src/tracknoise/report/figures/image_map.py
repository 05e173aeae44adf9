"""Mean error in each cell of the image: one map per age."""

from collections.abc import Sequence

import altair as alt
import numpy as np
import polars as pl

from tracknoise.findings.wording import SPACE, TIMES, count, number, sentence_case
from tracknoise.report import style
from tracknoise.report.bands import describe_intervals
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import MAP_COLUMNS, MAP_ROWS

_WIDTH = 420
_FEWEST = 5
"""Cells with fewer errors than this are left out."""
_LONGEST = 1.6
"""Arrows are drawn no longer than this, cells."""
_ROUND = (1.0, 2.0, 5.0, 10.0)
_GUIDE = (
    "Arrows that point towards the centre or away from it, and grow with the distance from it, suggest a wrong focal "
    "length or lens under motion along the optical axis. Arrows whose component along the motion changes from the top "
    "of the image to its bottom suggest a rolling shutter. Arrows along the motion everywhere suggest a clock offset, "
    "or a wrong focal length under rotation. Scattered arrows at objects suggest the tracker itself, at depth edges "
    "for example. If all trackers have the same arrows, suspect the truth."
)


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, at the lowest speed."""
    return [_figure(data, tracker) for tracker in data.trackers]


def _figure(data: ReportData, tracker: str) -> Figure | Absence:
    name, title = f"image-map-{data.slug(tracker)}", f"{tracker}, by place in the image"
    every = data.nominal(data.image_cells).filter(pl.col("tracker") == tracker)
    enough = pl.col("n").sum().over("at") >= data.min_features
    cells = every.filter(enough).filter(pl.col("n") >= _FEWEST)
    if cells.is_empty():
        return Absence(name, title, f"No age has {data.min_features} features with a known error.")
    ages = cells["at"].unique().sort().to_list()
    bounded = cells.filter(pl.col("differs").is_not_null()).rename({"n_scenes": "n_resampled"})
    shows = (
        f"Untrimmed errors of visible features at speed {data.slowest}{data.where}, in {MAP_COLUMNS}{SPACE}{TIMES}"
        f"{SPACE}{MAP_ROWS} cells of the image. An arrow shows the direction and size of the mean error; the length of "
        f"one cell is stated above each map. Arrows are cut at {_LONGEST} cells. The larger a disc is, the larger the "
        f"spread of the errors. The darker a cell is drawn, the more features it has; cells with fewer than {_FEWEST} "
        "are left out. An outlined cell has a mean that differs from zero. "
        f"{describe_intervals(bounded, of='the means', marks='Outlines by')}"
    )
    panels = [_panel(data, cells.filter(at=at), tracker, at) for at in ages]
    look_for = f"{_outlined(data, bounded, ages)} {_GUIDE}"
    spec = arranged(panels, columns=2, independent=["opacity", "size"])
    return Figure(name, title, shows, look_for, spec, _message(tracker, bounded.filter(at=ages[0])))


def _message(tracker: str, cells: pl.DataFrame) -> str:
    """In how many cells the mean differs from zero, where these are more than by chance."""
    differing = int(cells["differs"].sum())
    by_chance = (1 - cells["level"][0]) * cells.height if cells.height else 0.0
    if differing <= by_chance + max(by_chance, 3 * np.sqrt(by_chance)):
        return ""
    return f"{tracker} has a mean error in {differing} of {cells.height} places of the image"


def _outlined(data: ReportData, bounded: pl.DataFrame, ages: Sequence[int]) -> str:
    parts = []
    for at in ages:
        differs = bounded.filter(at=at)["differs"]
        if differs.len():
            place = data.axis.opening_place(data.since_zero(at))
            parts.append(f"{place}, {count(int(differs.sum()), 'cell')} of {differs.len()} differ from zero.")
    by_chance = f"By chance, about {100 * (1 - bounded['level'][0]):g}{SPACE}% would." if parts else ""
    return " ".join([*parts, by_chance]) or "No cell has an interval, because too little can be resampled."


def _panel(data: ReportData, cells: pl.DataFrame, tracker: str, at: int) -> Panel:
    unit_px = _cell_px(cells)
    table = _drawn(cells, unit_px)
    base = alt.Chart(marks.rows(table))
    colour = data.colour[tracker]
    opacity = alt.Opacity("n:Q", scale=alt.Scale(type="sqrt", range=[0.25, 1.0]), legend=None)
    x = alt.X("x:Q", scale=alt.Scale(domain=[0, MAP_COLUMNS], nice=False), axis=None)
    y = alt.Y("y:Q", scale=alt.Scale(domain=[MAP_ROWS, 0], nice=False), axis=None)
    tips = [alt.Tooltip(f"{name}:Q") for name in ("n", "mean_u_px", "mean_v_px", "spread_px")]
    size = alt.Size("radius:Q", scale=alt.Scale(type="pow", exponent=2, range=[0, 330], domain=[0, 1]), legend=None)
    disc = base.mark_point(filled=True, shape="circle", color=style.QUIET, strokeWidth=0, clip=True)
    disc = disc.encode(x=x, y=y, size=size, opacity=alt.Opacity("faint:Q", scale=None, legend=None), tooltip=tips)
    shaft = base.mark_rule(color=colour, strokeWidth=1.6, clip=True)
    shaft = shaft.encode(x=x, y=y, x2=alt.X2("to_x:Q"), y2=alt.Y2("to_y:Q"), opacity=opacity)
    turned = alt.Angle("angle:Q", scale=alt.Scale(domain=[-180, 180], range=[-180, 180]))
    head = base.mark_point(filled=True, shape="triangle-up", color=colour, size=28, clip=True)
    head = head.encode(x=_on(x, "to_x"), y=marks.on(y, "to_y"), angle=turned, opacity=opacity)
    entries = list(data.sequences.values())
    height = round(_WIDTH * entries[0].height / entries[0].width) if entries else _WIDTH
    title = sentence_case(f"{data.axis.place(data.since_zero(at))}: one cell is {number(unit_px)}{SPACE}px")
    chart = layered(disc, *_outlines(table, colour, x, y), shaft, head)
    frame = alt.ViewBackground(stroke=style.QUIET)
    return Panel(chart.properties(width=_WIDTH, height=height, title=alt.Title(title, color=style.INK), view=frame))


def _outlines(table: pl.DataFrame, colour: str, x: alt.X, y: alt.Y) -> list[alt.Chart]:
    """Rectangles around the cells whose mean differs from zero."""
    differing = table.filter(pl.col("differs").fill_null(value=False))
    if differing.is_empty():
        return []
    corners = differing.select("left", "right", "top", "bottom")
    box = alt.Chart(marks.rows(corners)).mark_rect(filled=False, stroke=colour, strokeWidth=1.1)
    encoded: alt.Chart = box.encode(x=_on(x, "left"), x2=alt.X2("right:Q"), y=marks.on(y, "top"), y2=alt.Y2("bottom:Q"))
    return [encoded]


def _cell_px(cells: pl.DataFrame) -> float:
    """Round length of the mean error that is drawn as one cell: nine of ten arrows are not longer."""
    length = (pl.col("mean_u_px").pow(2) + pl.col("mean_v_px").pow(2)).sqrt()
    most = cells.select(length.quantile(0.9)).item()
    if not most:
        return 1.0
    power = 10.0 ** np.floor(np.log10(most))
    return float(next(step * power for step in _ROUND if step * power >= most * (1 - 1e-9)))


def _drawn(cells: pl.DataFrame, unit_px: float) -> pl.DataFrame:
    """Positions, in cells, of what is drawn; discs of the largest tenth of the spreads are of one size."""
    u, v = pl.col("mean_u_px"), pl.col("mean_v_px")
    length = (u.pow(2) + v.pow(2)).sqrt() / unit_px
    factor = (_LONGEST / length.clip(lower_bound=1e-12)).clip(upper_bound=1.0) / unit_px
    widest = float(cells["spread_px"].quantile(0.9) or 1.0)
    share = (pl.col("n") / pl.col("n").max()).sqrt()
    return cells.select(
        "n", "mean_u_px", "mean_v_px", "spread_px", "differs",
        left=pl.col("column") + 0.04, right=pl.col("column") + 0.96,
        top=pl.col("row") + 0.04, bottom=pl.col("row") + 0.96,
        x=pl.col("column") + 0.5, y=pl.col("row") + 0.5,
        to_x=pl.col("column") + 0.5 + u * factor, to_y=pl.col("row") + 0.5 + v * factor,
        angle=pl.arctan2(u, -v).degrees(),
        radius=(pl.col("spread_px") / widest).clip(upper_bound=1.0), faint=0.06 + 0.2 * share,
    )  # fmt: skip


def _on(x: alt.X, column: str) -> alt.X:
    """The same axis for another column."""
    placed = x.copy()
    placed.shorthand = f"{column}:Q"
    return placed
