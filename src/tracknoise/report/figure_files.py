"""Figures as Vega-Lite specifications, in the colours of a page, and as SVG and PNG files.

PNG files are drawn by way of a PDF. That takes half the time of drawing them from the SVG (`vl_convert.svg_to_png`),
and the files are less than half as large.
"""

import io
import json
import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from typing import Any

import altair as alt
import pypdfium2 as pdfium
import vl_convert as vlc
from platformdirs import user_cache_path

from tracknoise import atomic
from tracknoise.report import style
from tracknoise.report.figures.figure import Figure
from tracknoise.text import printable

_COMPRESSION = 6


def png_of(svg: str, *, scale: float) -> bytes:
    """Draw a figure."""
    with pdfium.PdfDocument(vlc.svg_to_pdf(svg)) as document:
        image = document[0].render(scale=scale).to_pil()
    buffer = io.BytesIO()
    image.save(buffer, "png", compress_level=_COMPRESSION)
    return buffer.getvalue()


PNG_SCALE = 2
FORMATS = ("svg", "png")
"""Kinds of figure files."""

_PROPERTIES = re.compile(
    r"\b(?:__proto__|constructor|hasOwnProperty|isPrototypeOf|propertyIsEnumerable|toLocaleString|toString|valueOf"
    r"|__(?:define|lookup)[GS]etter__)\b"
)


def specification(figure: Figure) -> dict[str, Any]:
    """Vega-Lite specification of a figure, with the style of the report."""
    spec = {**figure.spec, "description": f"{figure.title}. {figure.shows}"}
    return {**_with_texts(spec, _drawable), "config": style.config()}


def _with_texts(part: Any, change: Callable[[str], str]) -> Any:
    """A part of a specification with all of its texts changed."""
    if isinstance(part, str):
        return change(part)
    if isinstance(part, dict):
        return {key: _with_texts(inner, change) for key, inner in part.items()}
    return [_with_texts(inner, change) for inner in part] if isinstance(part, list | tuple) else part


def _drawable(text: str) -> str:
    """A text, such as a name, that can be drawn.

    No SVG can hold control characters. Vega groups data by name in objects of JavaScript, so a name must not be one of
    the properties that every object has: an invisible sign makes it another.
    """
    return _PROPERTIES.sub(lambda match: f"{match[0][0]}\u2060{match[0][1:]}", printable(text, keep="\n"))


_THEMED = {
    style.INK: "var(--ink)",
    style.QUIET: "var(--quiet)",
    style.FAINT: "var(--grid)",
    style.BLACK: "var(--ink)",
    "#9aa5b1": "var(--axis)",
    style.PAPER: "var(--paper)",
    "#fff": "var(--paper)",
    "white": "var(--paper)",
    "black": "var(--ink)",
}
"""Colours of figures that are others in a dark page, and their names in its style."""


def themed(spec: Mapping[str, Any]) -> Any:
    """A specification with the colours of the page, which follow the colour scheme of the reader."""
    drawn = {name: part for name, part in spec.items() if name != "datasets"}
    return _with_texts(drawn, lambda text: _THEMED.get(text, text)) | {"datasets": spec["datasets"]}


_AROUND_PANEL, _TITLE, _LEGEND, _SPACING, _UNIT = 44, 22, 26, 14, 200
"""Heights in px: axis below a panel, title above it, legend, space between panels, and a panel that states none."""


def height_px(spec: Mapping[str, Any]) -> int:
    """About how high a figure is when it is drawn, px, so that a page can keep room for it.

    Parameters
    ----------
    spec
        As `specification` makes it.
    """
    return _SPACING + _legend_px(spec) + _height(spec)


def _legend_px(spec: Any) -> int:
    """Room for legends above the panels: one row, if any part names a colour in a scale with names."""
    text = json.dumps({name: part for name, part in spec.items() if name not in ("datasets", "config")})
    return _LEGEND if '"color"' in text or '"fill"' in text else 0


def _height(part: Mapping[str, Any]) -> int:
    title = _TITLE if part.get("title") else 0
    if "vconcat" in part:
        return title + sum(_height(panel) + _SPACING for panel in part["vconcat"])
    if "hconcat" in part:
        return title + max(map(_height, part["hconcat"]), default=0)
    if "concat" in part:
        columns = part.get("columns") or len(part["concat"]) or 1
        rows = [part["concat"][at : at + columns] for at in range(0, len(part["concat"]), columns)]
        return title + sum(max(map(_height, row)) + _SPACING for row in rows)
    if "spec" in part:
        return title + _height(part["spec"])
    height = part.get("height", _UNIT)
    return title + _AROUND_PANEL + (height if isinstance(height, int) else _UNIT)


def render(spec: Mapping[str, Any], formats: tuple[str, ...]) -> dict[str, bytes]:
    """Draw a specification once and write it in each of the formats.

    Files have no zoom. Without it the panels need no clipping, which makes drawing three times as fast.
    """
    if not formats:
        return {}
    still = {**spec, "params": [param for param in spec["params"] if param.get("bind") != "scales"]}
    svg = _renumbered_clips(vlc.vegalite_to_svg(json.dumps(still), vl_version=_version()))
    files = {"svg": svg.encode()}
    if "png" in formats:
        files["png"] = png_of(svg, scale=PNG_SCALE)
    return {name: files[name] for name in formats}


def _renumbered_clips(svg: str) -> str:
    """Number clip paths from 1. Vega keeps counting from one drawing to the next, which is not repeatable."""
    clips = list(dict.fromkeys(re.findall(r"\bclip\d+\b", svg)))
    names = {name: f"clip{number}" for number, name in enumerate(clips, start=1)}
    return re.sub(r"\bclip\d+\b", lambda match: names[match.group()], svg)


_BUNDLE = """import sys, vl_convert
text = vl_convert.javascript_bundle("window.vegaEmbed = vegaEmbed;", vl_version=sys.argv[1])
sys.stdout.buffer.write(text.replace("</script", "<\\\\/script").encode())
"""


@cache
def scripts() -> str:
    """Vega, Vega-Lite and Vega-Embed as one self-contained script that can be part of a page.

    It is the same for all reports, so it is kept in the user's cache folder, by the version of the converter. Bundling
    takes seconds and 90 MB: a program of its own does it, which gives the memory back.
    """
    kept = user_cache_path("tracknoise", appauthor=False) / f"vega-{version('vl-convert-python')}-{_version()}.js"
    with suppress(OSError):
        return kept.read_text("utf-8")
    bundled = subprocess.run([sys.executable, "-c", _BUNDLE, _version()], stdout=subprocess.PIPE, check=True).stdout
    with suppress(OSError):
        atomic.write_file(kept, bundled)
    return bundled.decode()


def _version() -> str:
    """Version of Vega-Lite of the specifications: major and minor, as the converter names it."""
    return "v" + ".".join(alt.SCHEMA_VERSION.lstrip("v").split(".")[:2])
