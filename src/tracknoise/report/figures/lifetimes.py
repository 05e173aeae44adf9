"""How long tracks live: histogram and Kaplan-Meier survival, side by side."""

from collections.abc import Mapping, Sequence
from typing import Any

import altair as alt
import polars as pl

from tracknoise.findings.wording import count, number, percent
from tracknoise.report.bands import of_scalar, told
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures import lifetimes_by_lighting, marks
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.figures.layout import Panel, Spec, arranged
from tracknoise.statistics.lifetimes import mean_lifetime, median_survival
from tracknoise.tables.schema import LIFETIMES

_SIZE: dict[str, Any] = {"width": 385, "height": 240}
_LIFETIME = alt.X("lifetime:Q", title="lifetime (frames its tracker saw)", axis=alt.Axis(tickMinStep=1))
_SHARE = alt.Y("survival:Q", scale=alt.Scale(domain=[0, 1]), title="share of tracks that live longer")


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """Trackers at the lowest speed, then the speeds of each tracker where there are several."""
    table = of_scalar(evidence.reference(evidence.lifetimes), evidence.intervals, "survival")
    nominal = table.filter(speed=evidence.slowest)
    if nominal.is_empty():
        return [Absence("lifetimes", "Lifetimes", "No tracker found a feature, so no track has a lifetime.")]
    made: list[Figure | Absence] = [_by_tracker(evidence, nominal)]
    if len(evidence.speeds) > 1:
        made += [_by_speed(evidence, table, tracker) for tracker in evidence.trackers]
    return [*made, *lifetimes_by_lighting.figures(evidence)]


def _by_tracker(evidence: Evidence, nominal: pl.DataFrame) -> Figure:
    table = nominal.with_columns(series=pl.col("tracker"))
    return Figure(
        id="lifetimes",
        title=f"Lifetimes at speed {evidence.slowest}",
        shows=f"Left: how many tracks lived how long at speed {evidence.slowest}{evidence.where} (logarithmic). Right: "
        "the share of tracks expected to live longer than that (Kaplan-Meier), which does not take a track that was "
        f"still alive at the end of its sequence for one that had ended. {_bands_text(table)}",
        look_for=_numbers(table, evidence.trackers, lead=f"At speed {evidence.slowest}, "),
        spec=_pair(table, evidence.colour, "tracker"),
    )


def _by_speed(evidence: Evidence, table: pl.DataFrame, tracker: str) -> Figure | Absence:
    name, title = f"lifetimes-{evidence.slug(tracker)}", f"Lifetimes of {tracker} by speed"
    table = table.filter(tracker=tracker)
    if table.is_empty():
        return Absence(name, title, f"The tracker {tracker} found no feature, so no track has a lifetime.")
    table = table.with_columns(series=pl.col("speed").cast(pl.String))
    return Figure(
        id=name,
        title=title,
        shows=f"The same for {tracker} at every speed{evidence.where}; a lifetime counts the frames the tracker saw, "
        f"so that at speed 2 each of them is two frames of the sequence. {_bands_text(table)}",
        look_for=_numbers(table, list(evidence.speed_colours(tracker)), lead=f"For {tracker}, ", prefix="speed "),
        spec=_pair(table, evidence.speed_colours(tracker), "speed"),
    )


def _numbers(table: pl.DataFrame, names: Sequence[str], *, lead: str, prefix: str = "") -> str:
    """Mean, median and censored share of each series."""
    keys = list(LIFETIMES)
    labels = table.select("tracker", "speed", "series").unique()
    lived = mean_lifetime(table.select(keys)).join(median_survival(table.select(keys)), on=["tracker", "speed"])
    found = {row["series"]: row for row in lived.join(labels, on=["tracker", "speed"]).to_dicts()}
    parts = [_sentence(f"{prefix}{name}", found[name]) for name in names if name in found]
    return f"{lead}{'; '.join(parts)}."


def _sentence(name: str, row: Mapping[str, Any]) -> str:
    median = row["median_lifetime"]
    half = (
        "more than half of them outlive the data"
        if median is None
        else f"an estimated half live no longer than {count(median, 'frame')}"
    )
    seen = f"{count(row['n_tracks'], 'track')}, seen in {number(row['mean_lifetime'])} frames on average"
    return f"{name}: {seen}, {half}; {percent(row['n_censored'] / row['n_tracks'])} cut by the end"


def _pair(table: pl.DataFrame, colours: Mapping[str, str], title: str) -> Spec:
    hue, opacity = marks.colour("series", colours, title), marks.opacity("series")
    lines = [chart.encode(color=hue, opacity=opacity) for chart in (_histogram(table), _survival(table))]
    band = [area.encode(fill=marks.fill("series", colours)) for area in _band(table)]
    shown = (marks.shown("series", colours),)
    survival = alt.layer(*band, lines[1]).properties(**_SIZE)
    panels = [Panel(lines[0].properties(**_SIZE), shown), Panel(survival, shown, layer=len(band))]
    return arranged(panels, columns=2, independent=["fill"])


def _histogram(table: pl.DataFrame) -> alt.Chart:
    found = table.select("series", "lifetime", n=pl.col("n_ended") + pl.col("n_censored"), cut="n_censored")
    every = pl.int_range(1, pl.col("lifetime").max().cast(pl.Int64) + 1, dtype=pl.UInt32)
    dense = found.group_by("series", maintain_order=True).agg(lifetime=every).explode("lifetime")
    counts = dense.join(found, on=["series", "lifetime"], how="left", maintain_order="left")
    counts = counts.with_columns(pl.col("n", "cut").fill_null(0)).with_columns(marks.drawn_count(pl.col("n")))
    tips = [
        alt.Tooltip("series:N", title="of"),
        alt.Tooltip("lifetime:Q"),
        alt.Tooltip("n:Q", title="tracks"),
        alt.Tooltip("cut:Q", title="of them cut by the end"),
    ]
    chart = alt.Chart(marks.rows(counts)).mark_line(interpolate="step")
    y = marks.log_count("tracks (count)", float(counts["drawn"].max()))  # type: ignore[arg-type]
    encoded: alt.Chart = chart.encode(x=_LIFETIME, y=y, tooltip=tips)
    return encoded


def _survival(table: pl.DataFrame) -> alt.Chart:
    known = table.select("series", pl.col("lifetime").cast(pl.Int64), "survival").drop_nulls()
    start = known.select("series").unique(maintain_order=True).with_columns(lifetime=pl.lit(0), survival=pl.lit(1.0))
    points = pl.concat([start.cast({"lifetime": pl.Int64}), known]).sort("series", "lifetime")
    tips = [alt.Tooltip("series:N"), alt.Tooltip("lifetime:Q"), alt.Tooltip("survival:Q", format=".3f")]
    chart = alt.Chart(marks.rows(points)).mark_line(interpolate="step-after")
    encoded: alt.Chart = chart.encode(x=_LIFETIME, y=_SHARE, tooltip=tips)
    return encoded


def _band(table: pl.DataFrame) -> list[alt.Chart]:
    """Area between the bounds of the survival curve; none where it has none."""
    known = table.select("series", pl.col("lifetime").cast(pl.Int64), "low", "high").drop_nulls()
    if known.is_empty():
        return []
    area = alt.Chart(marks.rows(known.sort("series", "lifetime"))).mark_area(interpolate="step-after", tooltip=None)
    y, opacity = marks.on(_SHARE, "low"), marks.faint("series")
    encoded: alt.Chart = area.encode(x=_LIFETIME, y=y, y2="high:Q", opacity=opacity)
    return [encoded]


def _bands_text(table: pl.DataFrame) -> str:
    return told(table, of="the survival curves")


FAMILY = Family(
    id="lifetimes",
    title="Lifetimes",
    lead="A track's lifetime is the number of consecutive frames in which its tracker found it, the first included. "
    "Tracks alive in the last frame are cut short by the data, not by the tracker: they are censored.",
    figures=figures,
)
