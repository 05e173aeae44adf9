"""Frames of the track with the largest error: a cross marks the observed position, a circle the true one."""

import base64
import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from PIL import Image

from tracknoise.text import counted
from tracknoise.words import px

_MOST_TILES, _TILE = 8, 64


@dataclass(frozen=True, slots=True)
class Strip:
    """Frames of one track.

    Attributes
    ----------
    png
        Tiles side by side, grey.
    marks
        For each tile the true position in it, as shares of its side; None if it is unknown. The observed one is that of
        the middle pixel, to half a pixel.
    caption
        What is seen.
    """

    png: bytes
    marks: tuple[tuple[float, float] | None, ...]
    caption: str

    def tiles(self) -> Markup:
        """The frames, as a part of a page."""
        width = len(self.marks) * _TILE
        marks = Markup("").join(_mark(place * _TILE, true) for place, true in enumerate(self.marks))
        png = base64.b64encode(self.png).decode()
        return Markup(
            '<svg class="tiles" role="img" aria-label="{caption}" viewBox="0 0 {width} {tile}" width="{width}">'
            '<image href="data:image/png;base64,{png}" width="{width}" height="{tile}" image-rendering="pixelated" '
            'preserveAspectRatio="none"/>{marks}</svg>'
        ).format(caption=self.caption, width=width, tile=_TILE, png=png, marks=marks)


def worst_track(seen: Mapping[str, Any], tracker: str) -> Strip | None:
    """Frames of the track of a tracker with the largest error of all that have pictures; None where none has.

    Parameters
    ----------
    seen
        Tracks with patches, as `tracknoise.report.looks.looks` returns them.
    tracker
        Its name.
    """
    groups = [group for group in seen["groups"] if group["tracker"] == tracker and len(group["strip_at"]) > 1]
    if not groups:
        return None
    group = max(groups, key=lambda candidate: float(np.hypot(*candidate["tracks"][0]["error"])))
    track, frames, side = group["tracks"][0], group["strip_at"], seen["patch_px"]
    n = len(frames)
    with Image.open(io.BytesIO(base64.b64decode(group["strip"]))) as image:
        tiles = np.asarray(image.convert("L")).reshape(side, n, side)
    chosen = sorted({round(place) for place in np.linspace(0, n - 1, min(n, _MOST_TILES))})
    path = dict(
        zip(track["path"]["frame"], zip(track["path"]["du_px"], track["path"]["dv_px"], strict=True), strict=True)
    )
    errors = (path.get(frames[place]) for place in chosen)
    marks = tuple(None if error is None else (0.5 - error[0] / side, 0.5 - error[1] / side) for error in errors)
    size = float(np.hypot(*track["error"]))
    frames_on = track["frame"] - track["anchor_frame"]
    caption = f"Worst track of {tracker}: {px(size)} off after {counted(frames_on, 'frame')}."
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(tiles[:, chosen].reshape(side, -1))).save(buffer, "png")
    return Strip(buffer.getvalue(), marks, caption)


def _mark(left: float, true: tuple[float, float] | None) -> Markup:
    """A cross and a circle, white on dark so that they are seen on any image."""
    x, y = left + _TILE / 2, _TILE / 2
    shapes = Markup('<path d="M{a:.1f},{y:.1f}h12M{x:.1f},{b:.1f}v12"/>').format(a=x - 6, x=x, y=y, b=y - 6)
    if true is not None:
        shapes += _true_mark(left, x, y, left + true[0] * _TILE, true[1] * _TILE)
    border = Markup('<path d="M{x},0v{tile}" stroke="#000000" stroke-width="1"/>').format(x=left, tile=_TILE)
    style_of = '<g fill="none" stroke="{stroke}" stroke-width="{width}">{shapes}</g>'
    return border + Markup("").join(
        Markup(style_of).format(stroke=stroke, width=width, shapes=shapes)
        for stroke, width in (("#000000", 3.2), ("#ffffff", 1.4))
    )


def _true_mark(left: float, x: float, y: float, true_x: float, true_y: float) -> Markup:
    """A circle at the true place; where it is outside the tile, a line from the observed place to the border."""
    if left <= true_x <= left + _TILE and 0.0 <= true_y <= _TILE:
        return Markup('<circle cx="{x:.1f}" cy="{y:.1f}" r="6"/>').format(x=true_x, y=true_y)
    du, dv = true_x - x, true_y - y
    reach = _TILE / 2 / max(abs(du), abs(dv))
    return Markup('<path d="M{x:.1f},{y:.1f}l{du:.1f},{dv:.1f}"/>').format(x=x, y=y, du=reach * du, dv=reach * dv)
