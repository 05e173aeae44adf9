"""Features of one camera, searched along their epipolar lines in the image of a second one beside it.

Both images are rectified, so that epipolar lines are rows. The template around a feature, at the nearest pixel, is laid
on each pixel of its row, and the smallest normalised sum of squared differences decides.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from tracknoise.checks import NotNegative, Positive, require, require_bounds, settle_members
from tracknoise.geometry.stereo_pair import StereoPair
from tracknoise.trackers.rectified_rows import Array, Images, RectifiedRows, require_depths, vertex

_LEAST_PLACES = 3


class Precision(StrEnum):
    """Whole pixels; or the vertex of a parabola, where the feature lies in its own pixel."""

    pixel = "pixel"
    subpixel = "subpixel"


@dataclass(frozen=True, slots=True)
class LineSearch:
    """Settings of the search.

    Parameters
    ----------
    width_px, height_px
        Of the template.
    most_difference
        Largest sum of squared differences over the product of the sizes of both patches: less is found.
    nearest_m, farthest_m
        Depths of points, metres; with others they are not found.
    precision
        Of positions: see `Precision`.
    """

    width_px: Annotated[int, Ge(3)] = 21
    height_px: Annotated[int, Ge(3)] = 11
    most_difference: NotNegative = 0.1
    nearest_m: Positive = 0.5
    farthest_m: Positive = 1000.0
    precision: Precision = Precision.subpixel

    def __post_init__(self) -> None:
        settle_members(self, precision=Precision)
        require_bounds(self)
        for name in ("width_px", "height_px"):
            require(getattr(self, name) % 2 == 1, f"line.{name}", getattr(self, name), "an odd number")
        require_depths("line", self)

    def of(self, pair: StereoPair) -> "RowSearch":
        """The search in the images of two cameras.

        Raises
        ------
        DataError
            If the second camera is not beside the first.
        """
        return RowSearch(self, RectifiedRows.of(pair))


@dataclass(frozen=True, slots=True, eq=False)
class RowSearch:
    """The search in the rectified images of two cameras."""

    settings: LineSearch
    rows: RectifiedRows

    def found(self, images: Images, first_uv: Array) -> Array:
        """(n, 2): positions in the second image of features (n, 2) of the first; NaN where they are not found."""
        first, second = self.rows.images(images)
        uv = self.rows.from_first(first_uv)
        found = np.full(first_uv.shape, np.nan)
        for place in np.flatnonzero(np.isfinite(uv).all(axis=1)).tolist():
            found[place] = self._on_row(first, second, uv[place])
        return self.rows.to_second(found)

    def _on_row(self, first: NDArray[np.uint8], second: NDArray[np.uint8], uv: Array) -> tuple[float, float]:
        settings, nothing = self.settings, (np.nan, np.nan)
        between = settings.precision is Precision.subpixel
        u, v = (int(number) for number in np.rint(uv))
        left, top = u - settings.width_px // 2, v - settings.height_px // 2
        right, bottom = left + settings.width_px, top + settings.height_px
        if left < 0 or top < 0 or right > first.shape[1] or bottom > first.shape[0]:
            return nothing
        start = max(0, left - int(np.ceil(self.rows.disparity_scale / settings.nearest_m)))
        if right - start < settings.width_px + _LEAST_PLACES - 1:
            return nothing
        template, row = first[top:bottom, left:right], second[top:bottom, start:right]
        differences = cv2.matchTemplate(row, template, cv2.TM_SQDIFF_NORMED)[0]
        best = int(np.argmin(differences))
        if not differences[best] <= settings.most_difference:
            return nothing
        disparity = left - (start + best) - (vertex(differences, best) if between else 0.0)
        if not self.rows.in_range(disparity, settings):
            return nothing
        return (uv[0] - disparity, uv[1]) if between else (u - disparity, float(v))
