"""Parts that figures share: data, legends, colours, bands and axes."""

from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias, TypeVar

import altair as alt
import polars as pl
import polars.selectors as cs

from tracknoise.report import style

Channel = TypeVar("Channel", alt.X, alt.Y)
Selection: TypeAlias = Mapping[str, Any]
"""A Vega-Lite selection parameter, without its views."""
MUTED = 0.07
BAND = 0.15
_NONE = 0.6
_FEW_TICKS = 300
"""Decades alone are too few ticks for a logarithmic axis of a smaller range."""


def rows(table: pl.DataFrame, *, digits: int = 4) -> alt.InlineData:
    """A table as inline data, with numbers rounded to `digits` significant digits.

    It is CSV text, which is cheap to copy, with the type of every column.
    """
    text = table.with_columns(cs.float().round_sig_figs(digits)).write_csv()
    parse = {name: "number" if kind.is_numeric() else "string" for name, kind in table.schema.items()}
    return alt.InlineData(values=text, format=alt.CsvDataFormat(type="csv", parse=parse))


def shown(field: str, names: Iterable[str]) -> Selection:
    """The names in a legend that are shown: all, until a click mutes one."""
    start = [{field: name} for name in names]
    select = {"type": "point", "fields": [field], "toggle": "true"}
    return {"name": f"shown_{field}", "select": select, "bind": "legend", "value": start}


def opacity(field: str) -> alt.OpacityValue:
    """Full where `shown` holds the value of `field`, faint where it is muted."""
    return alt.OpacityValue(MUTED, condition={"param": f"shown_{field}", "value": 1})


def faint(field: str) -> alt.OpacityValue:
    """As `opacity`, for bands: faint enough to see what lies below."""
    return alt.OpacityValue(0.02, condition={"param": f"shown_{field}", "value": BAND})


def zoom(*encodings: str) -> Selection:
    """Drag to move, shift and wheel to zoom, double-click to reset. The wheel alone scrolls the page."""
    select = {"type": "interval", "encodings": list(encodings), "zoom": "wheel![event.shiftKey]"}
    return {"name": "zoom", "select": select, "bind": "scales"}


def colour(field: str, colours: Mapping[str, str], title: str, *, legend: bool = True, columns: int = 10) -> alt.Color:
    """Nominal colours in a stated order, with a legend of so many columns at most."""
    shape = alt.Legend(title=title, symbolType="stroke", columns=columns) if legend else None
    return alt.Color(f"{field}:N", scale=scale(colours), sort=None, legend=shape)


def fill(field: str, colours: Mapping[str, str]) -> alt.Fill:
    """The same colours for an area, without a legend."""
    return alt.Fill(f"{field}:N", scale=scale(colours), sort=None, legend=None)


def scale(colours: Mapping[str, str]) -> alt.Scale:
    """Colours by name, in their order."""
    return alt.Scale(domain=list(colours), range=list(colours.values()))


def domain(values: pl.Series, *, zero: bool = False) -> list[float]:
    """Axis bounds that include all values with some margin. Never empty."""
    numbers = values.drop_nulls()
    low, high = (float(numbers.min()), float(numbers.max())) if numbers.len() else (0.0, 1.0)  # type: ignore[arg-type]
    low = min(low, 0.0) if zero else low
    room = 0.06 * (high - low) or 0.5
    return [low if zero and low == 0.0 else low - room, high + room]


def holding(curves: pl.Series, ends: pl.Series) -> list[float]:
    """Axis bounds that include zero, the curves, and the ends of their bands unless these would shrink the curves."""
    numbers = curves.drop_nulls()
    if numbers.is_empty():
        return domain(numbers, zero=True)
    low, high = min(0.0, float(numbers.min())), max(0.0, float(numbers.max()))  # type: ignore[arg-type]
    extent = pl.concat([numbers, ends.drop_nulls()]).clip(low - (high - low), high + (high - low))
    return domain(extent, zero=True)


def band(
    table: pl.DataFrame, field: str, colours: Mapping[str, str], coordinate: str, x: alt.X, y: alt.Y
) -> list[alt.Chart]:
    """Areas between the bounds of a coordinate along ``at``, one per value of `field`. Empty without bounds."""
    low, high = f"{coordinate}_low", f"{coordinate}_high"
    bounds = table.select(field, "at", low, high).drop_nulls()
    if bounds.is_empty():
        return []
    area = alt.Chart(rows(bounds)).mark_area(clip=True, tooltip=None)
    return [area.encode(x=x, y=on(y, low), y2=alt.Y2(f"{high}:Q"), fill=fill(field, colours), opacity=faint(field))]


def along(places: pl.Series, *, title: str, from_zero: bool) -> alt.X:
    """Horizontal axis of curves, column ``at``: from zero, as ages, or from the first of the places, as frames."""
    low, high = (float(places.min()), float(places.max())) if places.len() else (0.0, 1.0)  # type: ignore[arg-type]
    room = 0.03 * ((high if from_zero else high - low) or 1.0)
    scale = alt.Scale(domain=[0.0 if from_zero else low - room, high + room], nice=False)
    return alt.X("at:Q", title=title, axis=alt.Axis(tickMinStep=1), scale=scale)


def key_frames(frames: Iterable[int], colour: str) -> list[alt.Chart]:
    """A labelled line at each key frame."""
    base = alt.Chart(alt.InlineData(values=[{"at": frame} for frame in sorted(set(frames))]))
    rule = base.mark_rule(color=colour, strokeWidth=0.8).encode(x=alt.X("at:Q"))
    label = base.mark_text(text="key frame", color=colour, fontSize=12, dy=-6).encode(x=alt.X("at:Q"), y=alt.value(0))
    return [rule, label]


def zero_line() -> alt.Chart:
    """A thin horizontal line at zero."""
    rule = alt.Chart(alt.InlineData(values=[{"zero": 0}])).mark_rule(color=style.QUIET, strokeWidth=0.8)
    drawn: alt.Chart = rule.encode(y=alt.Y("zero:Q"))
    return drawn


def on(channel: Channel, column: str) -> Channel:
    """The same axis for another column."""
    placed = channel.copy()
    placed.shorthand = f"{column}:Q"
    return placed


def log_count(title: str, drawn: pl.Series, *marked: float) -> alt.Y:
    """Logarithmic axis for the column ``drawn`` of `drawn_count`, from the smallest count to the largest."""
    counts = [*drawn, *marked] or [1.0]
    least, largest = min(counts), max(counts)
    low, high = max(_NONE, least / 1.5), max(1.5 * largest, 10.0 * least)
    steps = (1,) if high / low > _FEW_TICKS else (1, 2, 5)
    ticks = [step * 10**power for power in range(len(str(int(high)))) for step in steps]
    scale = alt.Scale(type="log", domain=[low, high], nice=False)
    return alt.Y("drawn:Q", scale=scale, title=title, axis=alt.Axis(values=ticks, format="~s"))


def drawn_count(n: pl.Expr) -> pl.Expr:
    """Counts as a logarithmic axis draws them. Zero is drawn a little below one."""
    return n.cast(pl.Float64).clip(lower_bound=_NONE).alias("drawn")
