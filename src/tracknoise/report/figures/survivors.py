"""How many features are left at each age."""

from collections.abc import Mapping, Sequence

import altair as alt
import polars as pl

from tracknoise.report import style
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.figures.layout import Panel, arranged
from tracknoise.report.sentences import count, number
from tracknoise.statistics.lifetimes import surviving

_TITLE = "Features surviving by age"
_ALL, _MEASURED = "all tracks", "in the trimmed curves"


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """Trackers at the lowest speed, beside the speeds of each tracker where there are several."""
    table = _counts(evidence)
    nominal = table.filter(speed=evidence.slowest)
    if nominal.is_empty():
        return [Absence("survivors", _TITLE, "No tracker found a feature, so none survives to any age.")]
    return [_figure(evidence, table, nominal)]


def _counts(evidence: Evidence) -> pl.DataFrame:
    """Columns tracker, speed, of, age, n: all tracks that reached an age, and those that the curves rest on."""
    keys = ["tracker", "speed"]
    reached = surviving(evidence.reference(evidence.lifetimes)).select(*keys, "age", "n", of=pl.lit(_ALL))
    chosen = {"weighting": "features", "population": evidence.population, "trimming": "trimmed", "statistic": "nu"}
    curve = evidence.reference(evidence.curves).filter(**chosen)
    return pl.concat([reached, curve.select(*keys, "n", age="at", of=pl.lit(_MEASURED)).select(reached.columns)])


def _figure(evidence: Evidence, table: pl.DataFrame, nominal: pl.DataFrame) -> Figure:
    panels = [_panel(nominal, "tracker", evidence.colour, evidence, title=f"speed {evidence.slowest}")]
    if len(evidence.speeds) > 1:
        panels += [_speed_panel(evidence, table, tracker) for tracker in evidence.trackers]
    return Figure(
        id="survivors",
        title=_TITLE,
        shows=f"How many features were still tracked at each age{evidence.where} (logarithmic), all scenes together: "
        "solid all tracks, by the frames they were found in (one found again after a gap is older than drawn), dashed "
        "those whose error is known and that trimming kept, by their age. The horizontal line marks "
        f"{number(evidence.min_features)} features, under which curves are cut.",
        look_for=_look_for(evidence, nominal),
        spec=arranged(panels, columns=2, independent=["color"]),
    )


def _look_for(evidence: Evidence, nominal: pl.DataFrame) -> str:
    parts = [_sentence(evidence, tracker, nominal.filter(tracker=tracker, of=_ALL)) for tracker in evidence.trackers]
    return (
        f"At speed {evidence.slowest}: " + "; ".join(part for part in parts if part) + ". A straight line means that a "
        "track's chance to be lost does not depend on its age."
    )


def _sentence(evidence: Evidence, tracker: str, counts: pl.DataFrame) -> str:
    if counts.is_empty():
        return ""
    begun = int(counts.filter(age=0)["n"].sum())
    enough = counts.filter(pl.col("n") >= evidence.min_features)["age"].to_list()
    half = counts.filter(pl.col("n") * 2 >= begun)["age"].to_list()
    limit = number(evidence.min_features)
    last = f"{limit} or more are left up to age {max(enough)}" if enough else f"never are there {limit}"
    reach = f"at least half reach age {max(half)}" if max(half) else "fewer than half outlive their first frame"
    return f"{tracker} began {count(begun, 'feature')}, of which {reach}; {last}"


def _speed_panel(evidence: Evidence, table: pl.DataFrame, tracker: str) -> Panel:
    counts = table.filter(tracker=tracker).with_columns(pl.col("speed").cast(pl.String))
    return _panel(counts, "speed", evidence.speed_colours(tracker), evidence, title=f"{tracker}, every speed")


def _panel(counts: pl.DataFrame, field: str, colours: Mapping[str, str], evidence: Evidence, *, title: str) -> Panel:
    table = counts.select(field, "of", "age", "n", marks.drawn_count(pl.col("n"))).sort(field, "of", "age")
    tips = [alt.Tooltip(f"{field}:N"), alt.Tooltip("of:N", title="counted"), alt.Tooltip("age:Q"), alt.Tooltip("n:Q")]
    dash = alt.StrokeDash("of:N", scale=alt.Scale(domain=[_ALL, _MEASURED], range=[[1, 0], [4, 3]]), legend=None)
    largest = float(table["drawn"].max() or 1)  # type: ignore[arg-type]
    lines = (
        alt.Chart(marks.rows(table))
        .mark_line()
        .encode(
            x=alt.X("age:Q", title="age (frames of the sequence)", axis=alt.Axis(tickMinStep=1)),
            y=marks.log_count("features (count)", largest),
            color=marks.colour(field, colours, field),
            strokeDash=dash,
            opacity=marks.opacity(field),
            tooltip=tips,
        )
    )
    limit = alt.Chart(alt.InlineData(values=[{"drawn": evidence.min_features}])).mark_rule(color=style.QUIET, clip=True)
    layers = alt.layer(lines, limit.encode(y="drawn:Q")).properties(width=385, height=230, title=title)
    return Panel(layers, (marks.shown(field, colours),))


FAMILY = Family(
    id="survivors",
    title=_TITLE,
    lead="Old features are few. Where few remain, an average says more about these few than about the tracker, so the "
    "curves further down are cut there.",
    figures=figures,
)
