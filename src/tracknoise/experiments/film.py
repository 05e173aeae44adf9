"""The first frames of a sequence as small images, which the page shows with the tracks in them."""

from typing import TYPE_CHECKING

import cv2
import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.sequences.images import encode_webp
from tracknoise.tables.schema import FILM

if TYPE_CHECKING:
    from tracknoise.experiments.measure import Measurement

MOST_FRAMES, MOST_BYTES = 120, 6_000_000
"""Frames of a film, and its size."""
WIDEST_PX = 480
_QUALITY = 60


def film(measurement: "Measurement") -> pl.DataFrame:
    """Images of the first frames, at most `WIDEST_PX` wide. Those that were not kept while tracking are read again.

    Returns schema `FILM`.
    """
    rows: list[tuple[int, bytes]] = []
    size = 0
    for frame in range(min(measurement.n_frames, MOST_FRAMES)):
        kept = measurement.images.get(frame)
        image = encode_webp(_small(measurement.sequence.image(frame) if kept is None else kept), quality=_QUALITY)
        size += len(image)
        if size > MOST_BYTES:
            break
        rows.append((frame, image))
    return pl.DataFrame(rows, schema=dict(FILM), orient="row")


def _small(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = image.shape
    if width <= WIDEST_PX:
        return image
    size = WIDEST_PX, max(1, round(height * WIDEST_PX / width))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
