"""Number of features at each age, or in each frame."""

from collections.abc import Mapping, Sequence

import altair as alt
import polars as pl

from tracknoise.findings.wording import count, number
from tracknoise.report import style
from tracknoise.report.axis import FRAME
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.figures.message import values
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.tracks.lifetimes import surviving
from tracknoise.tables.enumerations import Trimming

_ALL, _MEASURED = "all tracks", "in the curves"


def figures(data: ReportData) -> Sequence[Figure | Absence]:
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
    reached = surviving(data.reference(data.lifetimes))
    return reached.select("tracker", "speed", pl.col("age").alias("at"), "n", of=pl.lit(_ALL))


def _in_frames(data: ReportData) -> pl.DataFrame:
    """Columns tracker, speed, at, n, of: all features alive in a frame."""
    tables = [data.run.sequence_table("frames", key) for key in data.sequences]
    alive = pl.concat(tables).group_by("tracker", "speed", at="frame").agg(n=pl.col("alive").cast(pl.Int64).sum())
    return alive.select("tracker", "speed", "at", "n", of=pl.lit(_ALL))


def _in_curves(data: ReportData) -> pl.DataFrame:
    """The same for the features of the curves, including those where curves are cut."""
    curves = data.reference(data.curves).filter(
        pl.col("statistic").replace_strict(data.axis.roles, default=None) == "mean",
        weighting="features",
        population=data.population,
        trimming=data.trimming,
        axis=data.axis.name,
    )
    return curves.select("tracker", "speed", "at", "n", of=pl.lit(_MEASURED))


def _figure(data: ReportData, table: pl.DataFrame, nominal: pl.DataFrame) -> Figure:
    panels = [_panel(nominal, "tracker", data.colour, data, title=f"speed {data.slowest}")]
    if len(data.speeds) > 1:
        panels += [_speed_panel(data, table, tracker) for tracker in data.trackers]
    return Figure(
        id="feature-counts",
        title=_title(data),
        shows=f"{_shows(data)} Curves are cut below the horizontal line, at {number(data.min_features)} features.",
        look_for=_look_for(data, nominal),
        spec=arranged(panels, columns=2, independent=["color"]),
        message=_message(data, nominal),
    )


def _message(data: ReportData, nominal: pl.DataFrame) -> str:
    """The last age or frame at which enough features of each tracker have a known error."""
    enough = nominal.filter(pl.col("n") >= data.min_features, of=_MEASURED)
    last = dict(enough.group_by("tracker").agg(pl.col("at").max()).iter_rows())
    found = {name: f"up to {data.axis.name} {last[name]}" for name in data.trackers if name in last}
    return values(found, "Enough features for curves")


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


def _look_for(data: ReportData, nominal: pl.DataFrame) -> str:
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
    known = table.filter(of=_MEASURED).sort("at")
    alive = int(table.filter(of=_ALL, at=key_frame)["n"].sum())
    if known.is_empty():
        return f"{tracker} has {count(alive, 'feature')} in the key frame {key_frame}. No error is known."
    fixed = int(known.filter(at=key_frame)["n"].sum())
    first, last = (f"{number(row['n'])} in frame {row['at']}" for row in known[[0, -1]].to_dicts())
    return (
        f"{tracker} has {count(alive, 'feature')} in the key frame {key_frame}. The curves contain "
        f"{number(fixed)} of them. They begin with {first} and end with {last}."
    )


def _speed_panel(data: ReportData, table: pl.DataFrame, tracker: str) -> Panel:
    counts = table.filter(tracker=tracker).with_columns(pl.col("speed").cast(pl.String))
    return _panel(counts, "speed", data.speed_colours(tracker), data, title=f"{tracker}, every speed")


def _panel(counts: pl.DataFrame, field: str, colours: Mapping[str, str], data: ReportData, *, title: str) -> Panel:
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
