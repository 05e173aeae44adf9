"""The film of a run as pictures: a panel for each tracker, with its tracks and true positions, as the page has them.

A white line is where a feature was observed in the last frames, a cross where it is observed, and a circle where it
really is. The line between them is its error, magnified in all panels alike.
"""

import base64
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from tracknoise.exceptions import StoreError
from tracknoise.report import style
from tracknoise.report.filmed_scene import filmed_scene
from tracknoise.report.report_data import ReportData
from tracknoise.text import printable

MOST_TRACKERS = 3
"""Panels side by side."""
FRAME_MS = 150
"""How long a picture is shown, milliseconds, as on the page."""
_PANEL_PX = {1: 640, 2: 560, 3: 480}
"""Width of a panel, by the number of panels."""
_FINER = 2
"""Marks are drawn in this many times more pixels, so that their edges are smooth."""
_TRAIL = 8
_GAP, _HEAD, _FOOT, _TEXT_PX = 8, 30, 28, 15
_CROSS_PX, _CIRCLE_PX, _TRAIL_PX, _LINE_PX, _EDGE_PX = 4.0, 3.5, 1.0, 2.0, 3.5
_MOST_PICTURES = 40
"""Six seconds; a GIF of them has about 10 MB."""

_Numbers = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Tracks:
    """Tracks of a tracker; (n_tracks, n_frames), px, NaN where there is no observation, or no true position."""

    u: _Numbers
    v: _Numbers
    du: _Numbers
    dv: _Numbers


@dataclass(frozen=True)
class Animation:
    """Pictures of the first frames of a scene.

    Attributes
    ----------
    scene
        Its name.
    trackers
        Those that have a panel, at most `MOST_TRACKERS`.
    n_trackers
        How many the run has.
    first_frame, times
        The first frame that is shown, and how many times errors are drawn longer.
    """

    scene: str
    trackers: tuple[str, ...]
    n_trackers: int
    first_frame: int
    times: int
    _colours: Mapping[str, str]
    _images: Sequence[bytes]
    _size: tuple[int, int]  # of the images of the recording, px
    _tracks: Mapping[str, _Tracks]

    def pictures(self) -> Iterator[Image.Image]:
        """Pictures in RGB, all of one size with even sides, from the first frame on in which errors are visible.

        Raises
        ------
        StoreError
            If an image is damaged.
        """
        for frame in range(self.first_frame, self._end):
            yield self._drawn(frame)

    @property
    def _end(self) -> int:
        return min(self.first_frame + _MOST_PICTURES, len(self._images))

    @cached_property
    def _panel(self) -> tuple[int, int]:
        """Size of the image in a panel, px."""
        width = _PANEL_PX[len(self.trackers)]
        return width, 2 * round(width * self._size[1] / self._size[0] / 2)

    def _drawn(self, frame: int) -> Image.Image:
        width, height = self._panel
        n = len(self.trackers)
        picture = Image.new("RGB", (n * width + (n - 1) * _GAP, _HEAD + height + _FOOT), style.PAPER)
        pen = ImageDraw.Draw(picture)
        ground = self._image(frame).resize((_FINER * width, _FINER * height), Image.Resampling.BICUBIC)
        for place, tracker in enumerate(self.trackers):
            left = place * (width + _GAP)
            pen.rectangle((left, 8, left + 13, 21), fill=self._colours[tracker])
            pen.text((left + 20, _HEAD / 2), _fitting(printable(tracker), width - 24), style.INK, _font(), anchor="lm")
            panel = ground.copy()
            self._draw_tracks(ImageDraw.Draw(panel), self._tracks[tracker], frame, self._colours[tracker])
            picture.paste(panel.reduce(_FINER), (left, _HEAD))
        below = (0, _HEAD + height + _FOOT / 2)
        pen.text(below, _fitting(self._caption(frame), picture.width), style.QUIET, _font(), anchor="lm")
        return picture

    def _image(self, frame: int) -> Image.Image:
        try:
            with Image.open(io.BytesIO(self._images[frame])) as image:
                return image.convert("RGB")
        except (OSError, Image.DecompressionBombError) as error:
            raise StoreError(f"scene {self.scene}, frame {frame}: its image is damaged, expected a new run") from error

    def _caption(self, frame: int) -> str:
        times = "as they are" if self.times == 1 else f"{self.times} times as long"
        return f"Frame {frame}. Cross: observed. Circle: true. Errors {times}. Scene {printable(self.scene)}."

    def _draw_tracks(self, pen: ImageDraw.ImageDraw, tracks: _Tracks, frame: int, colour: str) -> None:
        """Tracks up to a frame. Pixel centres are whole numbers."""
        scale = _FINER * self._panel[0] / self._size[0]
        u, v = ((values + 0.5) * scale for values in (tracks.u, tracks.v))
        longer = self.times * scale
        true_u, true_v = u[:, frame] - longer * tracks.du[:, frame], v[:, frame] - longer * tracks.dv[:, frame]
        for track in np.flatnonzero(np.isfinite(u[:, frame])):
            since = slice(max(0, frame - _TRAIL), frame + 1)
            path = [(x, y) for x, y in zip(u[track, since], v[track, since], strict=True) if np.isfinite(x)]
            _line(pen, path, style.PAPER, _TRAIL_PX)
            x, y = u[track, frame], v[track, frame]
            tip = float(true_u[track]), float(true_v[track])
            for ink, wide in ((style.BLACK, _EDGE_PX), (colour, _LINE_PX)):
                if np.isfinite(tip[0]):
                    _line(pen, [(x, y), tip], ink, wide)
                    pen.circle(tip, _FINER * (_CIRCLE_PX + wide / 2), outline=ink, width=round(_FINER * wide))
            cross = _FINER * _CROSS_PX
            for ink, wide in ((style.BLACK, _EDGE_PX), (style.PAPER, _LINE_PX)):
                _line(pen, [(x - cross, y), (x + cross, y)], ink, wide)
                _line(pen, [(x, y - cross), (x, y + cross)], ink, wide)


def animation(data: ReportData) -> Animation:
    """The pictures of a run, with the tracks that its page shows.

    Raises
    ------
    StoreError
        If it keeps no frames, with what to set.
    """
    film = filmed_scene(data)
    if film is None or not film["trackers"]:
        raise StoreError(f"{data.run.path}: no frames are kept, expected {_expected(data)}")
    chosen = tuple(film["trackers"])[:MOST_TRACKERS]
    images = [base64.b64decode(image) for image in film["frames"]]
    return Animation(
        film["scene"],
        chosen,
        len(data.trackers),
        film["start"],
        film["magnified"],
        data.colour,
        images,
        (film["width"], film["height"]),
        {name: _tracks(film["trackers"][name], len(images)) for name in chosen},
    )


def _expected(data: ReportData) -> str:
    """What a run with frames has that this one does not have."""
    if not data.keeps_observations:
        return 'keep = "observations" in the experiment file'
    return "a new run with one lighting and one rotation of each scene"


def _tracks(tracks: Sequence[Mapping[str, Any]], n_frames: int) -> _Tracks:
    values = {name: np.full((len(tracks), n_frames), np.nan) for name in ("u", "v", "du", "dv")}
    for row, track in enumerate(tracks):
        for name, table in values.items():
            path = np.array(track[name], dtype=np.float64)
            table[row, track["frame"] : track["frame"] + len(path)] = path
    return _Tracks(**values)


def _line(pen: ImageDraw.ImageDraw, points: list[tuple[float, float]], colour: str, wide: float) -> None:
    if len(points) > 1:
        pen.line(points, colour, round(_FINER * wide), joint="curve")


def _font() -> Any:
    return ImageFont.load_default(_TEXT_PX)


def _fitting(text: str, most_px: float) -> str:
    """A text that is cut where it is too long."""
    font = _font()
    if font.getlength(text) <= most_px:
        return text
    while text and font.getlength(f"{text}...") > most_px:
        text = text[:-1]
    return f"{text}..."
