"""Lightings in the order of the sweep that they belong to: their colours, and box plots of them side by side."""

import re

import altair as alt
import polars as pl

from tracknoise.report import style
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures.box_plot import box_plot
from tracknoise.report.figures.layout import Panel, Spec, arranged
from tracknoise.report.sentences import listing

_SWEEPS = {"LR": ("left to right", style.BLUES), "BF": ("back to front", style.REDS)}
_OTHERS = "other light"


def sweeps(evidence: Evidence) -> dict[str, list[str]]:
    """Lightings but the reference, by the direction in which the light wanders: ``LR3`` from left to right."""
    found: dict[str, list[str]] = {title: [] for title in (*(title for title, _ in _SWEEPS.values()), _OTHERS)}
    for name in evidence.lightings:
        if name != evidence.view["lighting"]:
            found[_sweep(name)].append(name)
    return {title: names for title, names in found.items() if names}


def colours(evidence: Evidence, tracker: str) -> dict[str, str]:
    """Colour of each lighting: the reference black, a ramp for every sweep, shades of the tracker's for the others."""
    ramps = dict(_SWEEPS.values())
    chosen = {evidence.view["lighting"]: style.BLACK}
    for title, names in sweeps(evidence).items():
        ends = ramps.get(title)
        made = style.ramp(ends, len(names)) if ends else style.shades(evidence.colour[tracker], len(names))
        chosen |= dict(zip(names, made, strict=True))
    return chosen


def legend(evidence: Evidence) -> str:
    """What the boxes of one lighting are, in the words of a caption."""
    if len(evidence.speeds) < 2:
        return f"at speed {evidence.slowest}"
    return f"a box each for speed {listing(map(str, evidence.speeds))}, the slowest darkest"


def boxes(evidence: Evidence, table: pl.DataFrame, y: alt.Y, *, interval: tuple[str, str, str] | None = None) -> Spec:
    """Box plots by lighting and speed: a row of panels a tracker, a column a sweep that starts from the reference.

    Parameters
    ----------
    table
        Columns lighting, tracker, speed, and those of `box_plot`.
    y
        Axis of the values.
    interval
        As in `box_plot`.
    """
    across = {title: [evidence.view["lighting"], *names] for title, names in sweeps(evidence).items()}
    panels = []
    for tracker in evidence.trackers:
        rows = table.filter(tracker=tracker).with_columns(pl.col("speed").cast(pl.String))
        shades = evidence.speed_colours(tracker)
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
    found = re.fullmatch(r"(LR|BF)\d+", name, flags=re.IGNORECASE)
    return _SWEEPS[found[1].upper()][0] if found else _OTHERS
