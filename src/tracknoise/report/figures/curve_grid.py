"""Mean, absolute error and spread by age or frame, in u and v: the grid of panels that several figures share."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import altair as alt
import polars as pl

from tracknoise.findings.wording import number, px
from tracknoise.report import bands
from tracknoise.report.axis import FRAME, Axis
from tracknoise.report.bands import BOUNDS
from tracknoise.report.figures import marks
from tracknoise.report.figures.box_plot import box_plot
from tracknoise.report.figures.layout import Chart, Panel, Spec, arranged
from tracknoise.report.sentences import listing
from tracknoise.statistics.box import box_summary
from tracknoise.statistics.definitions import REFERENCE_AGE

_ROWS = {
    "mean": "mean error {} (px)",
    "absolute": "mean absolute error {} (px)",
    "second": "root second moment {} (px)",
}
"""Roles of the statistics in the rows of the grid, and what their axes say of them and their sign."""
_ABOUT = {"second": "about zero", "central": "about the mean"}
_HEIGHT = 165
_WIDTHS = {"alone": (395, 0), "few": (240, 105), "many": (196, 156)}
"""Of a panel of curves and of the box plot beside it, px."""
MANY = 6
"""Of more curves than this only the moment about zero is drawn, not the one about the mean too."""


@dataclass(frozen=True, slots=True)
class Series:
    """What tells the curves of one grid apart.

    Attributes
    ----------
    field
        Column of the curves.
    colours
        Colour of each of its values, in order.
    phrase
        How a sentence names one of its values: what stands for ``{}`` in it.
    columns
        What the columns of panels for u and v are called.
    """

    field: str
    colours: Mapping[str, str]
    phrase: str = "for {}"
    columns: tuple[str, str] = ("u (horizontal)", "v (vertical)")


def grid(points: pl.DataFrame, series: Series, axis: Axis, *, boxes: bool) -> Spec:
    """Panels of `points` (see `Evidence.points`): rows mean, absolute error and root second moment, columns u and v.

    Parameters
    ----------
    points
        Curves of one value of everything but `series.field`.
    series
        What has a colour of its own.
    axis
        What the curves run along.
    boxes
        Whether box plots of each curve's values stand beside it.
    """
    named = points.with_columns(pl.col(series.field).cast(pl.String))
    chosen = _present(named, series)
    panels = [panel for role in _ROWS for panel in _row(named, role, chosen, axis, boxes=boxes)]
    return arranged(panels, columns=4 if boxes else 2, independent=["fill", "stroke"])


@dataclass(frozen=True, slots=True)
class Reading:
    """The curves of one name at one place: for each statistic, by its role, its value in u and v, px.

    `since` is the distance from where errors are zero by construction, in frames of the sequence.
    """

    name: str
    since: int
    values: Mapping[str, tuple[float, float]]

    def told(self, role: str) -> str:
        """Write the value of a statistic in both coordinates."""
        u, v = self.values[role]
        return f"{px(u)} in u and {px(v)} in v"


def readings(points: pl.DataFrame, series: Series) -> list[Reading]:
    """Values of each curve at the last place, up to the reference age after zero, that all of them have.

    Where they share none, each is read at the place of its own that is nearest to the reference age. Where errors are
    zero by construction nothing is read; a curve with nothing else has no reading.
    """
    curves = {name: points.filter(pl.col(series.field).cast(pl.String) == name) for name in series.colours}
    places = {name: set(curve.filter(pl.col("since") != 0, role="second")["since"]) for name, curve in curves.items()}
    places = {name: found for name, found in places.items() if found}
    shared = set.intersection(*places.values()) if places else set()
    common = {since for since in shared if 0 < since <= REFERENCE_AGE}
    return [_reading(name, curves[name], max(common) if common else _nearest(found)) for name, found in places.items()]


def when(found: Sequence[Reading], axis: Axis, *, phrase: str = "for {}") -> str:
    """Say where curves were read, each named as in a `Series`."""
    places = {reading.since for reading in found}
    if len(places) == 1:
        return axis.place(places.pop()).capitalize()
    each = listing(f"{number(reading.since)} {phrase.format(reading.name)}" for reading in found)
    return f"{axis.place(REFERENCE_AGE).capitalize()}, or as near to it as each comes ({each}),"


def _nearest(places: set[int]) -> int:
    return min(places, key=lambda since: (abs(since - REFERENCE_AGE), since))


def _reading(name: str, curve: pl.DataFrame, since: int) -> Reading:
    values = {row["role"]: (row["u"], row["v"]) for row in curve.filter(since=since).to_dicts()}
    return Reading(name, since, values)


def _row(points: pl.DataFrame, role: str, series: Series, axis: Axis, *, boxes: bool) -> list[Panel]:
    """Both coordinates of one statistic, on one scale."""
    many = len(series.colours) > MANY
    drawn = ["second", "central"] if role == "second" and not many else [role]
    place = {name: -place for place, name in enumerate(series.colours)}  # the first is drawn last, above the others
    order = pl.col(series.field).replace_strict(place, return_dtype=pl.Int64)
    table = points.filter(pl.col("role").is_in(drawn)).sort("role", order, "at")
    banded = table.filter(pl.col("role") == role, pl.col(series.field).is_in(_banded(series)))
    bounds = marks.holding(pl.concat([table["u"], table["v"]]), pl.concat(banded[name] for name in BOUNDS))
    wide, narrow = _WIDTHS["alone" if not boxes else "many" if many else "few"]
    panels = []
    for coordinate, label in zip("uv", series.columns, strict=True):
        title = alt.Title(label if role == "mean" else "")
        heading = _ROWS[role].format(axis.signs[role]) if coordinate == "u" else None
        y = alt.Y(f"{coordinate}:Q", scale=alt.Scale(domain=bounds, nice=False), title=heading)
        x = marks.along(axis, table["at"])
        band = marks.band(banded, series.field, series.colours, coordinate, x, y)
        lines = _lines(table, series, axis, x, y)
        chart = alt.layer(*band, *lines).properties(title=title, width=wide, height=_HEIGHT)
        selections = marks.shown(series.field, series.colours), marks.zoom("x")
        panels.append(Panel(chart, selections, layer=len(band)))
        if boxes:
            panels.append(Panel(_boxes(table.filter(role=role), coordinate, series, bounds, width=narrow)))
    return panels


def bands_text(points: pl.DataFrame, series: Series) -> str:
    """A sentence about the bands that `grid` draws of the same points."""
    named = points.with_columns(pl.col(series.field).cast(pl.String)).filter(pl.col("role") != "central")
    chosen = _present(named, series)
    of = "the solid curves" if len(chosen.colours) <= MANY else f"the curve {series.phrase.format(_banded(chosen)[0])}"
    return bands.told(named.filter(pl.col(series.field).is_in(_banded(chosen))), of=of)


def _present(points: pl.DataFrame, series: Series) -> Series:
    """The series without the names that have no curve."""
    names = points[series.field].unique()
    return replace(series, colours={name: colour for name, colour in series.colours.items() if name in names})


def _banded(series: Series) -> list[str]:
    """Whose curves have a band: all, or of many the first alone, for many bands hide each other."""
    names = list(series.colours)
    return names if len(names) <= MANY else names[:1]


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
    data = marks.rows(labelled.select(series.field, "at", "n", "u", "v", "of"))
    lines = alt.Chart(data).encode(
        x=x,
        y=y,
        color=marks.colour(series.field, series.colours, series.field),
        opacity=marks.opacity(series.field),
        tooltip=tips,
    )
    curve = lines.mark_line(strokeWidth=1.2 if len(series.colours) > MANY else 1.8).encode(strokeDash=dash)
    size = 6 if len(series.colours) > MANY else 14
    dots = lines.mark_point(size=size, opacity=1).transform_filter("datum.of != 'about the mean'")
    zero = alt.Chart(alt.InlineData(values=[{"zero": 0}])).mark_rule(color="#9aa5b1").encode(y="zero:Q")
    vertical = marks.key_frames(table["at"].cast(pl.Int64) - table["since"]) if axis is FRAME else []
    return [curve, dots, zero, *vertical]


def _boxes(table: pl.DataFrame, coordinate: str, series: Series, bounds: list[float], *, width: int) -> Chart:
    """Spread of a curve's values, without those that are zero by construction."""
    measured = table.filter(pl.col("since") != 0)
    summaries = [
        {series.field: name, **asdict(box_summary(measured.filter(pl.col(series.field) == name)[coordinate]))}
        for name in series.colours
    ]
    scale = alt.Scale(domain=bounds, nice=False)
    bare = alt.Y("median:Q", scale=scale, title=None, axis=alt.Axis(labels=False, ticks=False))
    table = pl.DataFrame(summaries)
    return box_plot(table, field=series.field, colours=series.colours, y=bare, width=width, height=_HEIGHT)
