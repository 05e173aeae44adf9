"""Pictures as an animation: a GIF file by Pillow, or an MP4 file by OpenCV."""

import io
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from tracknoise.exceptions import SettingsError
from tracknoise.sequences.video import silent_opencv
from tracknoise.tables.files import write_atomically

_COLOURS = 256
_CODEC = "mp4v"
"""MPEG-4, which every FFmpeg can write and players know."""


def require_ending(option: str, path: Path) -> None:
    """Refuse a file whose name does not say which kind of animation it is.

    Raises
    ------
    SettingsError
        If it ends in none of `ENDINGS`.
    """
    if path.suffix.lower() not in ENDINGS:
        expected = " or ".join(ENDINGS)
        raise SettingsError(f"{option} {path}: found a name that ends in {path.suffix!r}, expected {expected}")


def write_animation(path: Path, pictures: Iterable[Image.Image], *, frame_ms: int) -> None:
    """Write an animation, by the ending of its name.

    Parameters
    ----------
    path
        Of the file; its name has one of `ENDINGS`.
    pictures
        At least one, in RGB, all of one size with even sides.
    frame_ms
        How long each is shown, milliseconds.

    Raises
    ------
    SettingsError
        If this OpenCV cannot write such a file.
    StoreError
        If it cannot be written.
    """
    write_atomically(path, _MAKERS[path.suffix.lower()](path, pictures, frame_ms))


def _gif(path: Path, pictures: Iterable[Image.Image], frame_ms: int) -> bytes:
    """All pictures have the same colours, those of the first, middle and last one, so that nothing flickers."""
    shown = list(pictures)
    seen = np.concatenate([np.asarray(shown[place]) for place in (0, len(shown) // 2, -1)])
    palette = Image.fromarray(seen).quantize(_COLOURS)
    indexed = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in shown]
    buffer = io.BytesIO()
    indexed[0].save(buffer, "gif", save_all=True, append_images=indexed[1:], duration=frame_ms, loop=0)
    return buffer.getvalue()


def _mp4(path: Path, pictures: Iterable[Image.Image], frame_ms: int) -> bytes:
    first, *others = pictures
    with tempfile.TemporaryDirectory(prefix="tracknoise-video-") as name, silent_opencv():
        file = Path(name) / "video.mp4"
        writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*_CODEC), 1e3 / frame_ms, first.size)
        try:
            if not writer.isOpened():
                raise SettingsError(f"{path}: this OpenCV has no encoder for MP4, expected a name that ends in .gif")
            for picture in (first, *others):
                writer.write(np.asarray(picture)[:, :, ::-1].copy())
        finally:
            writer.release()
        return file.read_bytes()


_MAKERS: Mapping[str, Callable[[Path, Iterable[Image.Image], int], bytes]] = {".gif": _gif, ".mp4": _mp4}
ENDINGS = tuple(_MAKERS)
"""Endings of the names of animations."""
