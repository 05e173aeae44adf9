"""The stored image of a sequence as the background of a panel, with its axes in pixels."""

import base64
from collections.abc import Mapping
from typing import Any

import altair as alt

from tracknoise.report.figures.layout import Spec
from tracknoise.report.report_data import ReportData
from tracknoise.tables.manifest import SequenceEntry

IMAGE = "image"
"""Name of the image of figures that have one."""


def stored_image(data: ReportData, entry: SequenceEntry) -> bytes | None:
    """The PNG file with the image of a sequence. None if the run has none.

    Raises
    ------
    StoreError
        If it is damaged.
    """
    if not data.run.snapshot_path(entry.key).exists():
        return None
    content = data.run.snapshot(entry.key)
    return content if content.startswith(b"\x89PNG") else None


def with_images(spec: Spec, images: Mapping[str, tuple[SequenceEntry, bytes]]) -> Spec:
    """A specification with the images that its backgrounds show.

    Parameters
    ----------
    spec
        From `tracknoise.report.figures.layout.arranged`.
    images
        Sequence and PNG file of each image, by the name in its `background`.
    """
    return {**spec, "datasets": {**spec["datasets"], **{name: [_placed(*image)] for name, image in images.items()}}}


def _placed(entry: SequenceEntry, png: bytes) -> dict[str, Any]:
    """An image and its edges, px."""
    url = "data:image/png;base64," + base64.b64encode(png).decode()
    return {"url": url, "left": -0.5, "right": entry.width - 0.5, "top": -0.5, "bottom": entry.height - 0.5}


def size(entry: SequenceEntry, width: int) -> dict[str, Any]:
    """Width and height of a panel, px, with the aspect ratio of the image."""
    return {"width": width, "height": round(width * entry.height / entry.width)}


def along_u(shorthand: str, entry: SequenceEntry) -> alt.X:
    """Horizontal axis of a panel with an image."""
    scale = alt.Scale(domain=[-0.5, entry.width - 0.5], nice=False, zero=False)
    return alt.X(shorthand, scale=scale, title="u (px)", axis=alt.Axis(grid=False, tickCount=6))


def along_v(shorthand: str, entry: SequenceEntry) -> alt.Y:
    """Vertical axis of a panel with an image, pointing down."""
    scale = alt.Scale(domain=[entry.height - 0.5, -0.5], nice=False, zero=False)
    return alt.Y(shorthand, scale=scale, title="v (px)", axis=alt.Axis(grid=False, tickCount=5))


def background(entry: SequenceEntry, name: str = IMAGE) -> alt.Chart:
    """The image of this name. The centre of its first pixel is at 0, and its border half a pixel outside."""
    x, y = along_u("left:Q", entry), along_v("top:Q", entry)
    chart = alt.Chart(alt.NamedData(name)).mark_image(aspect=False, clip=True)
    encoded: alt.Chart = chart.encode(x=x, x2=alt.X2("right:Q"), y=y, y2=alt.Y2("bottom:Q"), url=alt.Url("url:N"))
    return encoded
