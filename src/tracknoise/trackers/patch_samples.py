"""Gray values of patches at positions between pixels, and how well two patches agree."""

from enum import StrEnum
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

_MOST_ROWS = 30_000
"""OpenCV looks up no more rows at once than 2^15."""

Floats = NDArray[np.float32]


class Shape(StrEnum):
    """Which pixels of the square around a feature belong to its patch.

    square: all. disc: those with their centre in its inscribed circle; 52 of 64.
    """

    square = "square"
    disc = "disc"


def offsets(side_px: int, shape: Shape = Shape.square) -> Floats:
    """Positions of the samples of a patch, relative to its feature, 1 px apart: (p, 2) float32, px."""
    along = np.arange(side_px, dtype=np.float32) - (side_px - 1) / 2
    grid = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    if shape is Shape.disc:
        grid = grid[np.hypot(*grid.T) <= side_px / 2]
    return np.asarray(grid, dtype=np.float32)


def sampled(image: Floats, uv: Floats) -> Floats:
    """Values of an image at positions, bilinear.

    `image`: (height, width) float32; `uv`: (n, p, 2) float32, px. Returns (n, p) float32: NaN where a pixel around the
    position is not in the image.
    """
    values = np.empty(uv.shape[:2], dtype=np.float32)
    nothing: Any = None  # the second map, where the first has both coordinates
    for start in range(0, len(uv), _MOST_ROWS):
        part = slice(start, start + _MOST_ROWS)
        values[part] = cv2.remap(
            image, uv[part], nothing, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=float("nan")
        )
    return values


def correlation(first: Floats, second: Floats) -> Floats:
    """Normalised cross-correlation of patches: of their gray values less the mean, from -1 to 1.

    It does not depend on brightness and contrast. Shapes: first, second (n, p); returns (n,) float32. Only samples that
    both patches have count. NaN where one of them has no texture.
    """
    in_both = np.isfinite(first) & np.isfinite(second)
    count = np.maximum(np.count_nonzero(in_both, axis=1), 1)[:, None]
    a, b = (np.where(in_both, values, 0).astype(np.float64) for values in (first, second))
    a, b = (np.where(in_both, values - values.sum(axis=1, keepdims=True) / count, 0) for values in (a, b))
    size = np.sqrt((a * a).sum(axis=1) * (b * b).sum(axis=1))
    coefficient = np.full(len(a), np.nan)
    np.divide((a * b).sum(axis=1), size, out=coefficient, where=size > 0)
    return coefficient.astype(np.float32)
