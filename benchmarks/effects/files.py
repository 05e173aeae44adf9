"""The table and the figure of `python -m benchmarks.effects`, as text and as files.

- The table of `python -m benchmarks.effects` as text: one row per effect and size, one table per tracker and age.
- Changes by effects of cameras and faults of the truth: one panel per statistic, one line per effect.
- Files of `python -m benchmarks.effects`: the table as CSV and Markdown, the figure as SVG and PNG.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import altair as alt
import polars as pl

from benchmarks.effects.schema import EFFECT_UNITS, EffectStatistic, Size
from tracknoise.report import style
from tracknoise.report.cells import Cells
from tracknoise.report.figure_files import render, specification
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Figure
from tracknoise.report.figures.panels import Panel, layered
from tracknoise.report.figures.panels import arranged as arrange
from tracknoise.report.table_files import to_csv
from tracknoise.tables.files import write_atomically
from tracknoise.words import DASH, MINUS, listing

_HEADINGS = {
    EffectStatistic.mean_u: "mean u (px)",
    EffectStatistic.mean_v: "mean v (px)",
    EffectStatistic.second_moment: "second moment (px²)",
    EffectStatistic.core: "core (px)",
    EffectStatistic.lifetime: "lifetime (frames)",
    EffectStatistic.outlier_ratio: "outlier ratio (%)",
}
_DECIMALS = {**dict.fromkeys(EffectStatistic, 3), EffectStatistic.lifetime: 1, EffectStatistic.outlier_ratio: 2}
_PERCENT = 100.0


def effect_cells(changes: pl.DataFrame, *, level: float) -> Iterator[Cells]:
    """Tables of changes, with half the width of their intervals.

    Parameters
    ----------
    changes
        Schema `EFFECT_CHANGES`.
    level
        Of the intervals.
    """
    for tracker, age in _distinct(changes, ["tracker", "age"]):
        table = changes.filter(tracker=tracker, age=age)
        effects = _distinct(table, ["effect", "size", "shown"])
        n_scenes = int(table["n_scenes"].to_numpy().max())
        rows = [[*names, *_values(table.filter(effect=names[0], size=names[1]), n_scenes)] for names in effects]
        clean = table.sort("n_scenes", descending=True, maintain_order=True).unique("statistic", keep="first")
        fewer = " [n]: mean over the n scenes that have both values." if (table["n_scenes"] < n_scenes).any() else ""
        yield Cells(
            f"{tracker}: change at age {age} by each effect alone (mean over {n_scenes} scenes, ± half the "
            f"{level:.0%} interval; * where it excludes 0). The first row has the values without effects.{fewer}",
            ["effect", "size", "", *_HEADINGS.values()],
            [["none", "", "", *_clean(clean, n_scenes)], *rows],
            [False, False, False, *[True] * len(_HEADINGS)],
        )


def _distinct(table: pl.DataFrame, columns: list[str]) -> list[tuple[Any, ...]]:
    return table.select(columns).unique(maintain_order=True).rows()


def markdown(cells: Cells) -> str:
    """A table in Markdown, with its caption above it."""
    rules = ["--:" if right else "---" for right in cells.numeric]
    escaped = [[text.replace("|", "\\|") for text in row] for row in (cells.headings, rules, *cells.rows)]
    lines = [f"| {' | '.join(row)} |" for row in escaped]
    return "\n".join([cells.caption, "", *lines, ""])


def _values(part: pl.DataFrame, n_scenes: int) -> list[str]:
    rows = {row["statistic"]: row for row in part.to_dicts()}
    return [_change(name, rows[name]) + _of_fewer(rows[name], n_scenes) for name in _HEADINGS]


def _clean(table: pl.DataFrame, n_scenes: int) -> list[str]:
    rows = {row["statistic"]: row for row in table.to_dicts()}
    return [_scaled(name, rows[name]["clean"]) + _of_fewer(rows[name], n_scenes) for name in _HEADINGS]


def _of_fewer(row: Mapping[str, Any], n_scenes: int) -> str:
    """Number of scenes that a value is of, where it is of some only."""
    return f" [{row['n_scenes']}]" if 0 < row["n_scenes"] < n_scenes else ""


def _change(name: EffectStatistic, row: Mapping[str, float | None]) -> str:
    change, low, high = row["change"], row["change_low"], row["change_high"]
    if change is None:
        return DASH
    text = ("+" if change > 0 else "") + _scaled(name, change)
    if low is None or high is None:
        return text
    sure = " *" if low > 0 or high < 0 else ""
    return f"{text} ± {_scaled(name, (high - low) / 2)}{sure}"


def _scaled(name: EffectStatistic, value: float | None) -> str:
    """Value with the decimals of its column."""
    if value is None:
        return DASH
    factor = _PERCENT if name == EffectStatistic.outlier_ratio else 1.0
    return f"{value * factor:.{_DECIMALS[name]}f}".replace("-", MINUS)


_WIDTH, _LINE = 230, 34
_DIAMETERS = {Size.low: 14, Size.usual: 34, Size.bad: 70}
_TITLES = {
    EffectStatistic.mean_u: "mean error in u",
    EffectStatistic.mean_v: "mean error in v",
    EffectStatistic.second_moment: "second moment",
    EffectStatistic.core: "core",
    EffectStatistic.lifetime: "median lifetime",
    EffectStatistic.outlier_ratio: "outlier ratio",
}
_LINEAR_PART = {
    EffectStatistic.mean_u: 0.05,
    EffectStatistic.mean_v: 0.05,
    EffectStatistic.second_moment: 0.05,
    EffectStatistic.core: 0.05,
    EffectStatistic.lifetime: 1.0,
    EffectStatistic.outlier_ratio: 0.005,
}
"""Changes up to about this size are drawn to a linear scale, larger ones to a logarithmic one."""


def effect_sizes(changes: pl.DataFrame) -> Figure:
    """The figure of `python -m benchmarks.effects`. `changes`: schema `EFFECT_CHANGES`, of one age."""
    trackers = changes["tracker"].unique(maintain_order=True).to_list()
    colours = dict(zip(trackers, style.colours(trackers), strict=True))
    effects = changes["effect"].unique(maintain_order=True).to_list()
    shown = (marks.shown("tracker", colours),)
    panels = [
        Panel(_panel(changes.filter(statistic=name), name, effects, colours), shown, layer=2)
        for name in EffectStatistic
    ]
    return Figure(
        id="effects",
        title="Effects of cameras and faults of the truth",
        shows=f"Change of each statistic by each effect alone, for {listing(trackers)}. Points are means over scenes; "
        "their area stands for the size: low, usual, bad. Lines are intervals. Scales are linear near 0 and "
        "logarithmic beyond.",
        look_for="Effects whose intervals exclude 0 change what is measured.",
        spec=arrange(panels, columns=3),
    )


def _panel(
    table: pl.DataFrame, name: EffectStatistic, effects: Sequence[str], colours: Mapping[str, str]
) -> alt.LayerChart:
    slots = [f"{size} {tracker}" for size in Size for tracker in colours]
    columns = ["effect", "size", "shown", "tracker", "change", "change_low", "change_high"]
    known = table.select(columns).drop_nulls("change")
    drawn = known.with_columns(slot=pl.format("{} {}", "size", "tracker"))
    base = alt.Chart(marks.rows(drawn)).encode(
        y=alt.Y("effect:N", sort=list(effects), title=None, scale=alt.Scale(domain=list(effects))),
        yOffset=alt.YOffset("slot:N", sort=slots, scale=alt.Scale(domain=slots)),
        color=marks.colour("tracker", colours, "tracker"),
        opacity=marks.opacity("tracker"),
        tooltip=[alt.Tooltip(f"{column}:N" if column in columns[:4] else f"{column}:Q") for column in columns],
    )
    scale = alt.Scale(type="symlog", constant=_LINEAR_PART[name])
    unit = "" if EFFECT_UNITS[name] == "1" else f" ({EFFECT_UNITS[name]})"
    axis = alt.Axis(format=".2~r", tickCount=5)
    x = alt.X("change:Q", title=f"change of {_TITLES[name]}{unit}", scale=scale, axis=axis)
    areas = alt.Scale(domain=[str(size) for size in Size], range=list(_DIAMETERS.values()))
    zero = alt.Chart(alt.InlineData(values=[{"change": 0}])).mark_rule(color=style.QUIET, strokeWidth=0.8).encode(x=x)
    bars = base.mark_rule().encode(x=alt.X("change_low:Q", scale=scale), x2=alt.X2("change_high:Q"))
    points = base.mark_point(filled=True).encode(
        x=x, size=alt.Size("size:N", scale=areas, sort=None, legend=alt.Legend(title="size"))
    )
    return layered(zero, bars, points).properties(width=_WIDTH, height=_LINE * len(effects))


_FORMATS = ("svg", "png")


def write_effects(folder: Path, changes: pl.DataFrame, *, level: float) -> list[Path]:
    """Write ``effects.csv``, ``effects.md``, ``effects.svg`` and ``effects.png``.

    Parameters
    ----------
    folder
        Where.
    changes
        Schema `EFFECT_CHANGES`. The figure shows its first age.
    level
        Of the intervals.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    StoreError
        If they cannot be written.
    """
    text = "\n".join(map(markdown, effect_cells(changes, level=level)))
    figure = effect_sizes(changes.filter(age=changes["age"].first()))
    drawn = render(specification(figure), _FORMATS)
    contents = {"csv": to_csv(changes).encode(), "md": text.encode(), **drawn}
    paths = {folder / f"effects.{ending}": content for ending, content in contents.items()}
    for path, content in paths.items():
        write_atomically(path, content)
    return list(paths)
