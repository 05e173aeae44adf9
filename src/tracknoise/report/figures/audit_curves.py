"""Errors by age as measured, and after the corrections that the audit of the truth proposes."""

from collections.abc import Sequence

import altair as alt
import polars as pl

from tracknoise.findings.wording import pixels
from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.report_data import ReportData
from tracknoise.tables.audit_schema import EVERYTHING, MEASURED

_NAMES = {MEASURED: "as measured", EVERYTHING: "all corrections"}
_VALUES = {
    "mean_u_px": "mean error in u (px)",
    "mean_v_px": "mean error in v (px)",
    "core_u_px": "core in u (px)",
    "core_v_px": "core in v (px)",
}
_SIZE = {"width": 395, "height": 165}


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker that took part in the audit, where it found a fault."""
    curves = data.audit_curves
    if not set(curves["correction"].unique()) - {MEASURED}:
        why = "The audit found no fault of the truth that could be corrected." if curves.height else _not_audited(data)
        return [Absence("audit", "Errors before and after corrections", why)]
    present = [tracker for tracker in data.trackers if tracker in curves["tracker"]]
    return [_of_tracker(data, tracker, curves.filter(tracker=tracker)) for tracker in present]


def _not_audited(data: ReportData) -> str:
    texts = data.audit["text"].to_list()
    return texts[0] if texts else "The truth of this run was not audited."


def _of_tracker(data: ReportData, tracker: str, curves: pl.DataFrame) -> Figure:
    names = {
        name: _NAMES.get(name, f"+ {name.replace('_', ' ')}")
        for name in curves["correction"].unique(maintain_order=True)
    }
    named = curves.with_columns(series=pl.col("correction").replace_strict(names), at=pl.col("age").cast(pl.Int64))
    colours = dict(zip(names.values(), style.colours([*names.values()]), strict=True))
    panels = [_panel(named, value, title, colours) for value, title in _VALUES.items()]
    return Figure(
        id=f"audit-{data.slug(tracker)}",
        title=f"{tracker}, before and after corrections of the truth",
        shows="Mean error and core by age of the observations that the audit used. Each correction is shown together "
        "with those above it in the legend.",
        look_for=_sentence(named),
        spec=arranged(panels, columns=2, independent=["fill"]),
        message=_message(tracker, named),
    )


def _message(tracker: str, curves: pl.DataFrame) -> str:
    """How the corrections change the core of the tracker in u at the largest age."""
    last = curves.filter(at=curves["at"].max())
    before, after = (last.filter(correction=name)["core_u_px"].item() for name in (MEASURED, EVERYTHING))
    if before is None or after is None or pixels(before) == pixels(after):
        return ""
    return f"Corrections change the core of {tracker} in u from {pixels(before)} to {pixels(after)} px"


def _panel(curves: pl.DataFrame, value: str, title: str, colours: dict[str, str]) -> Panel:
    known = curves.drop_nulls(value)
    x = marks.along(known["at"], title="age (frames)", from_zero=True)
    y = alt.Y(f"{value}:Q", title=title, scale=alt.Scale(domain=marks.holding(known[value], known[value]), nice=False))
    tips = [alt.Tooltip("series:N", title="errors"), alt.Tooltip("at:Q"), alt.Tooltip(f"{value}:Q", format=".3g")]
    hue, opacity = marks.colour("series", colours, "errors"), marks.opacity("series")
    line = alt.Chart(marks.rows(known.select("series", "at", value))).mark_line(clip=True)
    drawn = line.encode(x=x, y=y, color=hue, opacity=opacity, tooltip=tips)
    return Panel(layered(drawn).properties(**_SIZE), (marks.shown("series", colours),), layer=0)


def _sentence(curves: pl.DataFrame) -> str:
    """Mean errors at the largest age, before and after."""
    last = curves.filter(at=curves["at"].max())
    before, after = (last.filter(correction=name).row(0, named=True) for name in (MEASURED, EVERYTHING))
    changes = (f"{pixels(before[name])} to {pixels(after[name])} px" for name in ("mean_u_px", "mean_v_px"))
    return f"At age {last['at'][0]} the corrections change the mean error from {' in u, and from '.join(changes)} in v."
