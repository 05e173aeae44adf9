"""The first frames of a sequence as small images, which the page shows with the tracks in them."""

from typing import TYPE_CHECKING

import polars as pl

from tracknoise.sequences.images import encode_webp, reduced
from tracknoise.tables.schema import FILM

if TYPE_CHECKING:
    from tracknoise.experiments.measure import Measurement

MOST_FRAMES, MOST_BYTES = 120, 2_000_000
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
        whole = measurement.sequence.image(frame) if kept is None else kept
        image = encode_webp(reduced(whole, WIDEST_PX), quality=_QUALITY)
        size += len(image)
        if size > MOST_BYTES:
            break
        rows.append((frame, image))
    return pl.DataFrame(rows, schema=dict(FILM), orient="row")
