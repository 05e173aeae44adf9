"""Curves and box plots for every level of a factor: speeds, views and lightings.

- Curves of one tracker for every level of a factor, with box plots. Several families show this.
- Error of each tracker at every speed.
- Error in rotated images, and in sequences played backward.
- Error under every lighting, of each tracker at each speed, by the direction in which the light moves.
- Track lifetimes under each lighting, as box plots.
"""

from collections.abc import Sequence
from dataclasses import asdict
from itertools import product

import altair as alt
import polars as pl

from tracknoise.report import style
from tracknoise.report.figures import light_sweeps
from tracknoise.report.figures.curve_panels import HEIGHT, MANY, Reading, Series, describe_bands, grid, readings, when
from tracknoise.report.figures.figure import Absence, Figure, Sections
from tracknoise.report.figures.messages import effect
from tracknoise.report.figures.panels import Chart, Panel, box_plot
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.histograms import box_of_counts, box_summary
from tracknoise.tables.enumerations import Trimming
from tracknoise.topics.bands import upright_bounds
from tracknoise.words import listing, number, px, sentence_case

_NAMES = {"mean": "mean error", "second": "RMS"}
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
    """A figure of the errors that the experiment is about, trimmed or not, unless `trimming` says which."""
    kept = points.filter(trimming=trimming or data.trimming, population=data.population)
    curve_readings = readings(kept, series)
    if not curve_readings:
        return Absence(id, title, f"No {data.axis.name} has enough features with a known error, so there is no curve.")
    missing = [label for label in series.colours if label not in {reading.name for reading in curve_readings}]
    no_curve = f" No {data.axis.name} has enough features {series.phrase.format(listing(missing))}."
    dashed = " Dashed: covariance about the mean." if len(series.colours) <= MANY else ""
    return Figure(
        id,
        title,
        f"{shows}{dashed} {describe_bands(kept, series)} {_boxes_explained(data)}",
        f"{_numbers(data, curve_readings, series, role)}{no_curve if missing else ''} {advice}",
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


def _numbers(data: ReportData, curve_readings: list[Reading], series: Series, role: str) -> str:
    """A statistic of every curve, or of the two that differ most where there are many."""
    place = when(curve_readings, data.axis, phrase=series.phrase)
    if len(curve_readings) <= MANY:
        values = [f"{series.phrase.format(curve.name)} {{}} {curve.describe(role)}." for curve in curve_readings]
        first, *others = values
        continued = [f" {sentence_case(text.format('it is'))}" for text in others]
        return f"{place} the {_NAMES[role]} {first.format('is')}{''.join(continued)}"
    if len({reading.since for reading in curve_readings}) > 1:
        place = f"At the available {data.axis.name} nearest to {data.axis.place(REFERENCE_AGE).removeprefix('at ')},"
    ends = " and ".join(_range(data, curve_readings, series, role, coordinate) for coordinate in (0, 1))
    return f"{place} the {_NAMES[role]} is {ends}."


def _range(data: ReportData, curve_readings: list[Reading], series: Series, role: str, coordinate: int) -> str:
    """The curves with the smallest and the largest value in u (0) or v (1), with their ages if these differ."""
    differ = len({reading.since for reading in curve_readings}) > 1
    ordered = sorted(curve_readings, key=lambda curve: curve.values[role][coordinate])
    ends = []
    for curve in (ordered[0], ordered[-1]):
        place = f", {data.axis.place(curve.since)}" if differ else ""
        ends.append(f"{px(curve.values[role][coordinate])} ({series.phrase.format(curve.name)}{place})")
    return f"in {'uv'[coordinate]} between {listing(ends)}"


def speed_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, one colour per speed."""
    if len(data.speeds) < 2:
        only = f"Only speed {data.slowest} was run" if data.speeds else "No tracker found a feature"
        title = f"Error by {data.axis.name} and speed"
        return [Absence("error-by-speed", title, f"{only}, so there are no speeds to compare.")]
    return [_speeds_of(data, tracker) for tracker in data.trackers]


def _speeds_of(data: ReportData, tracker: str) -> Figure | Absence:
    return comparison(
        data,
        data.reference(data.points).filter(tracker=tracker),
        Series("speed", data.speed_colours(tracker), "for speed {}"),
        id=f"error-by-speed-{data.slug(tracker)}",
        title=f"{tracker} by speed",
        shows=f"{data.errors_shown} of {tracker} at every speed{data.where}. At speed s the tracker sees only "
        "every s-th frame, so features move farther between its frames.",
        advice=f"Where curves coincide, the error depends on {data.axis.distance} and not on the number of tracking "
        f"steps.{_cuts_differ(data, tracker)}",
        message=effect(data, "speed", tracker),
    )


def _cuts_differ(data: ReportData, tracker: str) -> str:
    """Warn that speeds were not trimmed at the same error. Where few tracks live on, most errors are 0."""
    cuts = data.cuts(tracker)
    if data.trimming == Trimming.untrimmed or cuts["cut"].n_unique() < 2:
        return ""
    many = cuts.height > MANY
    rows = cuts.sort("cut")[[0, -1]].to_dicts() if many else cuts.to_dicts()
    cut = listing(f"{px(row['cut'])} at speed {row['speed']}" for row in rows)
    return f" Caution: trimming cuts {'between' if many else 'at'} {cut}. This explains part of the difference."


_ROTATED = {0: "upright", 90: "sideways", 180: "upside down", 270: "sideways (270°)"}
"""Name of each counter-clockwise rotation of the images, degrees."""


def rotations(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, one colour per rotation. None where there is only one rotation."""
    if len(data.rotations) < 2:
        return []
    return [_rotations_of(data, tracker) for tracker in data.trackers]


def directions(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, one colour per direction; where errors are trimmed, another one of untrimmed errors.

    None where there is only one direction.
    """
    if len(data.directions) < 2:
        return []
    return [_directions_of(data, tracker, trimming) for tracker in data.trackers for trimming in _trimmings(data)]


def _trimmings(data: ReportData) -> Sequence[Trimming]:
    """Trimming may hide a drift, so that untrimmed errors are always shown."""
    is_trimmed = data.trimming == Trimming.trimmed and data.percentile is not None
    return [Trimming.trimmed, Trimming.untrimmed] if is_trimmed else [data.trimming]


def _rotations_of(data: ReportData, tracker: str) -> Figure | Absence:
    points = data.across(data.points, "rotation").filter(tracker=tracker, speed=data.slowest)
    names = [_ROTATED[angle] for angle in data.rotations]
    angles = listing(f"{_ROTATED[angle]} means {angle}° counter-clockwise" for angle in data.rotations if angle)
    return comparison(
        data,
        upright_bounds(points, signed=pl.col("role") == "mean").with_columns(
            rotation=pl.col("rotation").replace_strict(_ROTATED, return_dtype=pl.String)
        ),
        Series("rotation", _two(data, tracker, names), "in {} images"),
        id=f"error-by-rotation-{data.slug(tracker)}",
        title=f"{tracker}, {listing(names, joint='and')}",
        shows=f"{data.errors_shown} of {tracker} at speed {data.slowest}{data.elsewhere('rotation')} in "
        f"images of each rotation ({angles}). Errors are rotated back, so u and v are those of the upright image in "
        "all curves.",
        advice="Where curves coincide, the orientation of the image makes no difference. Where they differ, part of "
        "the error depends on the image axes.",
        message=effect(data, "rotation", tracker, speed=data.slowest),
    )


def _directions_of(data: ReportData, tracker: str, trimming: Trimming) -> Figure | Absence:
    is_other = trimming != data.trimming
    errors = f"{trimming.capitalize()} errors" if is_other else data.errors_shown
    return comparison(
        data,
        data.across(data.points, "direction").filter(tracker=tracker, speed=data.slowest),
        Series("direction", _two(data, tracker, data.directions), "when played {}"),
        id=f"error-by-direction-{data.slug(tracker)}{f'-{trimming}' if is_other else ''}",
        title=f"{tracker}, {listing(data.directions, joint='and')}{f', {trimming}' if is_other else ''}",
        shows=f"{errors} of {tracker} at speed {data.slowest}{data.elsewhere('direction')} with "
        "the frames in recorded order and in reverse order.",
        advice="A mean error that changes its sign with the direction follows the motion in the image. One that keeps "
        "its sign does not.",
        role="mean",
        trimming=trimming,
        message="" if is_other else effect(data, "direction", tracker, speed=data.slowest, roles=("mean",)),
    )


def _two(data: ReportData, tracker: str, names: Sequence[str]) -> dict[str, str]:
    return dict(zip(names, style.levels(data.colour[tracker], len(names)), strict=True))


def lighting_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, speed and sweep of the light, one colour per lighting. None for only one lighting."""
    if len(data.lightings) < 2:
        return []
    combinations = product(data.trackers, data.speeds, light_sweeps.sweeps(data))
    return [_lightings_of(data, tracker, speed, sweep) for tracker, speed, sweep in combinations]


def _lightings_of(data: ReportData, tracker: str, speed: int, sweep: str) -> Figure | Absence:
    colours = light_sweeps.colours(data, tracker, sweep)
    points = data.across(data.points, "lighting").filter(tracker=tracker, speed=speed)
    several = len(light_sweeps.sweeps(data)) > 1
    return comparison(
        data,
        points.filter(pl.col("lighting").is_in(list(colours))),
        Series("lighting", colours, "under {}"),
        id=f"error-by-lighting-{data.slug(tracker)}-speed-{speed}{'-' + sweep.replace(' ', '-') if several else ''}",
        title=f"{tracker} at speed {speed} by lighting{f', {sweep}' if several else ''}",
        shows=f"{data.errors_shown} of {tracker} at speed {speed} under "
        f"{f'each lighting of the group {sweep}' if several else 'every lighting'}{data.elsewhere('lighting')}. "
        f"{data.view['lighting']} is black.",
        advice="Where curves coincide, the lighting makes no difference.",
        message="" if several else effect(data, "lighting", tracker, speed=speed),
    )


_FRAMES = alt.Axis(values=[first * 10**power for power in range(5) for first in (1, 2, 5)], format="~d")
_KEYS = ["tracker", "speed", "lighting"]


def lifetimes_by_lighting_figures(data: ReportData) -> list[Figure]:
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
    table = data.across(data["lifetimes"], "lighting").with_columns(n=pl.col("n_ended") + pl.col("n_censored"))
    groups = table.group_by(_KEYS).agg("lifetime", "n").sort(_KEYS)
    summaries = [asdict(box_of_counts(row["lifetime"], row["n"])) for row in groups.iter_rows(named=True)]
    return groups.select(_KEYS).hstack(pl.DataFrame(summaries))


def _look_for(data: ReportData, table: pl.DataFrame) -> str:
    parts = []
    for tracker in data.trackers:
        rows = table.filter(tracker=tracker, speed=data.slowest).sort("mean")
        if rows.height:
            ends = [rows.row(place, named=True) for place in (0, -1)]
            lived = " to ".join(f"{number(row['mean'])} frames under {row['lighting']}" for row in ends)
            parts.append(f"the mean lifetime of {tracker} ranges from {lived}")
    return f"At speed {data.slowest}, {'; '.join(parts)}."


FIGURES: Sections = {
    "lifetimes": (lifetimes_by_lighting_figures,),
    "error-by-speed": (speed_figures,),
    "error-by-lighting": (lighting_figures,),
    "error-by-rotation": (rotations,),
    "error-by-direction": (directions,),
}
"""What this module draws, by the section of the report."""
