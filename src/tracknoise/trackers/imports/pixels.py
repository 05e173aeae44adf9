"""Positions of imported tracks as pixels of the images, and mistakes that positions show."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.printable import significant
from tracknoise.trackers.imports.rows import Rows
from tracknoise.trackers.quality import covariances
from tracknoise.trackers.tracker import SequenceContext

_LARGEST_NORMALISED = 2.0
_LEAST_ROWS = 10
"""With fewer rows, small positions do not prove normalised coordinates."""
_INSIDE_IF_SWAPPED, _INSIDE_AS_STATED = 0.99, 0.9
NOTED_OUTSIDE = 0.01
"""Share of positions outside the image from which on it is noted."""


class Units(StrEnum):
    """What positions of a file are: ``pixels``, or ``normalised``, x/z and y/z of their rays without distortion."""

    pixels = "pixels"
    normalised = "normalised"


class PixelOrigin(StrEnum):
    """What the position (0, 0) of a file is: the centre of the first pixel, or its corner, the corner of the image."""

    centre = "centre"
    corner = "corner"


@dataclass(frozen=True, slots=True)
class Raster:
    """Coordinates of a file.

    Parameters
    ----------
    origin
        What (0, 0) is.
    size
        (width, height) of the images in the units of the file; None if that is their size in px.
    """

    origin: PixelOrigin
    size: tuple[float, float] | None = None

    def check(self, rows: Rows, context: SequenceContext) -> None:
        """See `check_coordinates`."""
        check_coordinates(rows, self, context.size)

    def to_pixels(
        self, uv: NDArray[np.float64], frame: NDArray[np.int64], context: SequenceContext
    ) -> NDArray[np.float64]:
        """Positions (n, 2), px; an integer is the centre of a pixel."""
        return self.in_image(uv, context.size)

    def in_image(self, uv: NDArray[np.float64], image: tuple[int, int]) -> NDArray[np.float64]:
        """Positions (n, 2) in an image of (width, height) px; an integer is the centre of a pixel."""
        if self.size is None:
            return uv if self.origin is PixelOrigin.centre else uv - 0.5
        from_corner = uv + 0.5 if self.origin is PixelOrigin.centre else uv
        pixels: NDArray[np.float64] = from_corner * (np.array(image) / self.size) - 0.5
        return pixels

    def covariances_to_pixels(
        self,
        quality: Mapping[str, NDArray[np.float32]],
        uv: NDArray[np.float64],
        frame: NDArray[np.int64],
        context: SequenceContext,
    ) -> dict[str, NDArray[np.float32]]:
        """Quality with the covariances among it in px^2. All other quality stays as it is."""
        found = dict(quality)
        if self.size is None:
            return found
        u, v = np.array(context.size) / self.size
        factors = (np.float32(u * u), np.float32(u * v), np.float32(v * v))
        for names in covariances(quality):
            found |= {name: quality[name] * factor for name, factor in zip(names, factors, strict=True)}
        return found


def check_coordinates(rows: Rows, raster: Raster, image: tuple[int, int]) -> None:
    """Refuse positions that are normalised, whose columns are swapped, or of which none is in the image.

    Parameters
    ----------
    rows
        Positions as the file states them.
    raster
        Their coordinates.
    image
        (width, height), px.

    Raises
    ------
    DataError
        Naming the mistake and what to do.
    """
    if raster.size is None and _are_normalised(rows.uv, image):
        low, high = rows.uv.min(), rows.uv.max()
        extent = f"{significant(low, 3)} to {significant(high, 3)}"
        found = f"positions from {extent} in images of {image[0]} x {image[1]} px"
        expected = "pixels, and these look like normalised coordinates: if they run from 0 to 1 across the image, set"
        rest = 'raster = [1, 1] and origin = "corner"; if they are x/z and y/z, set units = "normalised"'
        raise DataError(rows.path, found, f"{expected} {rest}")
    uv = raster.in_image(rows.uv, image)
    stated, swapped = inside(uv, image).mean(), inside(uv[:, ::-1], image).mean()
    if stated < _INSIDE_AS_STATED and swapped > _INSIDE_IF_SWAPPED:
        found = (
            f"{stated:.0%} of positions inside images of {image[0]} x {image[1]} px, {swapped:.0%} with u and v swapped"
        )
        raise DataError(rows.path, found, "u to the right and v down: the columns are swapped")
    if stated == 0:
        found = f"no position inside images of {image[0]} x {image[1]} px"
        raise DataError(
            rows.path, found, "pixels of these images; for tracks of resized images set raster = [width, height]"
        )


def share_outside(uv: NDArray[np.float64], image: tuple[int, int]) -> float:
    """Share of positions (n, 2) outside an image of (width, height) px."""
    return float(1 - inside(uv, image).mean())


def _are_normalised(uv: NDArray[np.float64], image: tuple[int, int]) -> bool:
    if len(uv) < _LEAST_ROWS or min(image) < 10 * _LARGEST_NORMALISED:
        return False
    return bool(np.abs(uv).max() <= _LARGEST_NORMALISED and (uv != np.rint(uv)).any())


def inside(uv: NDArray[np.float64], image: tuple[int, int]) -> NDArray[np.bool_]:
    """Whether positions (n, 2) lie in an image of (width, height) px; NaN does not."""
    return np.asarray(((uv >= -0.5) & (uv <= np.array(image) - 0.5)).all(axis=1))
