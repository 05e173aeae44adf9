"""Colours, fonts and sizes. A tracker has the same colour in all figures. A few speeds are shades of it."""

from collections.abc import Sequence
from typing import Any

PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
"""Okabe and Ito's colours, which people with any colour vision can distinguish."""
INK, QUIET, FAINT = "#1b2430", "#5b6775", "#e3e7ec"
BLACK, PAPER = "#000000", "#ffffff"
ORDINAL = ("#380045", "#5f358c", "#8b59ed", "#62b3ea", "#086b63", "#6ca361", "#efab06", "#a76002", "#890d16")
"""Nine colours in the order of their hues, from violet to red. Any two differ for any colour vision."""
MOST_SHADES = 4
"""More shades of one colour than this are hard to distinguish."""
MEDIAN, MEAN = "#E69F00", "#009E73"
FONT = "Helvetica Neue, Helvetica, Arial, Liberation Sans, DejaVu Sans, sans-serif"


def colours(names: Sequence[str]) -> list[str]:
    """One colour per name, by position."""
    return [PALETTE[i % len(PALETTE)] for i in range(len(names))]


def shades(colour: str, n: int) -> list[str]:
    """`n` shades of a colour, from dark to light, the colour itself between them."""
    if n == 1:
        return [colour]
    steps = [-0.55 + 1.05 * i / (n - 1) for i in range(n)]
    return [_mixed(colour, "#000000", -step) if step < 0 else _mixed(colour, "#ffffff", step) for step in steps]


def levels(colour: str, n: int) -> list[str]:
    """`n` colours for values in an order.

    They are shades of a colour, from dark to light, if there are at most `MOST_SHADES`. Otherwise they are those of
    `ORDINAL`, and colours between them if these are too few.
    """
    if n <= MOST_SHADES:
        return shades(colour, n)
    places = [(len(ORDINAL) - 1) * i / (n - 1) for i in range(n)]
    return [ORDINAL[round(place)] if n <= len(ORDINAL) else _between(ORDINAL, place) for place in places]


def _between(stops: Sequence[str], place: float) -> str:
    """The colour at a place among evenly spaced stops, counted from 0."""
    first = min(int(place), len(stops) - 2)
    return _mixed(stops[first], stops[first + 1], place - first)


def _mixed(colour: str, other: str, share: float) -> str:
    pairs = zip(_channels(colour), _channels(other), strict=True)
    return "#" + "".join(f"{round((1 - share) * a + share * b):02x}" for a, b in pairs)


def _channels(colour: str) -> list[int]:
    return [int(colour[i : i + 2], 16) for i in (1, 3, 5)]


def config() -> dict[str, Any]:
    """Vega-Lite configuration of every figure."""
    text = {"labelFont": FONT, "titleFont": FONT, "labelFontSize": 12, "titleFontSize": 12, "titleFontWeight": 500}
    ink = {"labelColor": QUIET, "titleColor": INK}
    return {
        "background": PAPER,
        "font": FONT,
        "padding": 6,
        "axis": {**text, **ink, "gridColor": FAINT, "domainColor": "#9aa5b1", "tickColor": "#9aa5b1", "tickSize": 4},
        "legend": {**text, **ink, "orient": "top", "symbolStrokeWidth": 2.5, "titleAnchor": "start"},
        "header": {**text, **ink, "labelFontSize": 12},
        "title": {"font": FONT, "fontSize": 12, "fontWeight": 600, "color": INK, "anchor": "start", "frame": "group"},
        "view": {"stroke": None},
        "line": {"strokeWidth": 1.8, "strokeJoin": "round"},
        "point": {"filled": True},
        "concat": {"spacing": 14},
    }
