"""Curves of one tracker for every level of a factor, with box plots. Several families show this."""

from collections.abc import Sequence
from dataclasses import asdict

import altair as alt
import polars as pl

from tracknoise.findings.wording import listing, px, sentence_case
from tracknoise.report.figures.box_plot import box_plot
from tracknoise.report.figures.curve_grid import HEIGHT, describe_bands, grid
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Chart, Panel
from tracknoise.report.figures.readings import Reading, readings, when
from tracknoise.report.figures.series import MANY, Series
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.errors.box import box_summary
from tracknoise.tables.enumerations import Trimming

_NAMES = {"mean": "mean error", "second": "root second moment"}
_WIDTHS = {"few": (240, 105), "many": (196, 156)}
"""Widths of a panel of curves and of its box plot, px."""


def comparison(
    data: ReportData,
    points: pl.DataFrame,
    series: Series,
    *,
    id: str,
    title: str,
    shows: str,
    advice: str,
    role: str = "second",
    trimming: Trimming | None = None,
    message: str = "",
) -> Figure | Absence:
    """A figure of the errors that the experiment is about, trimmed or not, unless `trimming` says which.

    Parameters
    ----------
    points
        Curves with one value of everything but `series.field`, trimmed and untrimmed, of every population.
    series
        The factor.
    id, title, shows
        Of the figure. A description of the box plots is added.
    advice
        What to look for, after the numbers.
    role
        Of the statistic whose numbers are stated: mean or second.
    trimming
        By default that of the errors that verdicts are about.
    message
        What the comparison shows, where it is established.
    """
    kept = points.filter(trimming=trimming or data.trimming, population=data.population)
    found = readings(kept, series)
    if not found:
        return Absence(id, title, f"No {data.axis.name} has enough features with a known error, so there is no curve.")
    missing = [label for label in series.colours if label not in {one.name for one in found}]
    no_curve = f" No {data.axis.name} has enough features {series.phrase.format(listing(missing))}."
    dashed = " Dashed: covariance about the mean." if len(series.colours) <= MANY else ""
    return Figure(
        id,
        title,
        f"{shows}{dashed} {describe_bands(kept, series)} {_boxes_explained(data)}",
        f"{_numbers(data, found, series, role)}{no_curve if missing else ''} {advice}",
        _chart(data, kept, series),
        message,
    )


def _chart(data: ReportData, points: pl.DataFrame, series: Series) -> dict[str, object]:
    wide, narrow = _WIDTHS["many" if len(series.present(points).colours) > MANY else "few"]

    def boxes(table: pl.DataFrame, coordinate: str, present: Series, bounds: Sequence[float]) -> Panel:
        return Panel(_boxes(table, coordinate, present, bounds, width=narrow))

    return grid(points, series, data.axis, beside=boxes, width=wide)


def _boxes(table: pl.DataFrame, coordinate: str, series: Series, bounds: Sequence[float], *, width: int) -> Chart:
    """Distribution of a curve's values, without those that are zero by construction."""
    measured = table.filter(pl.col("since") != 0)
    summaries = [
        {series.field: name, **asdict(box_summary(measured.filter(pl.col(series.field) == name)[coordinate]))}
        for name in series.colours
    ]
    scale = alt.Scale(domain=list(bounds), nice=False)
    bare = alt.Y("median:Q", scale=scale, title=None, axis=alt.Axis(labels=False, ticks=False))
    boxes = pl.DataFrame(summaries)
    return box_plot(boxes, field=series.field, colours=series.colours, y=bare, width=width, height=HEIGHT)


def _boxes_explained(data: ReportData) -> str:
    return (
        f"The box plots show the distribution of each curve over all {data.axis.name}s except {data.axis.zero}. "
        "The orange line is the median and the green triangle is the mean. Whiskers reach the last value within 1.5 "
        "interquartile ranges."
    )


def _numbers(data: ReportData, found: list[Reading], series: Series, role: str) -> str:
    """A statistic of every curve, or of the two that differ most where there are many."""
    place = when(found, data.axis, phrase=series.phrase)
    if len(found) <= MANY:
        values = [f"{series.phrase.format(one.name)} {{}} {one.describe(role)}." for one in found]
        first, *others = values
        rest = [f" {sentence_case(text.format('it is'))}" for text in others]
        return f"{place} the {_NAMES[role]} {first.format('is')}{''.join(rest)}"
    if len({reading.since for reading in found}) > 1:
        place = f"At the available {data.axis.name} nearest to {data.axis.place(REFERENCE_AGE).removeprefix('at ')},"
    ends = " and ".join(_range(data, found, series, role, coordinate) for coordinate in (0, 1))
    return f"{place} the {_NAMES[role]} is {ends}."


def _range(data: ReportData, found: list[Reading], series: Series, role: str, coordinate: int) -> str:
    """The curves with the smallest and the largest value in u (0) or v (1), with their ages if these differ."""
    differ = len({reading.since for reading in found}) > 1
    ordered = sorted(found, key=lambda one: one.values[role][coordinate])
    ends = []
    for one in (ordered[0], ordered[-1]):
        place = f", {data.axis.place(one.since)}" if differ else ""
        ends.append(f"{px(one.values[role][coordinate])} ({series.phrase.format(one.name)}{place})")
    return f"in {'uv'[coordinate]} between {listing(ends)}"
