"""How many features there are at each age, or in each frame."""

from collections.abc import Mapping, Sequence

import altair as alt
import polars as pl

from tracknoise.findings.wording import count, number
from tracknoise.report import style
from tracknoise.report.axis import FRAME
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.figures.layout import Panel, arranged
from tracknoise.statistics.lifetimes import surviving

_ALL, _MEASURED = "all tracks", "in the trimmed curves"


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """Trackers at the lowest speed, beside the speeds of each tracker where there are several."""
    table = pl.concat([_in_frames(evidence) if evidence.axis is FRAME else _by_age(evidence), _in_curves(evidence)])
    nominal = table.filter(speed=evidence.slowest)
    if not nominal["n"].sum():
        return [Absence("survivors", _title(evidence), "No tracker found a feature, so there are none to count.")]
    return [_figure(evidence, table, nominal)]


def _title(evidence: Evidence) -> str:
    return f"Features by {evidence.axis.name}"


def _by_age(evidence: Evidence) -> pl.DataFrame:
    """Columns tracker, speed, at, n, of: all tracks that reached an age."""
    reached = surviving(evidence.reference(evidence.lifetimes))
    return reached.select("tracker", "speed", pl.col("age").alias("at"), "n", of=pl.lit(_ALL))


def _in_frames(evidence: Evidence) -> pl.DataFrame:
    """Columns tracker, speed, at, n, of: all features alive in a frame."""
    tables = [evidence.run.sequence_table("frames", key) for key in evidence.sequences]
    alive = pl.concat(tables).group_by("tracker", "speed", at="frame").agg(n=pl.col("alive").cast(pl.Int64).sum())
    return alive.select("tracker", "speed", "at", "n", of=pl.lit(_ALL))


def _in_curves(evidence: Evidence) -> pl.DataFrame:
    """The same of the features that curves rest on, cut or not."""
    curves = evidence.reference(evidence.curves).filter(
        pl.col("statistic").replace_strict(evidence.axis.roles, default=None) == "mean",
        weighting="features",
        population=evidence.population,
        trimming="trimmed",
        axis=evidence.axis.name,
    )
    return curves.select("tracker", "speed", "at", "n", of=pl.lit(_MEASURED))


def _figure(evidence: Evidence, table: pl.DataFrame, nominal: pl.DataFrame) -> Figure:
    panels = [_panel(nominal, "tracker", evidence.colour, evidence, title=f"speed {evidence.slowest}")]
    if len(evidence.speeds) > 1:
        panels += [_speed_panel(evidence, table, tracker) for tracker in evidence.trackers]
    return Figure(
        id="survivors",
        title=_title(evidence),
        shows=f"{_shows(evidence)} The horizontal line marks {number(evidence.min_features)} features, under which "
        "curves are cut.",
        look_for=_look_for(evidence, nominal),
        spec=arranged(panels, columns=2, independent=["color"]),
    )


def _shows(evidence: Evidence) -> str:
    if evidence.axis is FRAME:
        return (
            f"How many features were tracked in each frame{evidence.where} (logarithmic), all scenes together: solid "
            "all of them, dashed those whose error is known, for they are alive in the key frame and associated with "
            "the scan, and that trimming kept."
        )
    return (
        f"How many features were still tracked at each age{evidence.where} (logarithmic), all scenes together: solid "
        "all tracks, by the frames they were found in (one found again after a gap is older than drawn), dashed those "
        "whose error is known and that trimming kept, by their age."
    )


def _look_for(evidence: Evidence, nominal: pl.DataFrame) -> str:
    tell = _sentence_by_frame if evidence.axis is FRAME else _sentence_by_age
    parts = [tell(evidence, tracker, nominal.filter(tracker=tracker)) for tracker in evidence.trackers]
    advice = (
        "The dashed curve falls on both sides of the key frame as fast as features come and go."
        if evidence.axis is FRAME
        else "A straight line means that a track's chance to be lost does not depend on its age."
    )
    return f"At speed {evidence.slowest}: {'; '.join(part for part in parts if part)}. {advice}"


def _sentence_by_age(evidence: Evidence, tracker: str, table: pl.DataFrame) -> str:
    counts = table.filter(of=_ALL)
    if counts.is_empty():
        return ""
    begun = int(counts.filter(at=0)["n"].sum())
    enough = counts.filter(pl.col("n") >= evidence.min_features)["at"].to_list()
    half = counts.filter(pl.col("n") * 2 >= begun)["at"].to_list()
    limit = number(evidence.min_features)
    last = f"{limit} or more are left up to age {max(enough)}" if enough else f"never are there {limit}"
    reach = f"at least half reach age {max(half)}" if max(half) else "fewer than half outlive their first frame"
    return f"{tracker} began {count(begun, 'feature')}, of which {reach}; {last}"


def _sentence_by_frame(evidence: Evidence, tracker: str, table: pl.DataFrame) -> str:
    key_frame = evidence.key_frame(evidence.view["direction"])
    known = table.filter(of=_MEASURED).sort("at")
    alive = int(table.filter(of=_ALL, at=key_frame)["n"].sum())
    if known.is_empty():
        return f"{tracker} has {count(alive, 'feature')} in the key frame {key_frame}, none of them of known error"
    fixed = int(known.filter(at=key_frame)["n"].sum())
    ends = [f"{number(row['n'])} in frame {row['at']}" for row in (known.row(0, named=True), known.row(-1, named=True))]
    return (
        f"{tracker} has {count(alive, 'feature')} in the key frame {key_frame}, and the error of {number(fixed)} of "
        f"them counts; it counts for {' and '.join(ends)}"
    )


def _speed_panel(evidence: Evidence, table: pl.DataFrame, tracker: str) -> Panel:
    counts = table.filter(tracker=tracker).with_columns(pl.col("speed").cast(pl.String))
    return _panel(counts, "speed", evidence.speed_colours(tracker), evidence, title=f"{tracker}, every speed")


def _panel(counts: pl.DataFrame, field: str, colours: Mapping[str, str], evidence: Evidence, *, title: str) -> Panel:
    table = counts.select(field, "of", "at", "n", marks.drawn_count(pl.col("n"))).sort(field, "of", "at")
    place = alt.Tooltip("at:Q", title=evidence.axis.name)
    tips = [alt.Tooltip(f"{field}:N"), alt.Tooltip("of:N", title="counted"), place, alt.Tooltip("n:Q")]
    dash = alt.StrokeDash("of:N", scale=alt.Scale(domain=[_ALL, _MEASURED], range=[[1, 0], [4, 3]]), legend=None)
    largest = float(table["drawn"].max() or 1)  # type: ignore[arg-type]
    lines = (
        alt.Chart(marks.rows(table))
        .mark_line()
        .encode(
            x=marks.along(evidence.axis, table["at"]),
            y=marks.log_count("features (count)", largest),
            color=marks.colour(field, colours, field),
            strokeDash=dash,
            opacity=marks.opacity(field),
            tooltip=tips,
        )
    )
    limit = alt.Chart(alt.InlineData(values=[{"drawn": evidence.min_features}])).mark_rule(color=style.QUIET, clip=True)
    key_frame = evidence.key_frame(evidence.view["direction"])
    vertical = [] if key_frame is None else marks.key_frames([key_frame])
    layers = alt.layer(lines, limit.encode(y="drawn:Q"), *vertical).properties(width=385, height=230, title=title)
    return Panel(layers, (marks.shown(field, colours),))


FAMILY = Family(
    id="survivors",
    title="Count of features",
    lead="Where few features remain, an average says more about these few than about the tracker, so the curves "
    "further down are cut there.",
    figures=figures,
)
