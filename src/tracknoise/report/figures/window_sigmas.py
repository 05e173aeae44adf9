"""The noise to give to an estimator, by the length of its windows."""

from collections.abc import Sequence

import altair as alt
import polars as pl

from tracknoise.report import style
from tracknoise.report.answer.sigma import estimator_sentence, sigma_message
from tracknoise.report.bands import describe_intervals
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.report_data import ReportData

_ID, _TITLE = "window-sigmas", "Noise to set, by length of the window"
_LINES = {"consistent_sigma": "to set", "residual_core": "what residuals look like"}
_COLOURS = dict(zip(_LINES.values(), style.PALETTE[:2], strict=True))
_ADVICE = (
    "Set the upper line where the two differ: residuals alone look too small where errors of one track are alike from "
    "frame to frame. If the lines were flat and equal, errors would be independent in every frame."
)


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: a panel per tracker at the lowest speed."""
    rows = data.nominal(data.window_sigmas).filter(pl.col("quantity").is_in([*_LINES]), trimming=data.trimming)
    if rows.is_empty():
        return [Absence(_ID, _TITLE, "No track was long enough for a window of an estimator.")]
    table = rows.with_columns(line=pl.col("quantity").replace_strict(_LINES), at=pl.col("window").cast(pl.Int64))
    present = [tracker for tracker in data.trackers if tracker in table["tracker"]]
    panels = [_panel(table, tracker) for tracker in present]
    bounded = table.drop_nulls(["low", "high"]).rename({"n_scenes": "n_resampled"})
    shows = (
        f"Standard deviation of one coordinate at speed {data.slowest}{data.where}, by the number of observations in a "
        "window. The first line is the sigma for which depths of points are as certain as an estimator claims. The "
        f"second is what its residuals look like, without the tails. {describe_intervals(bounded, of='the lines')}"
    )
    look_for = " ".join([*filter(None, (estimator_sentence(data, tracker) for tracker in present)), _ADVICE])
    spec = arranged(panels, columns=2, independent=["fill"])
    return [Figure(_ID, _TITLE, shows, look_for, spec, sigma_message(data))]


def _panel(table: pl.DataFrame, tracker: str) -> Panel:
    own = table.filter(tracker=tracker).sort("line", "at")
    columns = own.select("line", "at", "n", u="value", u_low="low", u_high="high")
    x = marks.along(table["at"], title="observations in a window", from_zero=True)
    domain = marks.holding(table["value"], pl.concat([table["low"], table["high"]]))
    y = alt.Y("u:Q", title="sigma (px)", scale=alt.Scale(domain=domain, nice=False))
    tips = [alt.Tooltip("line:N"), alt.Tooltip("at:Q", title="window"), alt.Tooltip("n:Q", title="windows"),
            alt.Tooltip("u:Q", title="sigma (px)")]  # fmt: skip
    line = alt.Chart(marks.rows(columns.select("line", "at", "n", "u"))).mark_line(point=alt.OverlayMarkDef(size=20))
    hue = marks.colour("line", _COLOURS, "sigma")
    curve = line.encode(x=x, y=y, color=hue, opacity=marks.opacity("line"), tooltip=tips)
    band = marks.band(columns, "line", _COLOURS, "u", x, y)
    chart = layered(*band, curve).properties(width=395, height=190, title=alt.Title(tracker))
    return Panel(chart, (marks.shown("line", _COLOURS),), layer=len(band))
