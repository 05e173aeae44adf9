"""The table of `tracknoise effects` as text: one row per effect and size, one table per tracker and age."""

from collections.abc import Iterator, Mapping
from typing import Any

import polars as pl

from tracknoise.findings.wording import DASH, MINUS
from tracknoise.report.cells import Cells
from tracknoise.tables.effects_schema import EffectStatistic

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
