"""Errors by age or frame: bias, spread, second moments, directions, long-lived tracks, and occlusion.

- Bias, absolute error and spread by age or frame, for all trackers at the lowest speed.
- The second moment of errors about zero, as the paper plots it: not its root, and with the part between u and v.
- Error along and across the motion and the image gradient, compared with that in u and v.
- Error of long-lived tracks, compared with that of all tracks.
- How the error changes when occluded features are left out.
"""

from collections.abc import Sequence

import altair as alt
import polars as pl

from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.report.figures.curve_panels import HEIGHT, Reading, Series, describe_bands, grid, readings, when
from tracknoise.report.figures.figure import Absence, Figure, Sections
from tracknoise.report.figures.messages import apart, trackers, values
from tracknoise.report.figures.panels import Panel, arranged, layered
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import LEAST_MOTION_PX, LONG_LIVED_AGES, REFERENCE_AGE
from tracknoise.statistics.truth_errors import FLOOR_COLUMNS
from tracknoise.tables.enumerations import Aspect, Trimming
from tracknoise.topics.bands import AGE, FRAME, Axis
from tracknoise.topics.growth_topic import growth_message
from tracknoise.words import SPACE, count, listing, number, percent, px, ratio, rms_of_tracks

_LAYOUT = (
    "Rows: mean error, mean absolute error, and root of the second moment. In the third row, the second moment is "
    "about zero for solid lines and about the mean for dashed lines. Fourth row: core, the sigma of the Gaussian with "
    "the same median absolute error, as geometric mean over scenes. Columns: u and v."
)


def curve_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """Curves of the errors that the run is about, and of the others: ``error-by-age``, ``error-by-age-trimmed``."""
    other_trimming = Trimming.trimmed if data.trimming == Trimming.untrimmed else Trimming.untrimmed
    return [_shown(data), _other(data, other_trimming)]


def _shown(data: ReportData) -> Figure | Absence:
    title = _title(data) if data.percentile is None else f"{_title(data)}, {data.trimming}"
    shows = f"Errors of {data.tracks_shown}{data.where}, {_along(data)}. {_LAYOUT}"
    advice = (
        f"A mean error that moves away from zero with {data.axis.distance} is a drift. Where the dashed line is below "
        "the solid one, a bias is part of the error. Where the core is far below the RMS, a few large "
        "errors make up most of it."
    )
    return _curve_figure(data, data.trimming, _id(data), title, shows, advice, _curve_message(data))


def _other(data: ReportData, trimming: Trimming) -> Figure | Absence:
    name, title = f"{_id(data)}-{trimming}", f"{_title(data)}, {trimming}"
    if data.percentile is None:
        return Absence(name, title, "Nothing was trimmed in this run, so this figure would be the same.")
    tracks = "all tracks" if trimming == Trimming.untrimmed else "the tracks that trimming kept"
    shows = f"The same for {tracks}{data.where}. The vertical axes have a different scale."
    advice = (
        "The difference from the figure above comes from the tracks that trimming drops. An estimator meets these "
        "tracks too. Trimmed errors depend on how many tracks are lost, and on the length of the sequences."
    )
    return _curve_figure(data, trimming, name, title, shows, advice, _trimming_message(data))


def _id(data: ReportData) -> str:
    return f"error-by-{data.axis.name}"


def _title(data: ReportData) -> str:
    return f"Error by {data.axis.name} at speed {data.slowest}"


def _along(data: ReportData) -> str:
    if data.axis is not FRAME:
        return "by age"
    return "by frame, before and after the key frame. Only tracks alive in the key frame have true positions"


def _curve_message(data: ReportData) -> str:
    """How errors grow; otherwise by how much one tracker is more accurate than another."""
    return growth_message(data) or trackers(data, "core", "The core error of {} is {} times that of {}")


def _trimming_message(data: ReportData) -> str:
    """How trimming changes the RMS of the first tracker, where the intervals lie apart."""
    points = data.nominal(data.points).filter(role="second", population=data.population, tracker=data.trackers[0])
    both_trimmings = points.filter(
        pl.col("since").is_between(1, REFERENCE_AGE), pl.col("trimming").is_in(list(Trimming))
    )
    shared = both_trimmings.filter(pl.len().over("since") == len(Trimming)).sort("since")
    if shared.is_empty():
        return ""
    rows = {row["trimming"]: row for row in shared.filter(since=shared["since"].max()).to_dicts()}
    before, after, rms = rows[Trimming.untrimmed], rows[Trimming.trimmed], rms_of_tracks(Trimming.untrimmed)
    if not apart(before, after, "u"):
        return ""
    return f"Trimming lowers {rms} of {data.trackers[0]} in u from {px(before['u'])} to {px(after['u'])}"


def _curve_figure(
    data: ReportData, trimming: str, name: str, title: str, shows: str, advice: str, message: str
) -> Figure | Absence:
    points = data.nominal(data.points).filter(trimming=trimming, population=data.population)
    series = Series("tracker", data.colour)
    curve_readings = readings(points, series)
    if not curve_readings:
        return Absence(name, title, no_curve(data))
    parts = [
        f"{reading.name} has a mean error of {reading.describe('mean')}. Its RMS is {reading.describe('second')}."
        for reading in curve_readings
    ]
    pooled = "These numbers pool the features of all scenes. In the answer at the top, all scenes have equal weight."
    look_for = f"{when(curve_readings, data.axis)} {' '.join(parts)} {pooled} {advice}"
    shows = f"{shows} {describe_bands(points, series)}"
    return Figure(name, title, shows, look_for, grid(points, series, data.axis), message)


def no_curve(data: ReportData) -> str:
    """Say why no tracker has a curve."""
    return (
        f"At speed {data.slowest} no {data.axis.name} other than {data.axis.zero} has {number(data.min_features)} "
        "features with a known error, so there is no curve."
    )


_SECOND_MOMENT_TITLE = "Second moment by {}"
_ELEMENTS = {"u": "uu", "uv": "uv", "v": "vv"}
_WIDTH = 245
_SYMBOL_WIDTH, _CHARACTER_WIDTH = 28, 7


def second_moment_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: trackers at the lowest speed, then the speeds of each tracker if there are several."""
    name, title = f"second-moment-by-{data.axis.name}", _SECOND_MOMENT_TITLE.format(data.axis.name)
    points = _second_moment_points(data)
    if points.filter(pl.col("since") != 0, speed=str(data.slowest)).is_empty():
        return [Absence(name, title, no_curve(data))]
    panels = _row(data, points.filter(speed=str(data.slowest)), Series("tracker", data.colour), f"speed {data.slowest}")
    if len(data.speeds) > 1:
        for tracker in data.trackers:
            panels += _row(data, points.filter(tracker=tracker), Series("speed", data.speed_colours(tracker)), tracker)
    spec = arranged(panels, columns=3, independent=["color"])
    return [
        Figure(
            name,
            title,
            _second_moment_shows(data),
            _look_for_second_moments(data, points),
            spec,
            _second_moment_message(data),
        )
    ]


def _second_moment_message(data: ReportData) -> str:
    """The tracker whose u and v differ most at the last age up to the reference age, if their intervals lie apart."""
    near = data.nominal(data.points).filter(
        pl.col("since").is_between(1, REFERENCE_AGE), role="second", trimming=data.trimming, population=data.population
    )
    last = near.filter(pl.col("since") == pl.col("since").max().over("tracker")).to_dicts()
    differing = [(row, *pair) for row in last for pair in ("uv", "vu") if row[pair[1]] and apart(row, row, *pair)]
    if not differing:
        return ""
    row, larger, smaller = max(differing, key=lambda entry: entry[0][entry[1]] / entry[0][entry[2]])
    times = ratio((row[larger] / row[smaller]) ** 2)
    return f"The second moment of {row['tracker']} is {times} times as large in {larger} as in {smaller}"


def _second_moment_points(data: ReportData) -> pl.DataFrame:
    """Second moments about zero, px²: columns tracker, speed, at, since, u, v, uv and others."""
    roles = pl.col("statistic").replace_strict(data.axis.roles, default=None)
    chosen = data.reference(data["curves"]).filter(
        roles == "second",
        ~pl.col("cut"),
        weighting="features",
        axis=data.axis.name,
        population=data.population,
        trimming=data.trimming,
    )
    moments = chosen.drop_nulls(["u", "v"]).sort("tracker", "speed", "at")
    since = pl.col("at").cast(pl.Int64) + data.since_zero(0)
    return moments.with_columns(pl.col("speed").cast(pl.String), since=since)


def _second_moment_shows(data: ReportData) -> str:
    return (
        f"Second moment of {data.tracks_shown}{data.where}, about zero and in px², as the paper plots it. Its "
        f"root, with intervals, is in the figures above. Columns: in u, between u and v, and in v. First row: "
        f"every tracker at speed {data.slowest}. Other rows: every speed of a tracker."
    )


def _look_for_second_moments(data: ReportData, points: pl.DataFrame) -> str:
    parts = [_sentence(data, name, points.filter(tracker=name, speed=str(data.slowest))) for name in data.trackers]
    return (
        f"{' '.join(part for part in parts if part)} An element between u and v that differs from zero means that "
        "errors in u and v are correlated."
    )


def _sentence(data: ReportData, tracker: str, points: pl.DataFrame) -> str:
    """The elements at the last age up to the reference age."""
    near = points.filter(pl.col("since").is_between(1, REFERENCE_AGE)).sort("since")
    if near.is_empty():
        return ""
    row = near.row(-1, named=True)
    u, uv, v = (f"{number(row[name])}{SPACE}px²" for name in _ELEMENTS)
    return f"{data.axis.opening_place(row['since'])}, {tracker} has {u} in u, {v} in v and {uv} between them."


def _row(data: ReportData, points: pl.DataFrame, series: Series, title: str) -> list[Panel]:
    """One panel per element. Those in u and v have one scale."""
    present = series.present(points)
    shown = points.filter(pl.col(series.field).is_in(list(present.colours)))
    u_and_v, empty = pl.concat([shown["u"], shown["v"]]), pl.Series([], dtype=pl.Float64)
    bounds = {
        "u": marks.holding(u_and_v, empty),
        "uv": marks.holding(shown["uv"], empty),
        "v": marks.holding(u_and_v, empty),
    }
    return [_second_moment_panel(data, shown, present, name, bounds[name], title) for name in _ELEMENTS]


def _second_moment_panel(
    data: ReportData, points: pl.DataFrame, series: Series, element: str, bounds: Sequence[float], title: str
) -> Panel:
    first = element == "u"
    y = alt.Y(
        f"{element}:Q",
        title=f"second moment {_ELEMENTS[element]} (px²)",
        scale=alt.Scale(domain=list(bounds), nice=False),
    )
    lines = alt.Chart(marks.rows(points.select(series.field, "at", element)))
    lines = lines.mark_line(point=alt.OverlayMarkDef(size=10), clip=True).encode(
        x=marks.along(points["at"], title=data.axis.title, from_zero=data.axis is AGE),
        y=y,
        color=marks.colour(series.field, series.colours, series.field, legend=first, columns=_columns(series)),
        opacity=marks.opacity(series.field),
        tooltip=[alt.Tooltip(f"{series.field}:N"), alt.Tooltip("at:Q", title=data.axis.name), f"{element}:Q"],
    )
    chart = layered(lines, marks.zero_line())
    chart = chart.properties(width=_WIDTH, height=HEIGHT, title=title if first else "")
    return Panel(chart, (marks.shown(series.field, series.colours),))


def _columns(series: Series) -> int:
    """Columns of a legend that is no wider than its panel."""
    longest = max((len(name) for name in series.colours), default=1)
    return max(1, int(_WIDTH / (_SYMBOL_WIDTH + _CHARACTER_WIDTH * longest)))


_LEAST = f"{number(LEAST_MOTION_PX, digits=1)}{SPACE}px"
_IMAGE = "u and v"
_PHRASES = {
    _IMAGE: "{} in u and {} in v",
    Aspect.motion: "{} along the motion and {} across it",
    Aspect.gradient: "{} along the gradient and {} across it",
}
"""How a sentence states the two values of each curve."""


def direction_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, at the lowest speed."""
    return [_along_and_across(data, tracker) for tracker in data.trackers]


def _along_and_across(data: ReportData, tracker: str) -> Figure | Absence:
    name, title = f"along-and-across-{data.slug(tracker)}", f"{tracker}, along and across"
    points, series = _direction_points(data, tracker), _direction_series(data, tracker)
    curve_readings = readings(points, series)
    if not {reading.name for reading in curve_readings} - {_IMAGE}:
        why = f"No {data.axis.name} has enough features with a known error and a known motion or gradient"
        return Absence(name, title, f"{why}, so there is no curve.")
    shows = f"{_direction_shows(data, tracker)} {describe_bands(points, series)}"
    chart = grid(points, series, data.axis)
    return Figure(
        name,
        title,
        shows,
        _look_for_directions(data, points, curve_readings),
        chart,
        _direction_message(tracker, points, curve_readings),
    )


def _direction_message(tracker: str, points: pl.DataFrame, curve_readings: Sequence[Reading]) -> str:
    """Where the RMS along the motion or gradient differs from that across it, and the intervals lie apart."""
    for reading in curve_readings:
        row = points.filter(axes=reading.name, since=reading.since, role="second").row(0, named=True)
        if reading.name != _IMAGE and apart(row, row, "v", "u"):
            return f"Errors of {tracker} are larger across the {reading.name} than along it"
        if reading.name != _IMAGE and apart(row, row, "u", "v"):
            return f"Errors of {tracker} are larger along the {reading.name} than across it"
    return ""


def _direction_points(data: ReportData, tracker: str) -> pl.DataFrame:
    """Curves of visible features, by `axes`."""
    image = data.points.filter(population="visible").with_columns(
        *(pl.lit(None, dtype=pl.Float64).alias(name) for name in FLOOR_COLUMNS),  # unknown along and across
        aspect=pl.lit(_IMAGE),
    )
    aspects = data.aspect_points.filter(pl.col("aspect").is_in([Aspect.motion, Aspect.gradient]))
    aspects = aspects.with_columns(pl.col("aspect").cast(pl.String))
    points = pl.concat([image, aspects.select(image.columns)]).rename({"aspect": "axes"})
    return data.nominal(points).filter(tracker=tracker, trimming=data.trimming)


def _direction_series(data: ReportData, tracker: str) -> Series:
    colours = dict(zip(_PHRASES, style.shades(data.colour[tracker], len(_PHRASES)), strict=True))
    return Series("axes", colours, "for {}", ("u, or along", "v, or across"))


def _direction_shows(data: ReportData, tracker: str) -> str:
    return (
        f"{data.errors_shown} of {tracker} at speed {data.slowest}{data.where}, of visible features. Three pairs of "
        "directions are compared. The first is u and v. The second is along and across the motion of the true position "
        f"since the previous frame that the tracker saw, if it moved by {_LEAST} or more. Along the motion, an error "
        "is negative if the feature lags behind. Across it, an error to the right is positive. The third is along and "
        "across the dominant image gradient where the feature was first seen, if there was one. A gradient has no "
        "sign, so there is no mean error along it. Dashed: covariance about the mean."
    )


def _look_for_directions(data: ReportData, points: pl.DataFrame, curve_readings: Sequence[Reading]) -> str:
    means = ". It is ".join(_values(reading, "mean") for reading in curve_readings if "mean" in reading.values)
    roots = ". It is ".join(_values(reading, "second") for reading in curve_readings)
    counts = listing(f"{number(_features(points, reading))} for {reading.name}" for reading in curve_readings)
    return (
        f"{when(curve_readings, data.axis)} the mean error is {means}. The RMS is {roots}. Number of "
        f"features: {counts}. A mean error that follows the motion is visible along the motion. In u and v it may "
        "average out if the motion changes direction. Where errors across the gradient are larger than along it, "
        "features slide along edges."
        f"{_caution(data)}"
    )


def _caution(data: ReportData) -> str:
    """Recorded true positions have errors, which affect the direction of motion too."""
    if all(entry.truth == "raycast" for entry in data.sequences.values()):
        return ""
    return " Caution: noise of the true positions looks like a lag too, and more so for slow motion."


def _values(reading: Reading, role: str) -> str:
    return _PHRASES[reading.name].format(*(px(value) for value in reading.values[role]))


def _features(points: pl.DataFrame, reading: Reading) -> int:
    return int(points.filter(axes=reading.name, since=reading.since, role="second")["n"].sum())


_ALL = "all"
_NAMES = {age: f"to age {age}" for age in LONG_LIVED_AGES}
"""Name of the tracks that live to each age."""


def survivorship_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, at the lowest speed."""
    return [_figure_of(data, tracker) for tracker in data.trackers]


def _figure_of(data: ReportData, tracker: str) -> Figure | Absence:
    points = _survivorship_points(data, tracker)
    series = _survivorship_series(points, data.colour[tracker])
    name, title = f"survivorship-bias-{data.slug(tracker)}", f"{tracker}, by track lifetime"
    curve_readings = _longest_beside_all(data, points)
    if not curve_readings:
        why = f"No {data.axis.name} has enough features whose tracks reach age {LONG_LIVED_AGES[0]}"
        return Absence(name, title, f"{why}, so there is nothing to compare.")
    chart = grid(points, series, data.axis)
    shows = f"{_survivorship_shows(data, tracker)} {describe_bands(points, series)}"
    return Figure(
        name,
        title,
        shows,
        _look_for_survivorship(data, points, curve_readings),
        chart,
        _survivorship_message(tracker, points, curve_readings),
    )


def _survivorship_message(tracker: str, points: pl.DataFrame, curve_readings: Sequence[Reading]) -> str:
    """How much smaller the RMS of the longest-lived tracks is in u, where the intervals lie apart."""
    rows = [
        points.filter(tracks=reading.name, since=reading.since, role="second").row(0, named=True)
        for reading in curve_readings
    ]
    all_tracks, longest = rows
    if not apart(all_tracks, longest, "u"):
        return ""
    times, rms = number(longest["u"] / all_tracks["u"]), rms_of_tracks(all_tracks["trimming"])
    return f"Tracks of {tracker} living {curve_readings[1].name} have {times} times the {rms} in u"


def _survivorship_points(data: ReportData, tracker: str) -> pl.DataFrame:
    """Curves of visible features, by `tracks`. Moments about the mean are left out: there are many curves."""
    all_tracks = data.points.filter(population="visible").with_columns(tracks=pl.lit(_ALL))
    chosen = data.aspect_points.filter(aspect=Aspect.long_lived)
    chosen = chosen.with_columns(tracks=pl.col("at_least").replace_strict(_NAMES, return_dtype=pl.String))
    points = pl.concat([all_tracks, chosen.select(all_tracks.columns)])
    return data.nominal(points).filter(pl.col("role") != "central", tracker=tracker, trimming=data.trimming)


def _survivorship_series(points: pl.DataFrame, colour: str) -> Series:
    """The groups that have a curve, in shades that differ as much as their number allows."""
    present = [name for name in (_ALL, *_NAMES.values()) if name in points["tracks"].unique()]
    return Series("tracks", dict(zip(present, style.levels(colour, len(present)), strict=True)))


def _longest_beside_all(data: ReportData, points: pl.DataFrame) -> list[Reading]:
    """All tracks and those that live longest, at an age that other tracks reach too. Empty where there is none."""
    for age in reversed(LONG_LIVED_AGES):
        pair = Series("tracks", dict.fromkeys((_ALL, _NAMES[age]), ""))
        younger = points if data.axis is FRAME else points.filter(pl.col("since") < age)
        curve_readings = readings(younger, pair)
        if len(curve_readings) == 2 and curve_readings[0].since == curve_readings[1].since:
            return curve_readings
    return []


def _survivorship_shows(data: ReportData, tracker: str) -> str:
    joined = "" if data.axis is FRAME else " From that age on, the curve is the same as that of all tracks."
    return (
        f"{data.errors_shown} of {tracker} at speed {data.slowest}{data.where}, of visible features. One curve is "
        "for all tracks. The others are for tracks that reach the stated age, in frames of the sequence."
        f"{joined}"
    )


def _look_for_survivorship(data: ReportData, points: pl.DataFrame, curve_readings: Sequence[Reading]) -> str:
    all_tracks, longest = curve_readings
    n, n_all = (
        int(points.filter(tracks=reading.name, since=reading.since, role="second")["n"].sum())
        for reading in curve_readings[::-1]
    )
    return (
        f"{when(curve_readings, data.axis)} the RMS over all tracks is {all_tracks.describe('second')}. "
        f"For tracks that live {longest.name} it is {longest.describe('second')}. "
        f"These are {number(n)} of {number(n_all)} features. "
        "Long-lived tracks may have smaller errors than all tracks at the same age. The curve of all tracks then "
        "flattens partly because bad tracks were lost. The error of a single track need not flatten."
    )


_OCCLUSION_TITLE = "Visible features compared with all projected ones"
_PANELS = [(role, coordinate) for role in ("absolute", "second") for coordinate in "uv"]
_KEYS = ["tracker", "speed", "role", "since"]


def occlusion_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: both populations, every tracker and speed."""
    if not data["counts"].filter(pl.col("name").is_in(["occluded", "out_of_image"]))["n"].sum():
        why = "No feature with a known true position was occluded, so there is nothing to leave out."
        return [Absence("occlusion", _OCCLUSION_TITLE, why)]
    table = compare(data)
    if table.is_empty():
        why = f"No {data.axis.name} has enough features in both populations to compare them."
        return [Absence("occlusion", _OCCLUSION_TITLE, why)]
    return [_occlusion_figure(data, table)]


def compare(data: ReportData) -> pl.DataFrame:
    """Both populations at the last place of each condition that they share, up to the reference age after zero.

    Returns: tracker, speed, role (absolute, second), since, and for each population its n and its value in u and v, px.
    """
    points = data.reference(data.points).filter(
        (pl.col("trimming") == data.trimming)
        & pl.col("since").is_between(1, REFERENCE_AGE)
        & pl.col("role").is_in(["absolute", "second"])
    )
    sides = [
        points.filter(population=side).select(*_KEYS, pl.col("n", "u", "v").name.suffix(f"_{side}"))
        for side in ("visible", "projected")
    ]
    paired = sides[0].join(sides[1], on=_KEYS)
    last = pl.col("since") == pl.col("since").max().over("tracker", "speed")
    return paired.filter(last).sort(_KEYS)


def _occlusion_figure(data: ReportData, table: pl.DataFrame) -> Figure:
    places, axis = table["since"].unique(), data.axis
    place = axis.place(int(places[0])) if len(places) == 1 else f"{axis.place(REFERENCE_AGE)} or the last before it"
    return Figure(
        id="occlusion",
        title=_OCCLUSION_TITLE,
        shows=f"{data.errors_shown} {place}{data.where}. A filled dot counts only visible features. A ring counts "
        "all features with a known true position, including occluded ones.",
        look_for=_look_for_occlusion(data, table),
        spec=arranged([_occlusion_panel(data, table, key) for key in _PANELS], columns=4),
        message=_occlusion_message(data, table),
    )


def _occlusion_message(data: ReportData, table: pl.DataFrame) -> str:
    """Share of the features of each tracker that are occluded."""
    rows = {row["tracker"]: row for row in table.filter(role="second", speed=data.slowest).to_dicts()}
    shares = {name: 1 - row["n_visible"] / row["n_projected"] for name, row in rows.items() if row["n_projected"]}
    return values({name: percent(shares[name]) for name in data.trackers if name in shares}, "Occluded features")


def _look_for_occlusion(data: ReportData, table: pl.DataFrame) -> str:
    rows = {row["tracker"]: row for row in table.filter(role="second", speed=data.slowest).to_dicts()}
    parts = [_sentences(data.axis, name, rows[name]) for name in data.trackers if name in rows]
    numbers = f"At speed {data.slowest}, {' '.join(parts)} " if parts else ""
    return f"{numbers}Where dot and ring are far apart, occluded features cause part of the error."


def _sentences(axis: Axis, name: str, row: dict[str, float]) -> str:
    occluded = int(row["n_projected"] - row["n_visible"])
    share = percent(occluded / row["n_projected"])
    change = f"Its RMS in u is {px(row['u_projected'])} with them and {px(row['u_visible'])} without."
    return f"{name} has {count(occluded, 'occluded feature')} ({share}) {axis.place(int(row['since']))}. {change}"


_AXES = {"mean": "mean error", "absolute": "absolute error", "second": "RMS error"}
"""Short titles of axes, by role."""


def _occlusion_panel(data: ReportData, table: pl.DataFrame, key: tuple[str, str]) -> Panel:
    role, coordinate = key
    table = table.filter(role=role).with_columns(
        condition=pl.col("tracker") + ", speed " + pl.col("speed").cast(pl.String)
    )
    order = [f"{tracker}, speed {speed}" for tracker in data.trackers for speed in data.speeds]
    first = key == _PANELS[0]
    y = alt.Y(
        "condition:N", sort=order, title=None, axis=alt.Axis(labels=first, ticks=False, domain=False, labelLimit=180)
    )
    tips = [alt.Tooltip("condition:N"), alt.Tooltip("since:Q", title=f"frames from {data.axis.zero}")]
    tips += [alt.Tooltip(f"{coordinate}_{side}:Q", title=f"{side} (px)") for side in ("visible", "projected")]
    base = alt.Chart(marks.rows(table)).encode(
        y=y, color=marks.colour("tracker", data.colour, "tracker", legend=False), tooltip=tips
    )
    title = f"{_AXES[role]} in {coordinate} (px)"
    x = alt.X(f"{coordinate}_visible:Q", title=title, scale=alt.Scale(zero=True), axis=alt.Axis(tickCount=4))
    link = base.mark_rule(strokeWidth=1.5).encode(x=x, x2=alt.X2(f"{coordinate}_projected:Q"))
    ring = base.mark_point(filled=False, size=60, strokeWidth=1.5).encode(x=alt.X(f"{coordinate}_projected:Q"))
    dot = base.mark_point(filled=True, size=45, opacity=1).encode(x=x)
    rows = table["condition"].n_unique()
    return Panel(layered(link, ring, dot).properties(width=175, height=max(60, 26 * rows)))


FIGURES: Sections = {
    "error-by-tracker": (curve_figures, second_moment_figures),
    "survivorship-bias": (survivorship_figures,),
    "along-and-across": (direction_figures,),
    "occlusion": (occlusion_figures,),
}
"""What this module draws, by the section of the report."""
