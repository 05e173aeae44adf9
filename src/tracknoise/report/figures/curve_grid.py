"""Mean, absolute error and spread by age, in u and v: the grid of panels that several figures share."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import altair as alt
import polars as pl

from tracknoise.report.figures import marks
from tracknoise.report.figures.box_plot import box_plot
from tracknoise.report.figures.layout import Chart, Panel, Spec, arranged
from tracknoise.report.sentences import NU, listing, px
from tracknoise.statistics.box import box_summary
from tracknoise.statistics.summary import REFERENCE_AGE

STATISTICS = {"nu": f"mean error {NU} (px)", "eta": "mean absolute error η (px)", "Phi": "root second moment √Φ (px)"}
"""Rows of the grid, and what their axes say."""
_AXES = {"u": "u (horizontal)", "v": "v (vertical)"}
_ABOUT = {"Phi": "about zero", "central": "about the mean"}
_HEIGHT = 165


@dataclass(frozen=True, slots=True)
class Series:
    """What tells the curves of one grid apart.

    Attributes
    ----------
    field
        Column of the curves.
    colours
        Colour of each of its values, in order.
    """

    field: str
    colours: Mapping[str, str]


def grid(points: pl.DataFrame, series: Series, *, boxes: bool) -> Spec:
    """Panels of `points` (see `Evidence.points`): rows nu, eta and root second moment, columns u and v.

    Parameters
    ----------
    points
        Curves of one value of everything but `series.field`.
    series
        What has a colour of its own.
    boxes
        Whether box plots of each curve's values stand beside it.
    """
    named = points.with_columns(pl.col(series.field).cast(pl.String))
    present = [name for name in series.colours if name in named[series.field].unique()]
    chosen = Series(series.field, {name: series.colours[name] for name in present})
    panels = [panel for statistic in STATISTICS for panel in _row(named, statistic, chosen, boxes=boxes)]
    return arranged(panels, columns=4 if boxes else 2, independent=["fill", "stroke"])


@dataclass(frozen=True, slots=True)
class Reading:
    """The curves of one name at one age: for each statistic its value in u and v, px."""

    name: str
    age: int
    values: Mapping[str, tuple[float, float]]

    def told(self, statistic: str) -> str:
        """Write the value of a statistic in both coordinates."""
        u, v = self.values[statistic]
        return f"{px(u)} in u and {px(v)} in v"


def readings(points: pl.DataFrame, field: str, names: Sequence[str]) -> list[Reading]:
    """Values of each curve at the last age, not above the reference age, that all of them have.

    Where they share none, each is read at the last age that it has itself. Age 0 is never read, for every error is
    zero there; a curve with nothing else has no reading.
    """
    curves = {name: points.filter(pl.col(field).cast(pl.String) == name) for name in names}
    ages = {name: set(curve.filter(pl.col("at") > 0, statistic="Phi")["at"]) for name, curve in curves.items()}
    ages = {name: found for name, found in ages.items() if found}
    common = {age for age in set.intersection(*ages.values()) if age <= REFERENCE_AGE} if ages else set()
    return [_reading(name, curves[name], max(common or found)) for name, found in ages.items()]


def when(found: Sequence[Reading]) -> str:
    """Say at which age, or ages, curves were read."""
    ages = {reading.age for reading in found}
    if len(ages) == 1:
        return f"At age {ages.pop()}"
    return "At their last ages (" + listing(f"{reading.name} {reading.age}" for reading in found) + ")"


def _reading(name: str, curve: pl.DataFrame, age: int) -> Reading:
    values = {row["statistic"]: (row["u"], row["v"]) for row in curve.filter(at=age).to_dicts()}
    return Reading(name, age, values)


def _row(points: pl.DataFrame, statistic: str, series: Series, *, boxes: bool) -> list[Panel]:
    """Both coordinates of one statistic, on one scale."""
    names = ["Phi", "central"] if statistic == "Phi" else [statistic]
    table = points.filter(pl.col("statistic").is_in(names)).sort("statistic", series.field, "at")
    bounds = marks.domain(pl.concat([table["u"], table["v"]]), zero=True)
    panels = []
    for axis, label in _AXES.items():
        title = alt.Title(label if statistic == "nu" else "")
        heading = STATISTICS[statistic] if axis == "u" else None
        y = alt.Y(f"{axis}:Q", scale=alt.Scale(domain=bounds, nice=False), title=heading)
        lines = _lines(table, series, y).properties(title=title, width=240 if boxes else 395, height=_HEIGHT)
        panels.append(Panel(lines, (marks.shown(series.field, series.colours), marks.zoom("x"))))
        if boxes:
            panels.append(Panel(_boxes(table.filter(statistic=statistic), axis, series, bounds)))
    return panels


def _lines(table: pl.DataFrame, series: Series, y: alt.Y) -> Chart:
    labelled = table.with_columns(of=pl.col("statistic").replace(_ABOUT))
    tips = [
        alt.Tooltip(f"{series.field}:N"),
        alt.Tooltip("at:Q", title="age"),
        alt.Tooltip("n:Q", title="features"),
        alt.Tooltip("u:Q", title="u (px)"),
        alt.Tooltip("v:Q", title="v (px)"),
        alt.Tooltip("of:N", title="moment" if "central" in table["statistic"].unique() else "statistic"),
    ]
    dash = alt.StrokeDash("of:N", scale=alt.Scale(domain=[*_ABOUT.values()], range=[[1, 0], [3, 3]]), legend=None)
    data = marks.rows(labelled.select(series.field, "at", "n", "u", "v", "of"))
    oldest = float(table["at"].max())  # type: ignore[arg-type]
    lines = alt.Chart(data).encode(
        x=alt.X(
            "at:Q",
            title="age (frames of the sequence)",
            axis=alt.Axis(tickMinStep=1),
            scale=alt.Scale(domain=[0, 1.03 * (oldest or 1)], nice=False),
        ),
        y=y,
        color=marks.colour(series.field, series.colours, series.field),
        opacity=marks.opacity(series.field),
        tooltip=tips,
    )
    curve = lines.mark_line().encode(strokeDash=dash)
    dots = lines.mark_point(size=14, opacity=1).transform_filter("datum.of != 'about the mean'")
    zero = alt.Chart(alt.InlineData(values=[{"zero": 0}])).mark_rule(color="#9aa5b1").encode(y="zero:Q")
    return alt.layer(curve, dots, zero)


def _boxes(table: pl.DataFrame, axis: str, series: Series, bounds: list[float]) -> Chart:
    """Spread of a curve's values, without age 0, where they are zero by construction."""
    aged = table.filter(pl.col("at") > 0)
    summaries = [
        {series.field: name, **asdict(box_summary(aged.filter(pl.col(series.field) == name)[axis]))}
        for name in series.colours
    ]
    scale = alt.Scale(domain=bounds, nice=False)
    bare = alt.Y("median:Q", scale=scale, title=None, axis=alt.Axis(labels=False, ticks=False))
    table = pl.DataFrame(summaries)
    return box_plot(table, field=series.field, colours=series.colours, y=bare, width=105, height=_HEIGHT)
