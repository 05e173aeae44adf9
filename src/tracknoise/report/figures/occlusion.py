"""How the error changes when occluded features are left out."""

from collections.abc import Sequence

import altair as alt
import polars as pl

from tracknoise.findings.wording import count, percent, px
from tracknoise.report.axis import Axis
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.figures.message import values
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE

_TITLE = "Visible features compared with all projected ones"
_PANELS = [(role, coordinate) for role in ("absolute", "second") for coordinate in "uv"]
_KEYS = ["tracker", "speed", "role", "since"]


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: both populations, every tracker and speed."""
    if not data.counts.filter(pl.col("name").is_in(["occluded", "out_of_image"]))["n"].sum():
        why = "No feature with a known true position was occluded, so there is nothing to leave out."
        return [Absence("occlusion", _TITLE, why)]
    table = compare(data)
    if table.is_empty():
        why = f"No {data.axis.name} has enough features in both populations to compare them."
        return [Absence("occlusion", _TITLE, why)]
    return [_figure(data, table)]


def compare(data: ReportData) -> pl.DataFrame:
    """Both populations at the last place of each condition that they share, up to the reference age after zero.

    Returns
    -------
    polars.DataFrame
        tracker, speed, role (absolute, second), since, and for each population its n and its value in u and v, px.
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
    both = sides[0].join(sides[1], on=_KEYS)
    last = pl.col("since") == pl.col("since").max().over("tracker", "speed")
    return both.filter(last).sort(_KEYS)


def _figure(data: ReportData, table: pl.DataFrame) -> Figure:
    places, axis = table["since"].unique(), data.axis
    place = axis.place(int(places[0])) if len(places) == 1 else f"{axis.place(REFERENCE_AGE)} or the last before it"
    return Figure(
        id="occlusion",
        title=_TITLE,
        shows=f"{data.errors_shown} {place}{data.where}. A filled dot counts only visible features. A ring counts "
        "all features with a known true position, including occluded ones.",
        look_for=_look_for(data, table),
        spec=arranged([_panel(data, table, key) for key in _PANELS], columns=4),
        message=_message(data, table),
    )


def _message(data: ReportData, table: pl.DataFrame) -> str:
    """Share of the features of each tracker that are occluded."""
    rows = {row["tracker"]: row for row in table.filter(role="second", speed=data.slowest).to_dicts()}
    shares = {name: 1 - row["n_visible"] / row["n_projected"] for name, row in rows.items() if row["n_projected"]}
    return values({name: percent(shares[name]) for name in data.trackers if name in shares}, "Occluded features")


def _look_for(data: ReportData, table: pl.DataFrame) -> str:
    rows = {row["tracker"]: row for row in table.filter(role="second", speed=data.slowest).to_dicts()}
    parts = [_sentences(data.axis, name, rows[name]) for name in data.trackers if name in rows]
    numbers = f"At speed {data.slowest}, {' '.join(parts)} " if parts else ""
    return f"{numbers}Where dot and ring are far apart, occluded features cause part of the error."


def _sentences(axis: Axis, name: str, row: dict[str, float]) -> str:
    occluded = int(row["n_projected"] - row["n_visible"])
    share = percent(occluded / row["n_projected"])
    change = f"Its root second moment in u is {px(row['u_projected'])} with them and {px(row['u_visible'])} without."
    return f"{name} has {count(occluded, 'occluded feature')} ({share}) {axis.place(int(row['since']))}. {change}"


def _panel(data: ReportData, table: pl.DataFrame, key: tuple[str, str]) -> Panel:
    role, coordinate = key
    table = table.filter(role=role).with_columns(
        condition=pl.col("tracker") + ", speed " + pl.col("speed").cast(pl.String)
    )
    order = [f"{tracker}, speed {speed}" for tracker in data.trackers for speed in data.speeds]
    first = key == _PANELS[0]
    y = alt.Y(
        "condition:N", sort=order, title=None, axis=alt.Axis(labels=first, ticks=False, domain=False, labelLimit=220)
    )
    tips = [alt.Tooltip("condition:N"), alt.Tooltip("since:Q", title=f"frames from {data.axis.zero}")]
    tips += [alt.Tooltip(f"{coordinate}_{side}:Q", title=f"{side} (px)") for side in ("visible", "projected")]
    base = alt.Chart(marks.rows(table)).encode(
        y=y, color=marks.colour("tracker", data.colour, "tracker", legend=False), tooltip=tips
    )
    title = f"{data.axis.signs[role]} in {coordinate} (px)"
    x = alt.X(f"{coordinate}_visible:Q", title=title, scale=alt.Scale(zero=True), axis=alt.Axis(tickCount=4))
    link = base.mark_rule(strokeWidth=1.5).encode(x=x, x2=alt.X2(f"{coordinate}_projected:Q"))
    ring = base.mark_point(filled=False, size=60, strokeWidth=1.5).encode(x=alt.X(f"{coordinate}_projected:Q"))
    dot = base.mark_point(filled=True, size=45, opacity=1).encode(x=x)
    rows = table["condition"].n_unique()
    return Panel(layered(link, ring, dot).properties(width=175, height=max(60, 26 * rows)))
