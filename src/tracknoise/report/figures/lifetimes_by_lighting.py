"""Track lifetimes under each lighting, as box plots."""

from dataclasses import asdict

import altair as alt
import polars as pl

from tracknoise.findings.wording import number
from tracknoise.report.figures import light_sweeps
from tracknoise.report.figures.figure import Figure
from tracknoise.report.figures.message import effect
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.errors.box import box_of_counts

_FRAMES = alt.Axis(values=[first * 10**power for power in range(5) for first in (1, 2, 5)], format="~d")
_KEYS = ["tracker", "speed", "lighting"]


def figures(data: ReportData) -> list[Figure]:
    """One figure. None where there is only one lighting."""
    if len(data.lightings) < 2:
        return []
    table = boxes(data)
    longest = max([2.0, *table["upper_whisker"], *table["mean"]])
    scale = alt.Scale(type="log", domain=[0.9, 1.1 * longest], nice=False)
    y = alt.Y("median:Q", scale=scale, title="lifetime (frames that the tracker saw)", axis=_FRAMES)
    figure = Figure(
        id="lifetimes-by-lighting",
        title="Lifetimes by lighting",
        shows=f"Lifetimes of all tracks under every lighting{data.elsewhere('lighting')}, "
        f"{light_sweeps.legend(data)} (logarithmic). The box spans the quartiles. The orange line is the median and "
        "the green triangle is the mean. Whiskers reach the last lifetime within 1.5 interquartile ranges. A censored "
        "track counts as if it had ended with its sequence.",
        look_for=_look_for(data, table),
        spec=light_sweeps.boxes(data, table, y),
        message=effect(data, "lighting", data.trackers[0], speed=data.slowest, roles=("lifetime",)),
    )
    return [figure]


def boxes(data: ReportData) -> pl.DataFrame:
    """Columns tracker, speed, lighting and those of a box of lifetimes."""
    table = data.across(data.lifetimes, "lighting").with_columns(n=pl.col("n_ended") + pl.col("n_censored"))
    groups = table.group_by(_KEYS).agg("lifetime", "n").sort(_KEYS)
    made = [asdict(box_of_counts(row["lifetime"], row["n"])) for row in groups.iter_rows(named=True)]
    return groups.select(_KEYS).hstack(pl.DataFrame(made))


def _look_for(data: ReportData, table: pl.DataFrame) -> str:
    parts = []
    for tracker in data.trackers:
        rows = table.filter(tracker=tracker, speed=data.slowest).sort("mean")
        if rows.height:
            ends = [rows.row(place, named=True) for place in (0, -1)]
            lived = " to ".join(f"{number(row['mean'])} frames under {row['lighting']}" for row in ends)
            parts.append(f"the mean lifetime of {tracker} ranges from {lived}")
    return f"At speed {data.slowest}, {'; '.join(parts)}."
