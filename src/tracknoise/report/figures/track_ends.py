"""What becomes of tracks: their number, lifetimes, causes of ends, and outlier ratios.

- Number of features at each age, or in each frame.
- Track lifetimes: histogram and Kaplan-Meier survival.
- Causes of track ends: cumulative incidence by lifetime.
- The share of features that a tracker rejects per frame, as box plots.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import altair as alt
import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.report import style
from tracknoise.report.figures import light_sweeps, marks
from tracknoise.report.figures.figure import Absence, Figure, Sections
from tracknoise.report.figures.messages import effect, trackers, values
from tracknoise.report.figures.panels import Panel, Spec, arranged, box_plot, layered
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.lifetimes import surviving
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.schema import CAUSES
from tracknoise.topics.bands import FRAME, describe_bounds, describe_intervals
from tracknoise.words import count, format_estimate, listing, number, percent

_ALL, _MEASURED = "all tracks", "in the curves"


def feature_count_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """Trackers at the lowest speed, and the speeds of each tracker if there are several."""
    table = pl.concat([_in_frames(data) if data.axis is FRAME else _by_age(data), _in_curves(data)])
    nominal = table.filter(speed=data.slowest)
    if not nominal["n"].sum():
        return [Absence("feature-counts", _title(data), "No tracker found a feature, so there is nothing to count.")]
    return [_figure(data, table, nominal)]


def _title(data: ReportData) -> str:
    return f"Features by {data.axis.name}"


def _by_age(data: ReportData) -> pl.DataFrame:
    """Columns tracker, speed, at, n, of: all tracks that reached an age."""
    reached = surviving(data.reference(data["lifetimes"]))
    return reached.select("tracker", "speed", pl.col("age").alias("at"), "n", of=pl.lit(_ALL))


def _in_frames(data: ReportData) -> pl.DataFrame:
    """Columns tracker, speed, at, n, of: all features alive in a frame."""
    tables = [data.run.sequence_table("frames", key) for key in data.sequences]
    alive = pl.concat(tables).group_by("tracker", "speed", at="frame").agg(n=pl.col("alive").cast(pl.Int64).sum())
    return alive.select("tracker", "speed", "at", "n", of=pl.lit(_ALL))


def _in_curves(data: ReportData) -> pl.DataFrame:
    """The same for the features of the curves, including those where curves are cut."""
    curves = data.reference(data["curves"]).filter(
        pl.col("statistic").replace_strict(data.axis.roles, default=None) == "mean",
        weighting="features",
        population=data.population,
        trimming=data.trimming,
        axis=data.axis.name,
    )
    return curves.select("tracker", "speed", "at", "n", of=pl.lit(_MEASURED))


def _figure(data: ReportData, table: pl.DataFrame, nominal: pl.DataFrame) -> Figure:
    panels = [_feature_count_panel(nominal, "tracker", data.colour, data, title=f"speed {data.slowest}")]
    if len(data.speeds) > 1:
        panels += [_speed_panel(data, table, tracker) for tracker in data.trackers]
    return Figure(
        id="feature-counts",
        title=_title(data),
        shows=f"{_shows(data)} Curves are cut below the horizontal line, at {number(data.min_features)} features.",
        look_for=_look_for_feature_counts(data, nominal),
        spec=arranged(panels, columns=2, independent=["color"]),
        message=_feature_count_message(data, nominal),
    )


def _feature_count_message(data: ReportData, nominal: pl.DataFrame) -> str:
    """The last age or frame at which enough features of each tracker have a known error."""
    enough = nominal.filter(pl.col("n") >= data.min_features, of=_MEASURED)
    last = dict(enough.group_by("tracker").agg(pl.col("at").max()).iter_rows())
    texts = {name: f"up to {data.axis.name} {last[name]}" for name in data.trackers if name in last}
    return values(texts, "Enough features for curves")


def _shows(data: ReportData) -> str:
    if data.axis is FRAME:
        return (
            f"Number of features tracked in each frame{data.where} (logarithmic), over all scenes. Solid: all "
            f"features. Dashed: those {_kept(data)}whose error is known, because they are alive in the key frame and "
            "matched to the scan."
        )
    return (
        f"Number of features still tracked at each age{data.where} (logarithmic), over all scenes. Solid: all tracks, "
        "by the number of frames in which they were found. A track that was found again after a gap is older. Dashed: "
        f"tracks {_kept(data)}whose error is known, by their age."
    )


def _kept(data: ReportData) -> str:
    return "that trimming kept and " if data.trimming == Trimming.trimmed and data.percentile is not None else ""


def _look_for_feature_counts(data: ReportData, nominal: pl.DataFrame) -> str:
    describe = _sentence_by_frame if data.axis is FRAME else _sentence_by_age
    parts = [describe(data, tracker, nominal.filter(tracker=tracker)) for tracker in data.trackers]
    advice = (
        "The dashed curve falls on both sides of the key frame as features appear and get lost."
        if data.axis is FRAME
        else "A straight line means that the probability of losing a track does not depend on its age."
    )
    return f"At speed {data.slowest}, {' '.join(part for part in parts if part)} {advice}"


def _sentence_by_age(data: ReportData, tracker: str, table: pl.DataFrame) -> str:
    counts = table.filter(of=_ALL)
    if counts.is_empty():
        return ""
    begun = int(counts.filter(at=0)["n"].sum())
    enough = counts.filter(pl.col("n") >= data.min_features)["at"].to_list()
    half = counts.filter(pl.col("n") * 2 >= begun)["at"].to_list()
    limit = number(data.min_features)
    last = f"{limit} or more remain up to age {max(enough)}" if enough else f"There are always fewer than {limit}"
    reach = f"At least half reach age {max(half)}" if max(half) else "Fewer than half are found a second time"
    return f"{tracker} started {count(begun, 'feature')}. {reach}. {last}."


def _sentence_by_frame(data: ReportData, tracker: str, table: pl.DataFrame) -> str:
    key_frame = data.key_frame(data.view["direction"])
    measured = table.filter(of=_MEASURED).sort("at")
    alive = int(table.filter(of=_ALL, at=key_frame)["n"].sum())
    if measured.is_empty():
        return f"{tracker} has {count(alive, 'feature')} in the key frame {key_frame}. No error is known."
    fixed = int(measured.filter(at=key_frame)["n"].sum())
    first, last = (f"{number(row['n'])} in frame {row['at']}" for row in measured[[0, -1]].to_dicts())
    return (
        f"{tracker} has {count(alive, 'feature')} in the key frame {key_frame}. The curves contain "
        f"{number(fixed)} of them. They begin with {first} and end with {last}."
    )


def _speed_panel(data: ReportData, table: pl.DataFrame, tracker: str) -> Panel:
    counts = table.filter(tracker=tracker).with_columns(pl.col("speed").cast(pl.String))
    return _feature_count_panel(counts, "speed", data.speed_colours(tracker), data, title=f"{tracker}, every speed")


def _feature_count_panel(
    counts: pl.DataFrame, field: str, colours: Mapping[str, str], data: ReportData, *, title: str
) -> Panel:
    table = counts.select(field, "of", "at", "n", marks.drawn_count(pl.col("n"))).sort(field, "of", "at")
    place = alt.Tooltip("at:Q", title=data.axis.name)
    tips = [alt.Tooltip(f"{field}:N"), alt.Tooltip("of:N", title="counted"), place, alt.Tooltip("n:Q")]
    dash = alt.StrokeDash("of:N", scale=alt.Scale(domain=[_ALL, _MEASURED], range=[[1, 0], [4, 3]]), legend=None)
    lines = (
        alt.Chart(marks.rows(table))
        .mark_line()
        .encode(
            x=marks.along(table["at"], title=data.axis.title, from_zero=data.axis is not FRAME),
            y=marks.log_count("features (count)", table["drawn"], data.min_features),
            color=marks.colour(field, colours, field),
            strokeDash=dash,
            opacity=marks.opacity(field),
            tooltip=tips,
        )
    )
    limit = alt.Chart(alt.InlineData(values=[{"drawn": data.min_features}])).mark_rule(color=style.QUIET, clip=True)
    key_frame = data.key_frame(data.view["direction"])
    vertical = [] if key_frame is None else marks.key_frames([key_frame], style.QUIET)
    layers = layered(lines, limit.encode(y=alt.Y("drawn:Q")), *vertical)
    return Panel(layers.properties(width=385, height=230, title=title), (marks.shown(field, colours),))


_SIZE: dict[str, Any] = {"width": 385, "height": 240}
_LIFETIME = alt.X("lifetime:Q", title="lifetime (frames that the tracker saw)", axis=alt.Axis(tickMinStep=1))
_LIFETIME_SHARE = alt.Y("survival:Q", scale=alt.Scale(domain=[0, 1]), title="share of tracks that live longer")

_FAILURE = (
    "The first mean depends on the length of sequences, the restricted mean does not. A failure is a lost track or an "
    "outlier. Until failure, tracks with other ends count as censored: they are assumed to fail like the rest."
)


def lifetime_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """Trackers at the lowest speed, then the speeds of each tracker if there are several."""
    table = data.with_bounds_of(data.reference(data["lifetimes"]), "survival")
    nominal = table.filter(speed=data.slowest)
    if nominal.is_empty():
        return [Absence("lifetimes", "Lifetimes", "No tracker found a feature, so there are no tracks.")]
    figures: list[Figure | Absence] = [_by_tracker(data, nominal)]
    if len(data.speeds) > 1:
        figures += [_lifetimes_by_speed(data, table, tracker) for tracker in data.trackers]
    return figures


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
    rows = data.in_order(data.nominal(data["summary"]).drop_nulls("median_lifetime"))
    return {row["tracker"]: count(row["median_lifetime"], "frame") for row in rows.to_dicts()}


def _lifetimes_by_speed(data: ReportData, table: pl.DataFrame, tracker: str) -> Figure | Absence:
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
    summaries = data.reference(data["summary"]).join(labels, on=["tracker", "speed"])
    rows = {row["series"]: row for row in summaries.to_dicts()}
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
    bounds = table.select("series", pl.col("lifetime").cast(pl.Int64), "low", "high").drop_nulls()
    band = _band(bounds.sort("series", "lifetime"), _LIFETIME_SHARE, colours)
    shown = (marks.shown("series", colours),)
    survival = layered(*band, lines[1]).properties(**_SIZE)
    panels = [Panel(lines[0].properties(**_SIZE), shown), Panel(survival, shown, layer=len(band))]
    return arranged(panels, columns=2, independent=["fill"])


def _histogram(table: pl.DataFrame) -> alt.Chart:
    histogram = table.select(
        "series", "tracker", "speed", "lifetime", n=pl.col("n_ended") + pl.col("n_censored"), cut="n_censored"
    )
    lifetimes = pl.int_range(1, pl.col("lifetime").max().cast(pl.Int64) + 1, dtype=pl.UInt32)
    dense = histogram.group_by("series", maintain_order=True).agg(pl.first("tracker", "speed"), lifetime=lifetimes)
    dense = dense.explode("lifetime")
    counts = dense.join(
        histogram.drop("tracker", "speed"), on=["series", "lifetime"], how="left", maintain_order="left"
    )
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
    shares = table.select("series", pl.col("lifetime").cast(pl.Int64), "survival").drop_nulls()
    start = shares.select("series").unique(maintain_order=True).with_columns(lifetime=pl.lit(0), survival=pl.lit(1.0))
    points = pl.concat([start.cast({"lifetime": pl.Int64}), shares]).sort("series", "lifetime")
    tips = [alt.Tooltip("series:N"), alt.Tooltip("lifetime:Q"), alt.Tooltip("survival:Q", format=".3f")]
    chart = alt.Chart(marks.rows(points)).mark_line(interpolate="step-after")
    encoded: alt.Chart = chart.encode(x=_LIFETIME, y=_LIFETIME_SHARE, tooltip=tips)
    return encoded


def _band(bounds: pl.DataFrame, y: alt.Y, colours: Mapping[str, str]) -> list[alt.Chart]:
    """Areas between the bounds along lifetimes, one for each of the series. Empty where there are none."""
    if bounds.is_empty():
        return []
    area = alt.Chart(marks.rows(bounds)).mark_area(interpolate="step-after", tooltip=None)
    fill, opacity = marks.fill("series", colours), marks.faint("series")
    return [area.encode(x=_LIFETIME, y=marks.on(y, "low"), y2=alt.Y2("high:Q"), fill=fill, opacity=opacity)]


def _describe_bands(table: pl.DataFrame) -> str:
    return describe_intervals(table, of="the survival curves")


_NAMES = {"lost": "lost", "outlier": "rejected as an outlier", "displaced": "displaced", "masked": "masked"}
_COLOURS = dict(zip((_NAMES[cause] for cause in CAUSES), style.colours(CAUSES), strict=True))
_INCIDENCE_SHARE = alt.Y("incidence:Q", scale=alt.Scale(domain=[0, 1]), title="share of tracks that have ended")
_ID, _INCIDENCE_TITLE = "ends-by-cause", "Causes of track ends"


def incidence_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """Each tracker at the lowest speed."""
    table = data.nominal(data["incidence"])
    if table.is_empty():
        return [Absence(_ID, _INCIDENCE_TITLE, "No tracker of this run reports why tracks end.")]
    table = table.with_columns(series=pl.col("cause").cast(pl.String).replace_strict(_NAMES))
    trackers = [tracker for tracker in data.trackers if tracker in table["tracker"]]
    panels = [_incidence_panel(table.filter(tracker=tracker), tracker, data.colour[tracker]) for tracker in trackers]
    bands = describe_bounds(table, of="the curves")
    figure = Figure(
        id=_ID,
        title=_INCIDENCE_TITLE,
        shows=f"Cumulative incidence (Aalen and Johansen) at speed {data.slowest}{data.where}: share of tracks that "
        "have ended by each cause up to a lifetime. A track ends by one cause only. At every lifetime, the four "
        "curves and the share of tracks that live longer add up to 1. Masked tracks moved into the border or onto "
        f"another feature. Displaced tracks moved farther in one step than the tracker allows. {bands}",
        look_for=" ".join(_sentence(tracker, table.filter(tracker=tracker)) for tracker in trackers)
        + " Only lost tracks and outliers are failures of a tracker. The other causes follow from its rules.",
        spec=arranged(panels, columns=2, independent=["fill"]),
        message=_incidence_message(table, trackers),
    )
    return [figure]


def _incidence_message(table: pl.DataFrame, trackers: Sequence[str]) -> str:
    """The most frequent cause of each tracker, where this is established."""
    last = table.filter(pl.col("lifetime") == pl.col("lifetime").max().over("tracker"), pl.col("incidence") > 0)
    causes = {name: cause for name in trackers if (cause := _most_frequent(last.filter(tracker=name)))}
    return values(causes, "Most frequent cause of ends")


def _most_frequent(causes: pl.DataFrame) -> str:
    """The cause whose interval is above those of all others, or the only one; empty if there is none."""
    ranked = causes.sort("incidence", descending=True)
    low, highs = ranked["low"].head(1), ranked["high"].slice(1)
    if ranked.is_empty() or highs.null_count() or not (highs < low.fill_null(0.0)).all():
        return ""
    return str(ranked["series"][0])


def _sentence(tracker: str, table: pl.DataFrame) -> str:
    last = table.filter(pl.col("lifetime") == pl.col("lifetime").max()).to_dicts()
    shares: Mapping[str, float] = {row["series"]: row["incidence"] for row in last if row["incidence"]}
    ranked = sorted(shares, key=lambda name: (-shares[name], name))[:2]
    if not ranked:
        return f"No track of {tracker} ended before its sequence did."
    parts = listing(f"{percent(shares[name])} are {name}" for name in ranked)
    return f"Of the tracks of {tracker}, {parts} by lifetime {last[0]['lifetime']}."


def _incidence_panel(table: pl.DataFrame, tracker: str, colour: str) -> Panel:
    hue, opacity = marks.colour("series", _COLOURS, "cause"), marks.opacity("series")
    tips = [alt.Tooltip("series:N", title="cause"), alt.Tooltip("lifetime:Q"), alt.Tooltip("incidence:Q", format=".3f")]
    shares = table.select("series", "lifetime", "incidence", "low", "high").sort("series", "lifetime")
    line = alt.Chart(marks.rows(shares.drop("low", "high"))).mark_line(interpolate="step-after")
    line = line.encode(x=_LIFETIME, y=_INCIDENCE_SHARE, tooltip=tips, color=hue, opacity=opacity)
    band = _band(shares.drop_nulls(), _INCIDENCE_SHARE, _COLOURS)
    chart = layered(*band, line).properties(width=385, height=240, title=alt.Title(tracker, color=colour))
    return Panel(chart, (marks.shown("series", _COLOURS),), layer=len(band))


_OUTLIER_RATIO_TITLE = "Outlier ratio"
_INTERVAL = ("pooled_ratio", "low", "high")


def outlier_ratio_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """By speed, and by lighting where there are several."""
    table = data.reference(_entered(data))
    if table.is_empty():
        why = "No tracker that reports outliers carried a feature from one frame to the next."
        return [Absence("outlier-ratio", _OUTLIER_RATIO_TITLE, why)]
    return [_outlier_ratios_by_speed(data, table), *_by_lighting(data)]


def _entered(data: ReportData) -> pl.DataFrame:
    """Conditions with an outlier ratio: those that carried a feature into some frame, and report outliers."""
    return data.with_bounds_of(data["outliers"].filter(pl.col("pooled_ratio").is_not_null()), "outlier_ratio")


def _outlier_ratios_by_speed(data: ReportData, table: pl.DataFrame) -> Figure:
    panels = [_outlier_ratio_panel(data, table.filter(tracker=tracker), tracker) for tracker in data.trackers]
    return Figure(
        id="outlier-ratio",
        title=_OUTLIER_RATIO_TITLE,
        shows=f"Share of features that a tracker rejected in a frame, over all frames{data.where}. The box spans the "
        "quartiles. The orange line is the median and the green triangle is the mean. Whiskers reach the last frame "
        f"within 1.5 interquartile ranges. {_intervals(table)}",
        look_for=_look_for_outlier_ratio(data, table),
        spec=arranged(panels, columns=3, independent=["fill", "stroke"]),
        message=values(_shares(data, table), "Rejected features"),
    )


def _shares(data: ReportData, table: pl.DataFrame) -> dict[str, str]:
    """Outlier ratio of each tracker at the lowest speed."""
    rows = data.in_order(table.filter(speed=data.slowest)).to_dicts()
    return {row["tracker"]: percent(row["pooled_ratio"]) for row in rows}


def _by_lighting(data: ReportData) -> list[Figure]:
    """One figure. None where there is only one lighting."""
    if len(data.lightings) < 2:
        return []
    table = data.across(_entered(data), "lighting")
    parts = [_range(tracker, table.filter(tracker=tracker, speed=data.slowest)) for tracker in data.trackers]
    figure = Figure(
        id="outlier-ratio-by-lighting",
        title=f"{_OUTLIER_RATIO_TITLE} by lighting",
        shows=f"The same for every lighting{data.elsewhere('lighting')}, {light_sweeps.legend(data)}. "
        f"{_intervals(table)}",
        look_for=f"Shares of all features carried into a frame at speed {data.slowest}: "
        f"{'; '.join(part for part in parts if part)}.",
        spec=light_sweeps.boxes(data, table, _ratio(data), interval=_INTERVAL),
        message=effect(data, "lighting", data.trackers[0], speed=data.slowest, roles=("outlier_ratio",)),
    )
    return [figure]


def _look_for_outlier_ratio(data: ReportData, table: pl.DataFrame) -> str:
    parts = []
    for tracker in data.trackers:
        rows = table.filter(tracker=tracker).sort("speed").to_dicts()
        shares = [f"{_with_interval(row)} at speed {row['speed']}" for row in rows]
        parts += [f"Of the features carried into a frame, {tracker} rejected {listing(shares)}."] if shares else []
    return f"{' '.join(parts)} A mean above the median indicates a few bad frames."


def _with_interval(row: Mapping[str, Any]) -> str:
    return format_estimate(Estimate.of_row(row, "pooled_ratio", "low", "high", "share"))


def _intervals(table: pl.DataFrame) -> str:
    return describe_intervals(table, of="the pooled outlier ratio", marks="Heavy lines and dots show")


def _range(tracker: str, table: pl.DataFrame) -> str:
    if table.is_empty():
        return ""
    ordered = table.sort("pooled_ratio")
    low, high = ordered.row(0, named=True), ordered.row(-1, named=True)
    ends = [f"{percent(row['pooled_ratio'])} under {row['lighting']}" for row in (low, high)]
    return f"{tracker} rejected between {ends[0]} and {ends[1]}"


def _outlier_ratio_panel(data: ReportData, table: pl.DataFrame, tracker: str) -> Panel:
    """A box for each speed of a tracker."""
    boxes = table.with_columns(pl.col("speed").cast(pl.String))
    width, hues = 780 // min(3, max(2, len(data.trackers))), data.speed_colours(tracker)
    chart = box_plot(boxes, field="speed", colours=hues, y=_ratio(data), width=width, height=230, interval=_INTERVAL)
    return Panel(chart.properties(title=alt.Title(tracker, color=data.colour[tracker])))


def _ratio(data: ReportData) -> alt.Y:
    """One axis for all panels."""
    table = _entered(data)
    largest = max(value for name in ("upper_whisker", "mean", "high") for value in table[name].drop_nulls())
    scale = alt.Scale(domain=[0, 1.05 * largest or 1.0], nice=False)
    return alt.Y("median:Q", scale=scale, title="outlier ratio (share of features)")


FIGURES: Sections = {
    "lifetimes": (lifetime_figures, incidence_figures),
    "outlier-ratio": (outlier_ratio_figures,),
    "feature-counts": (feature_count_figures,),
}
"""What this module draws, by the section of the report."""
