"""Pieces that figures are put together from."""

from collections.abc import Iterable, Mapping

import altair as alt
import polars as pl
import polars.selectors as cs

from tracknoise.report import style
from tracknoise.report.figures.layout import Chart, Selection

MUTED = 0.07
_NONE = 0.6


def rows(table: pl.DataFrame, *, digits: int = 4) -> alt.InlineData:
    """A table as inline data, its numbers rounded to `digits` significant digits: a figure cannot show more.

    It is text, whose copies cost nothing, with the type of every column beside it.
    """
    text = table.with_columns(cs.float().round_sig_figs(digits)).write_csv()
    parse = {name: "number" if kind.is_numeric() else "string" for name, kind in table.schema.items()}
    return alt.InlineData(values=text, format=alt.CsvDataFormat(type="csv", parse=parse))


def shown(field: str, names: Iterable[str]) -> Selection:
    """Which of the names in a legend are shown: all, until a click on one mutes it."""
    start = [{field: name} for name in names]
    select = {"type": "point", "fields": [field], "toggle": "true"}
    return {"name": f"shown_{field}", "select": select, "bind": "legend", "value": start}


def opacity(field: str) -> alt.OpacityValue:
    """Full where `shown` holds the mark's value of `field`, faint where it is muted."""
    return alt.OpacityValue(MUTED, condition={"param": f"shown_{field}", "value": 1})


def zoom(*encodings: str) -> Selection:
    """Drag moves, shift and wheel zoom, a double click goes back; the wheel alone scrolls the page."""
    select = {"type": "interval", "encodings": list(encodings), "zoom": "wheel![event.shiftKey]"}
    return {"name": "zoom", "select": select, "bind": "scales"}


def colour(field: str, colours: Mapping[str, str], title: str, *, legend: bool = True) -> alt.Color:
    """Nominal colours in a stated order."""
    shape = alt.Legend(title=title, symbolType="stroke", columns=8) if legend else None
    return alt.Color(f"{field}:N", scale=_scale(colours), sort=None, legend=shape)


def _scale(colours: Mapping[str, str]) -> alt.Scale:
    return alt.Scale(domain=list(colours), range=list(colours.values()))


def domain(values: pl.Series, *, zero: bool = False) -> list[float]:
    """Axis bounds that hold all values with a little room; never empty."""
    known = values.drop_nulls()
    low, high = (float(known.min()), float(known.max())) if known.len() else (0.0, 1.0)  # type: ignore[arg-type]
    low = min(low, 0.0) if zero else low
    room = 0.06 * (high - low) or 0.5
    return [low if zero and low == 0.0 else low - room, high + room]


def log_count(title: str, largest: float) -> alt.Y:
    """Logarithmic axis for the column ``drawn`` of `drawn_count`."""
    scale = alt.Scale(type="log", domain=[_NONE, max(1.5 * largest, 10.0)], nice=False)
    decades = [10**power for power in range(max(2, len(str(int(largest))) + 1))]
    return alt.Y("drawn:Q", scale=scale, title=title, axis=alt.Axis(values=decades, format="~s"))


def drawn_count(n: pl.Expr) -> pl.Expr:
    """Counts as a logarithmic axis draws them: none lies a little below one."""
    return n.cast(pl.Float64).clip(lower_bound=_NONE).alias("drawn")


def boxes(table: pl.DataFrame, *, field: str, colours: Mapping[str, str], y: alt.Y, width: int, height: int) -> Chart:
    """Box plots: orange median, green triangle mean, whiskers to the last value within 1.5 interquartile ranges.

    Parameters
    ----------
    table
        Columns mean, median, lower_quartile, upper_quartile, lower_whisker, upper_whisker and `field`.
    field, colours
        Column that tells the boxes apart, and the colour of each of its values, in order.
    y
        Axis of the values, for any of the columns.
    width, height
        Of the panel, px.
    """
    names = [*("upper_whisker", "upper_quartile", "mean", "median", "lower_quartile", "lower_whisker")]
    tips = [alt.Tooltip(f"{name}:Q", format=".4~g", title=name.replace("_", " ")) for name in names]
    upright = sum(map(len, colours)) * 7 > width
    x = alt.X(f"{field}:N", sort=list(colours), title=field, axis=alt.Axis(labelAngle=-90 if upright else 0))
    base = alt.Chart(rows(table)).encode(x=x, tooltip=[alt.Tooltip(f"{field}:N"), *tips])
    across = min(34, 0.6 * width / max(1, table.height))

    def at(name: str) -> alt.Y:
        placed = y.copy()
        placed.shorthand = f"{name}:Q"
        return placed

    lower = base.mark_rule(color=style.QUIET).encode(y=at("lower_whisker"), y2="lower_quartile:Q")
    upper = base.mark_rule(color=style.QUIET).encode(y=at("upper_quartile"), y2="upper_whisker:Q")
    caps = [
        base.mark_tick(color=style.QUIET, thickness=1, size=across / 2, orient="horizontal").encode(y=at(end))
        for end in ("lower_whisker", "upper_whisker")
    ]
    box = base.mark_bar(size=across, fillOpacity=0.25, strokeWidth=1.2).encode(
        y=at("lower_quartile"),
        y2="upper_quartile:Q",
        fill=alt.Fill(f"{field}:N", scale=_scale(colours), legend=None),
        stroke=alt.Stroke(f"{field}:N", scale=_scale(colours), legend=None),
    )
    middle = base.mark_tick(color=style.MEDIAN, thickness=2.5, size=across, orient="horizontal", opacity=1).encode(
        y=at("median")
    )
    mean = base.mark_point(shape="triangle-up", color=style.MEAN, size=36, opacity=1).encode(y=at("mean"))
    return alt.layer(lower, upper, *caps, box, middle, mean).properties(width=width, height=height)
