"""Two truths of the same images: how far they disagree, beside the errors of trackers by each of them."""

from collections.abc import Sequence

import altair as alt
import polars as pl

from tracknoise.findings.wording import SPACE, number, pixels
from tracknoise.report import style
from tracknoise.report.bands import describe_intervals
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import TruthQuantity

_NAMES = {
    TruthQuantity.disagreement.value: "disagreement of the truths",
    TruthQuantity.first.value: "error by the first truth",
    TruthQuantity.second.value: "error by the second truth",
}
_COLOURS = dict(zip(_NAMES.values(), style.colours([*_NAMES]), strict=True))
_LAG = alt.X("at:Q", title="frames between the two poses", axis=alt.Axis(tickMinStep=1))
_POSES = {
    "rotation": "rotation per axis (degrees)",
    "translation": "translation per axis (metres)",
}


def figures(data: ReportData) -> Sequence[Figure]:
    """One figure per tracker at the lowest speed, and one of the poses. None without a second truth."""
    table = data.nominal(data.two_truths).filter(trimming=data.trimming, statistic="second")
    present = [tracker for tracker in data.trackers if tracker in table["tracker"]]
    made = [_of_tracker(data, tracker, table.filter(tracker=tracker)) for tracker in present]
    poses = data.reference(data.pose_disagreement)
    return made if poses.is_empty() else [*made, _of_poses(data, poses)]


def _of_tracker(data: ReportData, tracker: str, table: pl.DataFrame) -> Figure:
    points = _points(
        table.filter(pl.col("coordinate").is_in(["u", "v"])).with_columns(
            pl.col("value", "low", "high").sqrt(),
            series=pl.col("quantity").cast(pl.String).replace_strict(_NAMES),
            at=pl.col("age"),
        ),
        least=data.min_features,
    )
    ages = marks.along(points["at"], title="age (frames)", from_zero=True)
    panels = [_panel(points.filter(coordinate=axis), f"root second moment in {axis} (px)", ages) for axis in "uv"]
    return Figure(
        id=f"two-truths-{data.slug(tracker)}",
        title=f"{tracker}, by two truths",
        shows=f"Root second moment about zero by age at speed {data.slowest}{data.where}, of observations that both "
        "truths know. The disagreement is the distance between the true positions by the two truths. It does not "
        f"depend on the errors of the tracker. {describe_intervals(points, of='the curves')}",
        look_for=_sentence(tracker, points),
        spec=arranged(panels, columns=2, independent=["fill"]),
        message=_message(tracker, points.filter(coordinate="u")),
    )


def _message(tracker: str, points: pl.DataFrame) -> str:
    """The disagreement in u at the largest age beside the error."""
    value = dict(points.filter(at=points["at"].max()).select("series", "value").iter_rows())
    pair = [value.get(_NAMES[name]) for name in (TruthQuantity.disagreement, TruthQuantity.first)]
    if None in pair:
        return ""
    return f"The truths differ by {pixels(pair[0])} px in u; the error of {tracker} is {pixels(pair[1])} px"


def _of_poses(data: ReportData, table: pl.DataFrame) -> Figure:
    named = table.with_columns(
        series=pl.lit(_NAMES[TruthQuantity.disagreement]), at=pl.col("lag"), coordinate=pl.col("quantity")
    )
    points = _points(named, least=1)
    panels = [_panel(points.filter(coordinate=name), title, _LAG) for name, title in _POSES.items()]
    first = points.filter(pl.col("at") == points["at"].min())
    value = dict(first.select("coordinate", "value").rows())
    return Figure(
        id="two-truths-poses",
        title="Disagreement of the poses",
        shows="Root mean square difference per axis between the relative poses of the two truths, by the number of "
        f"frames between the two poses{data.where}. {describe_intervals(points, of='the curves')}",
        look_for=f"Over {first['at'].item(0)} frame the relative poses differ by {number(value['rotation'])} degrees "
        f"and {number(1e3 * value['translation'])} mm per axis. Errors that are independent from frame to frame give "
        "a level curve. A random walk grows with the square root of the number of frames.",
        spec=arranged(panels, columns=2, independent=["fill"]),
        message=f"Relative poses of the truths differ by {number(value['rotation'])}{SPACE}° and "
        f"{number(1e3 * value['translation'])}{SPACE}mm per axis",
    )


def _points(table: pl.DataFrame, *, least: int) -> pl.DataFrame:
    """Columns that panels and descriptions need, where there are enough observations."""
    known = table.filter(pl.col("n") >= least, pl.col("value").is_not_null())
    return known.with_columns(n_resampled=pl.col("n_scenes")).sort("coordinate", "series", "at")


def _panel(points: pl.DataFrame, title: str, x: alt.X) -> Panel:
    table = points.rename({"low": "value_low", "high": "value_high"})
    y = alt.Y("value:Q", title=title, scale=alt.Scale(domain=marks.holding(table["value"], table["value_high"])))
    hue, opacity = marks.colour("series", _COLOURS, "truth"), marks.opacity("series")
    tips = [
        alt.Tooltip("series:N", title="of"),
        alt.Tooltip("at:Q", title="frames"),
        alt.Tooltip("value:Q", format=".3g"),
        alt.Tooltip("n:Q"),
    ]
    line = alt.Chart(marks.rows(table.select("series", "at", "value", "n"))).mark_line(clip=True)
    line = line.encode(x=x, y=y, tooltip=tips, color=hue, opacity=opacity)
    band = marks.band(table, "series", _COLOURS, "value", x, y)
    chart = layered(*band, line).properties(width=385, height=240)
    return Panel(chart, (marks.shown("series", _COLOURS),), layer=len(band))


def _sentence(tracker: str, points: pl.DataFrame) -> str:
    """At the largest age: the disagreement in u beside the error."""
    horizontal = points.filter(coordinate="u")
    last = horizontal.filter(at=horizontal["at"].max())
    value = dict(last.select("series", "value").rows())
    disagreement, error = (pixels(value[_NAMES[name]]) for name in (TruthQuantity.disagreement, TruthQuantity.first))
    return (
        f"At age {last['at'].item(0)} the two truths differ by {disagreement} px in u, where the error of {tracker} by "
        f"the first truth is {error} px. Errors of a tracker that are smaller than the disagreement cannot be measured "
        "with these truths. The disagreement contains only errors that the two truths do not share."
    )
