"""Track lifetimes: histogram and Kaplan-Meier survival."""

from collections.abc import Mapping, Sequence
from typing import Any

import altair as alt
import polars as pl

from tracknoise.findings.wording import count, number, percent
from tracknoise.report.bands import describe_intervals, of_scalar
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, Spec, arranged, layered
from tracknoise.report.figures.message import effect, trackers, values
from tracknoise.report.report_data import ReportData

_SIZE: dict[str, Any] = {"width": 385, "height": 240}
_LIFETIME = alt.X("lifetime:Q", title="lifetime (frames that the tracker saw)", axis=alt.Axis(tickMinStep=1))
_SHARE = alt.Y("survival:Q", scale=alt.Scale(domain=[0, 1]), title="share of tracks that live longer")

_FAILURE = (
    "The first mean depends on the length of sequences, the restricted mean does not. A failure is a lost track or an "
    "outlier. Other ends then count as censored, which assumes that these tracks would have failed like the rest."
)


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """Trackers at the lowest speed, then the speeds of each tracker if there are several."""
    table = of_scalar(data.reference(data.lifetimes), data.intervals, "survival")
    nominal = table.filter(speed=data.slowest)
    if nominal.is_empty():
        return [Absence("lifetimes", "Lifetimes", "No tracker found a feature, so there are no tracks.")]
    made: list[Figure | Absence] = [_by_tracker(data, nominal)]
    if len(data.speeds) > 1:
        made += [_by_speed(data, table, tracker) for tracker in data.trackers]
    return made


def _by_tracker(data: ReportData, nominal: pl.DataFrame) -> Figure:
    table = nominal.with_columns(series=pl.col("tracker"))
    return Figure(
        id="lifetimes",
        title=f"Lifetimes at speed {data.slowest}",
        shows=f"Left: number of tracks by lifetime at speed {data.slowest}{data.where} (logarithmic). Right: "
        "Kaplan-Meier estimate of the share of tracks that live longer. It treats tracks that were alive at the end of "
        f"their sequence as censored, not as ended. {_describe_bands(table)}",
        look_for=_numbers(data, table, {name: f"At speed {data.slowest}, {name}" for name in data.trackers}),
        spec=_pair(table, data.colour, "tracker"),
        message=trackers(data, "lifetime", "Tracks of {} live {} times as long as those of {}")
        or values(_medians(data), "Median lifetime"),
    )


def _medians(data: ReportData) -> dict[str, str]:
    """Median lifetime of each tracker at the lowest speed, where less than half of the tracks are censored."""
    rows = data.in_order(data.nominal(data.summary).drop_nulls("median_lifetime"))
    return {row["tracker"]: count(row["median_lifetime"], "frame") for row in rows.to_dicts()}


def _by_speed(data: ReportData, table: pl.DataFrame, tracker: str) -> Figure | Absence:
    name, title = f"lifetimes-{data.slug(tracker)}", f"Lifetimes of {tracker} by speed"
    table = table.filter(tracker=tracker)
    if table.is_empty():
        return Absence(name, title, f"The tracker {tracker} found no feature, so there are no tracks.")
    table = table.with_columns(series=pl.col("speed").cast(pl.String))
    return Figure(
        id=name,
        title=title,
        shows=f"The same for {tracker} at every speed{data.where}. Lifetimes count the frames that the tracker saw. "
        f"At speed 2, one of these frames is two frames of the sequence. {_describe_bands(table)}",
        look_for=_numbers(data, table, {speed: f"At speed {speed}, {tracker}" for speed in map(str, data.speeds)}),
        spec=_pair(table, data.speed_colours(tracker), "speed"),
        message=effect(data, "speed", tracker, roles=("lifetime",)),
    )


def _numbers(data: ReportData, table: pl.DataFrame, subjects: Mapping[str, str]) -> str:
    """Means, median and censored share of each series. Its first sentence begins with its subject."""
    labels = table.group_by("tracker", "speed", "series").agg(pl.col("n_censored").sum())
    found = data.reference(data.summary).join(labels, on=["tracker", "speed"])
    rows = {row["series"]: row for row in found.to_dicts()}
    until_failure = any(row["restricted_mean_until_failure"] is not None for row in rows.values())
    sentences = [_sentences(subject, rows[name]) for name, subject in subjects.items() if name in rows]
    return " ".join([*sentences, *([_FAILURE] if until_failure else [])])


def _sentences(subject: str, row: Mapping[str, Any]) -> str:
    median = row["median_lifetime"]
    half = "longer than the data (more than half are censored)" if median is None else count(median, "frame")
    lived = f"Mean lifetime: {number(row['mean_lifetime'])} frames. Median lifetime: {half}."
    censored = percent(row["n_censored"] / row["n_tracks"])
    mean, failure = (row[name] for name in ("restricted_mean_lifetime", "restricted_mean_until_failure"))
    until = "; the causes of ends are not recorded" if failure is None else f", or {number(failure)} until failure"
    restricted = f"Mean restricted to {count(row['restricted_to'], 'frame')}: {number(mean)} frames{until}."
    return f"{subject} has {count(row['n_tracks'], 'track')}. {lived} {restricted} Censored: {censored}."


def _pair(table: pl.DataFrame, colours: Mapping[str, str], title: str) -> Spec:
    hue, opacity = marks.colour("series", colours, title), marks.opacity("series")
    lines = [chart.encode(color=hue, opacity=opacity) for chart in (_histogram(table), _survival(table))]
    band = [area.encode(fill=marks.fill("series", colours)) for area in _band(table)]
    shown = (marks.shown("series", colours),)
    survival = layered(*band, lines[1]).properties(**_SIZE)
    panels = [Panel(lines[0].properties(**_SIZE), shown), Panel(survival, shown, layer=len(band))]
    return arranged(panels, columns=2, independent=["fill"])


def _histogram(table: pl.DataFrame) -> alt.Chart:
    found = table.select(
        "series", "tracker", "speed", "lifetime", n=pl.col("n_ended") + pl.col("n_censored"), cut="n_censored"
    )
    every = pl.int_range(1, pl.col("lifetime").max().cast(pl.Int64) + 1, dtype=pl.UInt32)
    dense = found.group_by("series", maintain_order=True).agg(pl.first("tracker", "speed"), lifetime=every)
    dense = dense.explode("lifetime")
    counts = dense.join(found.drop("tracker", "speed"), on=["series", "lifetime"], how="left", maintain_order="left")
    counts = counts.with_columns(pl.col("n", "cut").fill_null(0)).with_columns(marks.drawn_count(pl.col("n")))
    tips = [
        alt.Tooltip("series:N", title="of"),
        alt.Tooltip("lifetime:Q"),
        alt.Tooltip("n:Q", title="tracks"),
        alt.Tooltip("cut:Q", title="censored"),
    ]
    chart = alt.Chart(marks.rows(counts)).mark_line(interpolate="step")
    y = marks.log_count("tracks (count)", counts["drawn"])
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
    """Area between the bounds of the survival curve. Empty where there are none."""
    known = table.select("series", pl.col("lifetime").cast(pl.Int64), "low", "high").drop_nulls()
    if known.is_empty():
        return []
    area = alt.Chart(marks.rows(known.sort("series", "lifetime"))).mark_area(interpolate="step-after", tooltip=None)
    y, opacity = marks.on(_SHARE, "low"), marks.faint("series")
    encoded: alt.Chart = area.encode(x=_LIFETIME, y=y, y2=alt.Y2("high:Q"), opacity=opacity)
    return [encoded]


def _describe_bands(table: pl.DataFrame) -> str:
    return describe_intervals(table, of="the survival curves")
