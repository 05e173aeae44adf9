"""Panels of curves by age or frame, with the truth floor, and readings of them for sentences.

- What distinguishes the curves of one figure.
- Values of curves at one age or frame, for the sentences below a figure.
- The truth floor in panels of curves: how large errors would be that come from the truth alone.
- Mean, absolute error and second moment by age or frame, in u and v: a grid of panels that several figures share.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import altair as alt
import polars as pl

from tracknoise.analysis.truth_shares import SIGMAS
from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.report.figures.panels import Panel, Spec, arranged, layered
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.truth_errors import FLOOR_COLUMNS
from tracknoise.topics import bands
from tracknoise.topics.bands import AGE, BOUNDS, FRAME, Axis
from tracknoise.words import listing, number, px

MANY = 6
"""With more curves than this, only the moment about zero is drawn, and not the one about the mean."""


@dataclass(frozen=True, slots=True)
class Series:
    """The curves of one figure, by their names and colours.

    Attributes
    ----------
    field
        Column of the curves that distinguishes them.
    colours
        Colour of each of its values, in order.
    phrase
        How a sentence refers to one of its values, which replaces ``{}``.
    columns
        Titles of the columns of panels for u and v.
    """

    field: str
    colours: Mapping[str, str]
    phrase: str = "for {}"
    columns: tuple[str, str] = ("u (horizontal)", "v (vertical)")

    def present(self, points: pl.DataFrame) -> "Series":
        """The series without the names that have no point but those where errors are zero by construction."""
        names = points.filter(pl.col("since") != 0)[self.field].cast(pl.String).unique()
        return replace(self, colours={name: colour for name, colour in self.colours.items() if name in names})

    @property
    def banded(self) -> list[str]:
        """The names whose curves have a band: all, or only the first of many, because many bands hide each other."""
        names = list(self.colours)
        return names if len(names) <= MANY else names[:1]


@dataclass(frozen=True, slots=True)
class Reading:
    """Values of one curve at one age or frame.

    Attributes
    ----------
    name
        Of the curve.
    since
        Distance from where errors are zero by construction, in frames of the sequence.
    values
        Value in u and v of each statistic, by its role, px.
    """

    name: str
    since: int
    values: Mapping[str, tuple[float, float]]

    def describe(self, role: str) -> str:
        """Write the value of a statistic in both coordinates."""
        u, v = self.values[role]
        return f"{px(u)} in u and {px(v)} in v"


def readings(points: pl.DataFrame, series: Series) -> list[Reading]:
    """Values of all curves at the last age, up to the reference age, that they share.

    Where they share none, each is read at its own age nearest to the reference age. Nothing is read where errors are
    zero by construction. A curve without any other point has no reading.
    """
    curves = {name: points.filter(pl.col(series.field).cast(pl.String) == name) for name in series.colours}
    places = {name: set(curve.filter(pl.col("since") != 0, role="second")["since"]) for name, curve in curves.items()}
    places = {name: ages for name, ages in places.items() if ages}
    shared = set.intersection(*places.values()) if places else set()
    common = {since for since in shared if 0 < since <= REFERENCE_AGE}
    return [_reading(name, curves[name], max(common) if common else _nearest(ages)) for name, ages in places.items()]


def when(found: Sequence[Reading], axis: Axis, *, phrase: str = "for {}") -> str:
    """Say where curves were read, as the start of a sentence. Each curve is named as in a `Series`."""
    places = {reading.since for reading in found}
    if len(places) == 1:
        return f"{axis.opening_place(places.pop())},"
    ages = listing(f"{number(reading.since)} {phrase.format(reading.name)}" for reading in found)
    return f"{axis.opening_place(REFERENCE_AGE)} or the nearest available ({ages}),"


def _nearest(places: set[int]) -> int:
    return min(places, key=lambda since: (abs(since - REFERENCE_AGE), since))


def _reading(name: str, curve: pl.DataFrame, since: int) -> Reading:
    values = {row["role"]: (row["u"], row["v"]) for row in curve.filter(since=since).to_dicts()}
    return Reading(name, since, values)


NAME = "truth floor"
_LIMITS: Mapping[str, tuple[float, ...]] = {"mean": (SIGMAS, -SIGMAS), "second": (1.0,)}
"""Multiples of the floor that are drawn beside each statistic."""
_DASH = [6, 4]
_WIDTH, _SYMBOL = 1.5, 500
"""Width of lines, px, and size of the one in the legend, px^2."""


def floor_lines(table: pl.DataFrame, role: str, coordinate: str, x: alt.X, y: alt.Y) -> list[alt.Chart]:
    """The floor in one panel of curves; both limits of a mean. Empty where nothing is known, or the truth is exact."""
    floor = _pooled(table, coordinate) if role in _LIMITS else table.clear()
    if floor.is_empty():
        return []
    legend = alt.Legend(
        title=None, symbolType="stroke", symbolDash=_DASH, symbolStrokeColor=style.QUIET, symbolSize=_SYMBOL
    )
    width = alt.StrokeWidth("line:N", scale=alt.Scale(domain=[NAME], range=[_WIDTH]), legend=legend)
    tips = [alt.Tooltip("line:N"), alt.Tooltip("at:Q"), alt.Tooltip("floor:Q", title="px")]
    ends = [floor.select("at", line=pl.lit(NAME), floor=limit * pl.col("floor")) for limit in _LIMITS[role]]
    return [
        alt.Chart(marks.rows(end))
        .mark_line(strokeDash=_DASH, color=style.QUIET, clip=True)
        .encode(x=x, y=marks.on(y, "floor"), strokeWidth=width, tooltip=tips)
        for end in ends
    ]


def floor_ends(table: pl.DataFrame, role: str) -> pl.Series:
    """Values of the floor in both panels of one row of curves, for the bounds of their axis."""
    limits = _LIMITS.get(role, ())
    values = [limit * table[name] for limit in limits for name in FLOOR_COLUMNS]
    return pl.concat([pl.Series("floor", [], dtype=pl.Float64), *(value.rename("floor") for value in values)])


def _pooled(table: pl.DataFrame, coordinate: str) -> pl.DataFrame:
    """One floor for all curves, which differ little: the mean, weighted by features. Empty if all are 0."""
    column = FLOOR_COLUMNS["uv".index(coordinate)]
    rows = table.filter(pl.col("role") != "central").drop_nulls(column)
    weighted = (pl.col(column) * pl.col("n")).sum() / pl.col("n").sum()
    floor = rows.filter(pl.col("n") > 0).group_by("at").agg(floor=weighted).sort("at")
    return floor if (floor["floor"] > 0).any() else floor.clear()


def describe_floor(points: pl.DataFrame) -> str:
    """Describe the lines that `floor_lines` draws of points, with a space before; empty if there are none."""
    if not any((points[name].drop_nulls() > 0).any() for name in FLOOR_COLUMNS):
        return ""
    return (
        " Grey dashed lines: the truth floor. It is the RMS that the known errors of the truth cause "
        f"without any error of a tracker. In the row of the mean error, the lines are at {SIGMAS:g} standard "
        "deviations of what these errors add to the mean."
    )


_ROWS = {
    "mean": "mean error (px)",
    "absolute": "mean absolute error (px)",
    "second": "RMS error (px)",
    "core": "core error (px)",
}
"""Roles of the statistics in the rows of the grid, and the titles of their axes."""
_ABOUT = {"second": "about zero", "central": "about the mean"}
HEIGHT = 165
_WIDE = 395
Beside = Callable[[pl.DataFrame, str, Series, Sequence[float]], Panel]
"""Makes a panel to the right of curves, from their points, coordinate, series and bounds of the vertical axis."""


def grid(points: pl.DataFrame, series: Series, axis: Axis, *, beside: Beside | None = None, width: int = _WIDE) -> Spec:
    """Panels of `points` (see `ReportData.points`): rows are statistics, columns are u and v."""
    named = points.with_columns(pl.col(series.field).cast(pl.String))
    chosen = series.present(named)
    shown = named.filter(pl.col(series.field).is_in(list(chosen.colours)))
    present = [role for role in _ROWS if role in shown["role"]]
    panels = [panel for role in present for panel in _row(shown, role, chosen, axis, beside, width)]
    return arranged(panels, columns=4 if beside else 2, independent=["fill", "stroke"])


def describe_bands(points: pl.DataFrame, series: Series) -> str:
    """Describe the bands, and the truth floor, that `grid` draws of the same points."""
    named = points.with_columns(pl.col(series.field).cast(pl.String)).filter(pl.col("role") != "central")
    chosen = series.present(named)
    subject = (
        "the solid curves" if len(chosen.colours) <= MANY else f"the curve {series.phrase.format(chosen.banded[0])}"
    )
    intervals = bands.describe_intervals(named.filter(pl.col(series.field).is_in(chosen.banded)), of=subject)
    return f"{intervals}{describe_floor(named)}"


def _row(points: pl.DataFrame, role: str, series: Series, axis: Axis, beside: Beside | None, width: int) -> list[Panel]:
    """Both coordinates of one statistic, on one scale."""
    table = _drawn(points, role, series)
    banded = table.filter(pl.col("role") == role, pl.col(series.field).is_in(series.banded))
    ends = pl.concat([*(banded[name] for name in BOUNDS), floor_ends(table, role)])
    bounds = marks.holding(pl.concat([table["u"], table["v"]]), ends)
    x = marks.along(_places(points), title=axis.title, from_zero=axis is AGE)
    panels = []
    for coordinate, label in zip("uv", series.columns, strict=True):
        title = alt.Title(label if role == "mean" else "")
        heading = _ROWS[role] if coordinate == "u" else None
        y = alt.Y(f"{coordinate}:Q", scale=alt.Scale(domain=bounds, nice=False), title=heading)
        band = marks.band(banded, series.field, series.colours, coordinate, x, y)
        floor = floor_lines(table, role, coordinate, x, y)
        chart = layered(*band, *_lines(table, series, axis, x, y), *floor)
        selections = marks.shown(series.field, series.colours), marks.zoom("x")
        panels.append(Panel(chart.properties(title=title, width=width, height=HEIGHT), selections, layer=len(band)))
        panels += [beside(table.filter(role=role), coordinate, series, bounds)] if beside else []
    return panels


def _places(points: pl.DataFrame) -> pl.Series:
    """Places of all points, whatever their statistic, and those where errors are zero by construction."""
    places = points["at"].cast(pl.Int64)
    return pl.concat([places, places - points["since"]]).unique()


def _drawn(points: pl.DataFrame, role: str, series: Series) -> pl.DataFrame:
    """The points of one row of panels. The first of the series comes last, so that it is drawn above the others."""
    roles = ["second", "central"] if role == "second" and len(series.colours) <= MANY else [role]
    place = {name: -place for place, name in enumerate(series.colours)}
    order = pl.col(series.field).replace_strict(place, return_dtype=pl.Int64)
    return points.filter(pl.col("role").is_in(roles)).sort("role", order, "at")


def _lines(table: pl.DataFrame, series: Series, axis: Axis, x: alt.X, y: alt.Y) -> list[alt.Chart]:
    labelled = table.with_columns(of=pl.col("role").replace(_ABOUT))
    tips = [
        alt.Tooltip(f"{series.field}:N"),
        alt.Tooltip("at:Q", title=axis.name),
        alt.Tooltip("n:Q", title="features"),
        alt.Tooltip("u:Q", title="u (px)"),
        alt.Tooltip("v:Q", title="v (px)"),
        alt.Tooltip("of:N", title="moment" if "central" in table["role"].unique() else "statistic"),
    ]
    dash = alt.StrokeDash("of:N", scale=alt.Scale(domain=[*_ABOUT.values()], range=[[1, 0], [3, 3]]), legend=None)
    lines = alt.Chart(marks.rows(labelled.select(series.field, "at", "n", "u", "v", "of"))).encode(
        x=x,
        y=y,
        color=marks.colour(series.field, series.colours, series.field),
        opacity=marks.opacity(series.field),
        tooltip=tips,
    )
    curve = lines.mark_line(strokeWidth=1.4 if len(series.colours) > MANY else 1.8).encode(strokeDash=dash)
    size = 6 if len(series.colours) > MANY else 14
    dots = lines.mark_point(size=size, opacity=1).transform_filter("datum.of != 'about the mean'")
    zero = alt.Chart(alt.InlineData(values=[{"zero": 0}])).mark_rule(color="#9aa5b1").encode(y=alt.Y("zero:Q"))
    frames = set(table["at"].cast(pl.Int64) - table["since"])
    vertical = marks.key_frames(frames, style.QUIET) if axis is FRAME else []
    return [curve, dots, zero, *vertical]
