"""How many claimed intervals of depths hold the true depth, by what noise is assumed."""

from collections.abc import Sequence

import altair as alt
import polars as pl

from tracknoise.findings.wording import SPACE, sentence_case
from tracknoise.report import style
from tracknoise.report.bands import describe_intervals
from tracknoise.report.depth_shares import LEVELS, depth_shares
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.report_data import ReportData

_ID, _TITLE = "depth-intervals", "Depths that claimed intervals hold"
_COLOURS = dict(zip(("residual sigma", "consistent sigma", "whole tracks", "1 px"), style.PALETTE[:4], strict=True))
_WHY = (
    "It takes true depths, tracks of at least five observations, and two scenes or more. Noise is tried on scenes that "
    "it was not learned from."
)


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: a panel per tracker at the lowest speed."""
    rows = depth_shares(data)
    if rows.is_empty():
        return [Absence(_ID, _TITLE, _WHY)]
    table = rows.rename({"value": "u", "low": "u_low", "high": "u_high"})
    present = [tracker for tracker in data.trackers if tracker in table["tracker"]]
    bounded = table.drop_nulls(["u_low", "u_high"]).rename({"n_scenes": "n_resampled"})
    shows = (
        f"Share of windows whose true depth is inside the claimed interval, by the level of the interval, at speed "
        f"{data.slowest}{data.where}. Points are triangulated with the true poses. The noise was learned from other "
        f"scenes. Windows of {_windows(table, present)}. {describe_intervals(bounded, of='the lines')}"
    )
    panels = [_panel(table, tracker) for tracker in present]
    spec = arranged(panels, columns=2, independent=["fill"])
    return [Figure(_ID, _TITLE, shows, _advice(table, present), spec, _message(table))]


def _message(table: pl.DataFrame) -> str:
    """The tracker whose residuals mislead most; empty where none is shown to mislead."""
    few = table.filter(pl.col("u_high") < 95.0, covariance="residual sigma", at=95).sort("u")
    if few.is_empty():
        return ""
    tracker, share = few.select("tracker", "u").row(0)
    return f"With the sigma of residuals, 95{SPACE}% depth intervals of {tracker} hold {share:.0f}{SPACE}%"


def _windows(table: pl.DataFrame, trackers: Sequence[str]) -> str:
    lengths = {tracker: table.filter(tracker=tracker)["window"][0] for tracker in trackers}
    if len(set(lengths.values())) == 1:
        return f"{lengths[trackers[0]]} observations"
    return ", ".join(f"{length} observations ({tracker})" for tracker, length in lengths.items())


def _advice(table: pl.DataFrame, trackers: Sequence[str]) -> str:
    """What a 95 % interval holds, and what to look for."""
    sentences = []
    for tracker in trackers:
        own = table.filter(tracker=tracker, at=95)
        held = {name: f"{share:.0f}{SPACE}%" for name, share in own.select("covariance", "u").iter_rows()}
        stated = [f"{held[name]} with the {name}" for name in _COLOURS if name in held and name.endswith("sigma")]
        stated += [f"{held['whole tracks']} with the covariance of whole tracks"] if "whole tracks" in held else []
        sentences.append(f"For {tracker}, 95{SPACE}% intervals hold {', '.join(stated)}.")
    last = "Lines below the diagonal claim depths that are more certain than they are."
    return " ".join([*map(sentence_case, sentences), last])


def _panel(table: pl.DataFrame, tracker: str) -> Panel:
    own = table.filter(tracker=tracker).sort("covariance", "at")
    columns = own.select("covariance", "at", "n", "u", "u_low", "u_high")
    scale = alt.Scale(domain=[40, 100], nice=False, clamp=True)
    x = alt.X("at:Q", title="level of the claimed interval (%)", scale=scale, axis=alt.Axis(values=[*LEVELS.values()]))
    y = alt.Y("u:Q", title="true depths inside (%)", scale=alt.Scale(domain=[0, 100], nice=False))
    tips = [alt.Tooltip("covariance:N"), alt.Tooltip("at:Q", title="level (%)"), alt.Tooltip("n:Q", title="windows"),
            alt.Tooltip("u:Q", title="inside (%)")]  # fmt: skip
    diagonal = alt.Chart(alt.InlineData(values=[{"at": 40, "u": 40}, {"at": 100, "u": 100}]))
    line = diagonal.mark_line(color="#8a949e", strokeDash=[4, 3]).encode(x=x, y=y)
    hue = marks.colour("covariance", _COLOURS, "assumed noise", columns=2)
    drawn = alt.Chart(marks.rows(columns.select("covariance", "at", "n", "u")))
    curve = drawn.mark_line(point=alt.OverlayMarkDef(size=20))
    curve = curve.encode(x=x, y=y, color=hue, opacity=marks.opacity("covariance"), tooltip=tips)
    band = marks.band(columns, "covariance", _COLOURS, "u", x, y)
    chart = layered(line, *band, curve).properties(width=395, height=230, title=alt.Title(tracker))
    return Panel(chart, (marks.shown("covariance", _COLOURS),), layer=1 + len(band))
