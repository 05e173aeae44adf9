"""Errors by depth, by the nearest depth edge, by the angle of incidence, by parallax, and by occlusion."""

from collections.abc import Sequence

import altair as alt
import polars as pl

from tracknoise.findings.wording import MINUS, percent, px
from tracknoise.report import style
from tracknoise.report.bands import describe_intervals
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import Panel, arranged, layered
from tracknoise.report.figures.surroundings_message import surroundings_message
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import EdgeSide, Occlusion, Surrounding

_PROPERTIES = {
    Surrounding.depth: "depth (m)",
    Surrounding.edge: "distance to a depth edge (px)",
    Surrounding.incidence: "angle of incidence (°)",
    Surrounding.parallax: "parallax (px)",
    Surrounding.occlusion: "occluded",
}
_ROWS = {"mean": "mean error (px)", "second": "root second moment (px)"}
_COORDINATES = {"u": "u", "v": "v", "along": "along the motion"}
_DECADES = [step * 10.0**power for power in range(-4, 4) for step in (1, 2, 5)]
_SIDES = {EdgeSide.far: "On the far side", EdgeSide.near: "On the near side", EdgeSide.none: "Elsewhere"}
_FEWEST = 20
"""Classes with fewer errors than this are left out."""
_WIDTHS = {Surrounding.edge: 210, Surrounding.occlusion: 70, Surrounding.incidence: 130}


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker, at the lowest speed."""
    return [_figure(data, tracker) for tracker in data.trackers]


def _figure(data: ReportData, tracker: str) -> Figure | Absence:
    name, title = f"surroundings-{data.slug(tracker)}", f"{tracker}, by surroundings of the feature"
    every = data.nominal(data.surrounding_errors).filter(pl.col("tracker") == tracker)
    at = _last_age(every, data.min_features)
    if at is None:
        why = f"No age has {data.min_features} features with a known error and a known depth."
        return Absence(name, title, why)
    table = every.filter(pl.col("at") == at, pl.col("n") >= _FEWEST)
    points = _points(table)
    present = [one for one in _PROPERTIES if one in points["surrounding"].unique()]
    bounded = points.drop_nulls(["low", "high"]).rename({"n_scenes": "n_resampled"})
    where = f"{data.axis.place(data.since_zero(at))} at speed {data.slowest}{data.where}"
    shows = (
        f"Untrimmed errors of {tracker} {where}, by what surrounds a feature in its first frame. Distances to a depth "
        "edge are negative on its far side, which is the surface behind. The class none has no edge within 15 px. "
        "Parallax is how far the true position moved since its error was zero, relative to the median of all features. "
        "Occlusion is that of the point: never while it is tracked, later, or now. All but the last class are of "
        f"visible features. Classes with fewer than {_FEWEST} features are left out. "
        f"{describe_intervals(bounded, of='the values', marks='Bars around')}"
    )
    colours = dict(zip(_COORDINATES.values(), style.shades(data.colour[tracker], len(_COORDINATES)), strict=True))
    panels = [_panel(points, one, row, colours) for row in _ROWS for one in present]
    spec = arranged(panels, columns=len(present))
    return Figure(name, title, shows, _look_for(table), spec, surroundings_message(tracker, table))


def _last_age(errors: pl.DataFrame, least: int) -> int | None:
    """The last age at which enough features have a known depth."""
    counted = errors.filter(surrounding=Surrounding.depth, coordinate="u", statistic="mean")
    ages = counted.group_by("at").agg(pl.col("n").sum()).filter(pl.col("n") >= least)["at"].sort()
    return int(ages[-1]) if ages.len() else None


def _points(table: pl.DataFrame) -> pl.DataFrame:
    """Means and root second moments, px, with the names of coordinates as the legend has them."""
    shown = table.filter(pl.col("statistic").is_in(list(_ROWS)), pl.col("surrounding") != Surrounding.side)
    root = pl.col("statistic") == "second"
    values = pl.col("value", "low", "high")
    return shown.with_columns(
        pl.when(root).then(values.clip(lower_bound=0.0).sqrt()).otherwise(values),
        pl.col("coordinate").replace_strict(_COORDINATES),
        pl.col("class").str.replace_all("-", MINUS, literal=True).str.replace_all(".0", "", literal=True),
    )


def _panel(points: pl.DataFrame, surrounding: Surrounding, row: str, colours: dict[str, str]) -> Panel:
    table = points.filter(surrounding=surrounding, statistic=row)
    x = alt.X(
        "class:N",
        sort=_order(table, surrounding),
        title=_PROPERTIES[surrounding] if row == "second" else None,
        axis=alt.Axis(labelAngle=-50, labels=row == "second"),
        scale=alt.Scale(paddingInner=0.3),
    )
    first = surrounding == Surrounding.depth
    axis = alt.Axis(labels=first) if row == "mean" else alt.Axis(labels=first, values=_DECADES, format="~g")
    y = alt.Y(
        "value:Q", title=_ROWS[row] if first else None, scale=_scale(points.filter(statistic=row), row), axis=axis
    )
    shift = alt.XOffset("coordinate:N", sort=list(colours), scale=alt.Scale(paddingOuter=0.2))
    hue, opacity = marks.colour("coordinate", colours, "error"), marks.opacity("coordinate")
    drawn = (table if row == "mean" else _positive(table)).select("class", "coordinate", "n", "value", "low", "high")
    base = alt.Chart(marks.rows(drawn)).encode(x=x, xOffset=shift, color=hue, opacity=opacity)
    tips = [
        alt.Tooltip(f"{name}:{kind}")
        for name, kind in (("class", "N"), ("coordinate", "N"), ("n", "Q"), ("value", "Q"))
    ]
    dot = base.mark_point(size=26, filled=True, clip=True).encode(y=y, tooltip=tips)
    bar = base.mark_rule(strokeWidth=1.4, clip=True).encode(y=marks.on(y, "low"), y2=alt.Y2("high:Q"))
    chart = layered(dot, bar, *_zero(row))
    width = _WIDTHS.get(surrounding, 165)
    return Panel(chart.properties(width=width, height=170), (marks.shown("coordinate", colours),))


def _positive(table: pl.DataFrame) -> pl.DataFrame:
    """Rows that a logarithmic axis can show; bounds of zero begin below all values."""
    known = table.filter(pl.col("value") > 0)
    least = known["value"].min()
    return known if least is None else known.with_columns(pl.col("low", "high").clip(lower_bound=float(least) / 10.0))  # type: ignore[arg-type]


def _scale(points: pl.DataFrame, row: str) -> alt.Scale:
    """Linear for means. Logarithmic for root second moments, over a few decades at most."""
    values, ends = points["value"], pl.concat([points["low"], points["high"]])
    if row == "mean":
        return alt.Scale(domain=marks.holding(values, ends), nice=False)
    known = values.filter(values > 0)
    low, high = (float(known.min()), float(known.max())) if known.len() else (0.1, 1.0)  # type: ignore[arg-type]
    return alt.Scale(type="log", domain=[low / 1.6, high * 2.0], nice=False)


def _zero(row: str) -> list[alt.Chart]:
    """A line at zero, where the scale has one."""
    if row != "mean":
        return []
    line = alt.Chart(alt.InlineData(values=[{"zero": 0}])).mark_rule(color=style.QUIET, strokeWidth=0.8)
    return [line.encode(y=alt.Y("zero:Q"))]


def _order(table: pl.DataFrame, surrounding: Surrounding) -> list[str]:
    if surrounding == Surrounding.occlusion:
        return [*Occlusion]
    return table.sort("class_low", nulls_last=True)["class"].unique(maintain_order=True).to_list()


def _look_for(table: pl.DataFrame) -> str:
    """Numbers of the sides of depth edges in u, and what they mean."""
    rows = {(row["class"], row["statistic"]): row["value"] for row in _in_u(table, Surrounding.side).to_dicts()}
    parts = [
        f"{name} of depth edges are {percent(rows[side, 'share'])} of the features, with a mean error in u of "
        f"{px(rows[side, 'mean'])}."
        for side, name in list(_SIDES.items())[:2]
        if (side, "mean") in rows
    ]
    if parts and (EdgeSide.none, "mean") in rows:
        parts.append(f"Elsewhere the mean error in u is {px(rows[EdgeSide.none, 'mean'])}.")
    hidden = {
        row["statistic"]: row
        for row in _in_u(table, Surrounding.occlusion).filter(pl.col("class") == Occlusion.now).to_dicts()
    }
    if "second_removed" in hidden:
        share, removed = (percent(hidden[name]["value"]) for name in ("share", "second_removed"))
        parts.append(
            f"Occluded are {share} of the features. Excluding them removes {removed} of the second moment in u."
        )
    return " ".join(
        [
            *parts,
            "A feature beside a depth edge has two surfaces in its window, and is drawn along by the other one. "
            "Errors that grow towards near or far depths suggest a wrong depth scale or offset, or wrong translations.",
        ]
    )


def _in_u(table: pl.DataFrame, surrounding: Surrounding) -> pl.DataFrame:
    return table.filter(surrounding=surrounding, coordinate="u")
