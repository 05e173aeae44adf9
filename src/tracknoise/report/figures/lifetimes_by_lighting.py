"""How long tracks live under each lighting, as box plots."""

from dataclasses import asdict

import altair as alt
import polars as pl

from tracknoise.findings.wording import number
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures import light_sweeps
from tracknoise.report.figures.figure import Figure
from tracknoise.statistics.box import box_of_counts

_FRAMES = alt.Axis(values=[first * 10**power for power in range(5) for first in (1, 2, 5)], format="~d")
_KEYS = ["tracker", "speed", "lighting"]


def figures(evidence: Evidence) -> list[Figure]:
    """One figure; none where there is one lighting."""
    if len(evidence.lightings) < 2:
        return []
    table = boxes(evidence)
    longest = max([2.0, *table["upper_whisker"], *table["mean"]])
    scale = alt.Scale(type="log", domain=[0.9, 1.1 * longest], nice=False)
    y = alt.Y("median:Q", scale=scale, title="lifetime (frames its tracker saw)", axis=_FRAMES)
    figure = Figure(
        id="lifetimes-by-lighting",
        title="Lifetimes by lighting",
        shows=f"Lifetimes of all tracks under every lighting{evidence.elsewhere('lighting')}, "
        f"{light_sweeps.legend(evidence)} (logarithmic): box from the first to the third quartile, orange line the "
        "median, green triangle the mean, whiskers to the last lifetime within 1.5 interquartile ranges; a track that "
        "the end of its sequence cut short counts as if it had ended there.",
        look_for=_look_for(evidence, table),
        spec=light_sweeps.boxes(evidence, table, y),
    )
    return [figure]


def boxes(evidence: Evidence) -> pl.DataFrame:
    """Columns tracker, speed, lighting and those of a box of lifetimes."""
    table = evidence.across(evidence.lifetimes, "lighting").with_columns(n=pl.col("n_ended") + pl.col("n_censored"))
    groups = table.group_by(_KEYS).agg("lifetime", "n").sort(_KEYS)
    made = [asdict(box_of_counts(row["lifetime"], row["n"])) for row in groups.iter_rows(named=True)]
    return groups.select(_KEYS).hstack(pl.DataFrame(made))


def _look_for(evidence: Evidence, table: pl.DataFrame) -> str:
    parts = []
    for tracker in evidence.trackers:
        rows = table.filter(tracker=tracker, speed=evidence.slowest).sort("mean")
        if rows.height:
            ends = [rows.row(place, named=True) for place in (0, -1)]
            told = " to ".join(f"{number(row['mean'])} frames under {row['lighting']}" for row in ends)
            parts.append(f"a track of {tracker} lives from {told} on average")
    return f"At speed {evidence.slowest}, {'; '.join(parts)}."
