"""Differences between two trackers at the same corners, by age: their mean and their spread."""

from collections.abc import Sequence

import polars as pl

from tracknoise.findings.wording import DASH, number, px
from tracknoise.report import bands, style
from tracknoise.report.figures.age_panels import panels, side_by_side
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import arranged
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE

_NAME, _TITLE = "between-trackers", "Differences between trackers at the same corners"
_ROWS = {"mean": "mean difference (px)", "central": "standard deviation (px)"}
"""Statistics in the rows of the figure, and what their axes say."""
_MOST_PAIRS = 7


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: every two trackers at the lowest speed."""
    table = data.nominal(data.tracker_differences).filter(pl.col("n") >= data.min_features)
    pair = pl.format("{} " + DASH + " {}", "tracker", "other")
    table = table.with_columns(pl.col("value", "low", "high").pipe(_root), pair=pair)
    pairs = table["pair"].unique(maintain_order=True).to_list()[:_MOST_PAIRS]
    shown = table.filter(pl.col("pair").is_in(pairs))
    points = side_by_side(shown, "value", ["pair", "statistic"])
    if points.is_empty():
        why = f"No two trackers followed the same {data.min_features} corners to any age."
        return [Absence(_NAME, _TITLE, why)]
    colours = dict(zip(pairs, style.colours(pairs), strict=True))
    rows = [
        panel
        for statistic, heading in _ROWS.items()
        for panel in panels(points.filter(statistic=statistic), "pair", colours, heading, titled=statistic == "mean")
    ]
    spec = arranged(rows, columns=2, independent=["fill"])
    return [Figure(_NAME, _TITLE, _shows(data, points), _look_for(points), spec, _message(shown))]


def _message(table: pl.DataFrame) -> str:
    """The mean difference of the first pair that differs at the last age up to the reference age.

    It is established with an interval that allows for all ages and both coordinates.
    """
    means = table.filter(pl.col("age") <= REFERENCE_AGE, statistic="mean")
    last = means.filter(pl.col("age") == pl.col("age").max().over("pair"))
    for row in last.filter("established").to_dicts():
        return f"{row['pair']}: mean difference in {row['coordinate']} of {px(row['value'])}"
    return ""


def _root(value: pl.Expr) -> pl.Expr:
    """Standard deviations in place of variances."""
    return pl.when(pl.col("statistic") == "central").then(value.clip(lower_bound=0.0).sqrt()).otherwise(value)


def _shows(data: ReportData, points: pl.DataFrame) -> str:
    return (
        f"Difference of the positions of two trackers at speed {data.slowest}{data.where}, where both began a track at "
        "the same corner of the same frame, by age. Top: mean of the first less the second. Bottom: standard "
        f"deviation. {bands.describe_intervals(points, of='the curves')}"
    )


def _look_for(points: pl.DataFrame) -> str:
    sentences = " ".join(_numbers(pair, part) for (pair,), part in points.group_by("pair", maintain_order=True))
    return (
        f"{sentences} An error of poses, depth, calibration or clock is in neither. A mean that differs from zero is "
        "therefore a bias of one of the two trackers. What both have in common is not in the difference."
    )


def _numbers(pair: object, points: pl.DataFrame) -> str:
    """Mean and standard deviation at the last age up to the reference age."""
    young = points.filter(pl.col("at") <= REFERENCE_AGE)
    at = young["at"].max() if young.height else points["at"].min()
    mean, spread = (points.filter(statistic=name, at=at).row(0, named=True) for name in _ROWS)
    return (
        f"For {pair} at age {number(at)}, the mean is {px(mean['u'])} in u and {px(mean['v'])} in v. "  # type: ignore[arg-type]
        f"The standard deviation is {px(spread['u'])} in u and {px(spread['v'])} in v."
    )
