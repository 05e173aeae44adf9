"""The frame on the first screen with tracks, and error vectors in the colours of the trackers."""

import base64
import math
from collections.abc import Mapping
from dataclasses import dataclass

import polars as pl
import vl_convert as vlc
from markupsafe import Markup

from tracknoise.report.figures.frames import Scene, first_scene
from tracknoise.report.report_data import ReportData
from tracknoise.text import printable

_WIDEST = 640
"""Width of the image in the page, px; smaller images keep theirs."""
_QUALITY = 78
MOST_FEATURES = 150
"""Features drawn per tracker."""
_MOST_NAMED = 4
"""With more trackers the key has no names."""


@dataclass(frozen=True, slots=True)
class AnnotatedFrame:
    """A frame with tracks and errors.

    Attributes
    ----------
    svg
        The drawing.
    caption
        What it shows.
    key
        Colours of the trackers, by name; empty where they are too many for a line.
    """

    svg: Markup
    caption: str
    key: Mapping[str, str]


def annotated_frame(data: ReportData) -> AnnotatedFrame | None:
    """Draw the first scene that has an image; None where none has."""
    scene = first_scene(data)
    if scene is None:
        return None
    width, height = scene.entry.width, scene.entry.height
    parts = [part for tracker in data.trackers for part in _tracker(scene, tracker, data.colour[tracker])]
    times = f"magnified {scene.magnification} times" if scene.magnification > 1 else "not magnified"
    caption = printable(
        f"Scene {scene.entry.sequence.scene}, frame {scene.entry.snapshot_frame}: tracks (white) and error vectors "
        f"({times}), in the colour of each tracker."
    )
    svg = Markup(
        '<svg class="picture" role="img" aria-label="{caption}" viewBox="-0.5 -0.5 {width} {height}">'
        '<image href="data:image/jpeg;base64,{image}" x="-0.5" y="-0.5" width="{width}" height="{height}"/>'
        "{parts}</svg>"
    ).format(caption=caption, width=width, height=height, image=_jpeg(scene), parts=Markup("").join(parts))
    return AnnotatedFrame(svg, caption, data.colour if len(data.trackers) <= _MOST_NAMED else {})


def _jpeg(scene: Scene) -> str:
    """The image of a scene, small, in base64."""
    width, height = scene.entry.width, scene.entry.height
    png = base64.b64encode(scene.png).decode()
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}">'
        f'<image href="data:image/png;base64,{png}" width="{width}" height="{height}"/></svg>'
    )
    small = vlc.svg_to_jpeg(svg, scale=min(1.0, _WIDEST / width), quality=_QUALITY)
    return base64.b64encode(small).decode()


def _tracker(scene: Scene, tracker: str, colour: str) -> list[Markup]:
    all_features = scene.features.filter(tracker=tracker)
    features = all_features.gather_every(max(1, math.ceil(all_features.height / MOST_FEATURES)))
    trails = scene.trails.filter(tracker=tracker).join(features.select("track"), on="track", how="semi")
    thick = scene.entry.width / 480
    paths = [
        Markup('<polyline points="{points}"/>').format(points=" ".join(f"{u:.1f},{v:.1f}" for u, v in rows))
        for rows in _by_track(trails)
    ]
    lines = [_vector(scene, row) for row in features.select("u_px", "v_px", "du_px", "dv_px", "error_px").iter_rows()]
    style = '<g fill="none" stroke="{stroke}" stroke-width="{thick:.1f}" opacity="{opacity}">{marks}</g>'
    return [
        Markup(style).format(stroke="#ffffff", thick=0.7 * thick, opacity=0.55, marks=Markup("").join(paths)),
        Markup(style).format(stroke=colour, thick=1.6 * thick, opacity=0.95, marks=Markup("").join(lines)),
    ]


def _by_track(trails: pl.DataFrame) -> list[list[tuple[float, float]]]:
    groups = trails.sort("track", "frame").group_by("track", maintain_order=True)
    return [part.select("u_px", "v_px").rows() for _, part in groups if part.height > 1]


def _vector(scene: Scene, row: tuple[float, ...]) -> Markup:
    """A line from the observed to the true position, magnified, with a dot where the feature was observed."""
    u, v, du, dv, error = row
    length = scene.magnification * min(1.0, scene.longest_px / error if error else 1.0)
    return Markup('<path d="M{u:.1f},{v:.1f}h.01"/><path d="M{u:.1f},{v:.1f}l{du:.1f},{dv:.1f}"/>').format(
        u=u, v=v, du=-length * du, dv=-length * dv
    )
