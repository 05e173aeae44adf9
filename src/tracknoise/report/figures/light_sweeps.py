"""Lightings in the order of their sweep: colours and box plots."""

import re

import altair as alt
import polars as pl

from tracknoise.report import style
from tracknoise.report.figures.panels import Panel, Spec, arranged, box_plot
from tracknoise.report.report_data import ReportData
from tracknoise.words import listing

_SWEEPS = {"LR": ("left to right", style.PALETTE[0]), "BF": ("back to front", style.PALETTE[1])}
"""Name and colour of each direction in which light moves, by how the names of its lightings begin."""
_OTHERS = "other light"


def sweeps(data: ReportData) -> dict[str, list[str]]:
    """All lightings but the reference, by the direction in which the light moves: ``LR3`` from left to right."""
    by_title: dict[str, list[str]] = {title: [] for title in (*(title for title, _ in _SWEEPS.values()), _OTHERS)}
    for name in data.lightings:
        if name != data.view["lighting"]:
            by_title[_sweep(name)].append(name)
    return {title: names for title, names in by_title.items() if names}


def colours(data: ReportData, tracker: str, sweep: str) -> dict[str, str]:
    """Colour of each lighting of a sweep: black for the reference, then `levels` of a colour."""
    names = sweeps(data)[sweep]
    hues = style.levels(dict(_SWEEPS.values()).get(sweep, data.colour[tracker]), len(names))
    return {data.view["lighting"]: style.BLACK, **dict(zip(names, hues, strict=True))}


def legend(data: ReportData) -> str:
    """Describe the boxes of one lighting, as part of a caption."""
    if len(data.speeds) < 2:
        return f"at speed {data.slowest}"
    return f"one box for each of the speeds {listing(map(str, data.speeds))}, from left to right"


def boxes(data: ReportData, table: pl.DataFrame, y: alt.Y, *, interval: tuple[str, str, str] | None = None) -> Spec:
    """Box plots by lighting and speed: one row of panels per tracker, one column per sweep, reference first.

    `table`: columns lighting, tracker, speed, and those of `box_plot`.
    """
    across = {title: [data.view["lighting"], *names] for title, names in sweeps(data).items()}
    panels = []
    for tracker in data.trackers:
        rows = table.filter(tracker=tracker).with_columns(pl.col("speed").cast(pl.String))
        shades = data.speed_colours(tracker)
        for title, names in across.items():
            title = tracker if len(across) == 1 else f"{tracker}, {title}"
            chosen = rows.filter(pl.col("lighting").is_in(names))
            chart = box_plot(
                chosen,
                field="speed",
                colours=shades,
                y=y,
                width=820 // len(across),
                height=210,
                places=("lighting", names),
                interval=interval,
            )
            panels.append(Panel(chart.properties(title=title)))
    return arranged(panels, columns=len(across), independent=["fill", "stroke", "x", "xOffset"])


def _sweep(name: str) -> str:
    match = re.fullmatch(r"(LR|BF)\d+", name, flags=re.IGNORECASE)
    return _SWEEPS[match[1].upper()][0] if match else _OTHERS
