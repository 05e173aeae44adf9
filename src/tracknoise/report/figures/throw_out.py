"""The largest error of every track, before trimming, and where trimming cuts."""

from collections.abc import Sequence

import altair as alt
import polars as pl

from tracknoise.findings.wording import SPACE, count, number, percent, px
from tracknoise.report import style
from tracknoise.report.axis import FRAME
from tracknoise.report.evidence import Evidence
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.figures.layout import Panel, arranged

_TITLE = "Errors before trimming"
_DECADES = alt.Axis(values=[10.0**power for power in range(-3, 4)], format="~g")


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """One panel a tracker, one line a speed."""
    table = evidence.reference(evidence.errors)
    if not table["n"].sum():
        return [Absence("errors", _TITLE, "No track has a known true position, so there is no error to count.")]
    trackers = [name for name in evidence.trackers if table.filter(tracker=name)["n"].sum()]
    panels = [
        _panel(evidence, tracker, table, width=max(240, 850 // min(2, len(trackers)) - 40)) for tracker in trackers
    ]
    figure = Figure(
        id="errors",
        title=_TITLE,
        shows="For every track the largest distance between where the tracker found it and where it was, over its "
        f"whole life{evidence.where}, both axes logarithmic; the leftmost bin holds all errors below "
        f"{_first_bound(table)}. " + _cut_explained(evidence),
        look_for=_look_for(evidence, trackers),
        spec=arranged(panels, columns=2, independent=["color"]),
    )
    return [figure]


def _first_bound(table: pl.DataFrame) -> str:
    return f"{table.filter(bin_low_px=0.0)['bin_high_px'][0]:g}{SPACE}px"


def _cut_explained(evidence: Evidence) -> str:
    if evidence.percentile is None:
        return "Nothing was trimmed in this run."
    return (
        f"The dashed lines mark the cut: the {number(int(evidence.percentile))}th percentile of each scene, its median "
        "over the scenes."
    )


def _look_for(evidence: Evidence, trackers: Sequence[str]) -> str:
    parts = [_sentence(evidence, tracker) for tracker in trackers]
    return (
        f"At speed {evidence.slowest}: "
        + "; ".join(parts)
        + ". A second hump on the right is a group of tracks that follow the wrong thing."
    )


def _sentence(evidence: Evidence, tracker: str) -> str:
    lived = evidence.nominal(evidence.lifetimes).filter(tracker=tracker)
    total, once = (_tracks(lived), _tracks(lived.filter(lifetime=1)))
    trims = evidence.nominal(evidence.trims).filter(tracker=tracker)
    dropped, measured = int(trims["n_dropped"].sum()), int(trims["n_measured"].sum())
    counted = f"of {tracker}'s {count(total, 'track')}, "
    counted += (
        f"{number(measured)} are alive in the key frame and have a known error"
        if evidence.axis is FRAME
        else f"{number(once)} have only their first frame, where the error is 0"
    )
    cuts = trims["threshold_px"].drop_nulls().sort().to_list()
    if evidence.percentile is None or not cuts:
        return counted
    low, high = px(cuts[0]), px(cuts[-1])
    where = low if low == high else f"{low} to {high}, depending on the scene,"
    return f"{counted}; the cut lies at {where} and drops {percent(dropped / measured)} of those with a known error"


def _tracks(lifetimes: pl.DataFrame) -> int:
    return int(lifetimes["n_ended"].sum()) + int(lifetimes["n_censored"].sum())


def _panel(evidence: Evidence, tracker: str, errors: pl.DataFrame, *, width: int) -> Panel:
    bins = errors.filter(tracker=tracker).with_columns(speed=pl.col("speed").cast(pl.String))
    hue = marks.colour("speed", evidence.speed_colours(tracker), "speed", legend=len(evidence.speeds) > 1)
    title = alt.Title(tracker, color=evidence.colour[tracker])
    chart = alt.layer(_histogram(bins, hue), _cuts(evidence, tracker, hue))
    chart = chart.properties(width=width, height=230, title=title)
    return Panel(chart, (marks.shown("speed", evidence.speed_colours(tracker)),))


def _histogram(bins: pl.DataFrame, hue: alt.Color) -> alt.Chart:
    """Steps from bin to bin; the first and the last bin, which have no finite size, are drawn a tenth decade wide."""
    tenth = 10**0.1
    low = pl.when(pl.col("bin_low_px") > 0).then("bin_low_px").otherwise(pl.col("bin_high_px") / tenth)
    used = bins.filter(pl.col("n") > 0)
    table = bins.filter(pl.col("bin_low_px") <= used["bin_high_px"].max()).select(
        "speed", "n", marks.drawn_count(pl.col("n")), low=low, to="bin_high_px", of="bin_low_px"
    )
    x = alt.X("low:Q", scale=alt.Scale(type="log", nice=False), title="largest error of the track (px)", axis=_DECADES)
    tips = [
        alt.Tooltip("speed:N"),
        alt.Tooltip("of:Q", title="from (px)"),
        alt.Tooltip("to:Q", title="to (px)"),
        alt.Tooltip("n:Q", title="tracks"),
    ]
    y = marks.log_count("tracks (count)", float(table["drawn"].max()))  # type: ignore[arg-type]
    chart = alt.Chart(marks.rows(table)).mark_line(interpolate="step-after")
    encoded: alt.Chart = chart.encode(x=x, y=y, color=hue, opacity=marks.opacity("speed"), tooltip=tips)
    return encoded


def _cuts(evidence: Evidence, tracker: str, hue: alt.Color) -> alt.Chart:
    """A line at each speed's cut; one at 0 px, where a logarithmic axis has no place, is left out."""
    table = evidence.cuts(tracker).filter(pl.col("cut") > 0).with_columns(pl.col("speed").cast(pl.String))
    tips = [alt.Tooltip("speed:N"), alt.Tooltip("cut:Q", title="cut (px)")]
    chart = alt.Chart(marks.rows(table)).mark_rule(strokeDash=[5, 3], strokeWidth=1.5, color=style.INK)
    encoded: alt.Chart = chart.encode(x="cut:Q", color=hue, opacity=marks.opacity("speed"), tooltip=tips)
    return encoded


FAMILY = Family(
    id="errors-before-trimming",
    title=_TITLE,
    lead="Some tracks follow the wrong thing. Trimming drops the tracks with the largest errors, scene by scene, as "
    "the paper does; what is dropped is no longer in the curves that follow, unless they say untrimmed.",
    figures=figures,
)
