"""Two cameras beside each other as rectified images, in which a point has the same row in both."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import require
from tracknoise.exceptions import DataError, first_line
from tracknoise.geometry.projection import Rectification, rectify, rectifying_maps
from tracknoise.geometry.stereo_pair import StereoPair

Array = NDArray[np.float64]
Images = tuple[NDArray[np.uint8], NDArray[np.uint8]]


class DepthRange(Protocol):
    """Settings of a search that finds points at some depths only."""

    @property
    def nearest_m(self) -> float:
        """Smallest depth, metres."""
        ...

    @property
    def farthest_m(self) -> float:
        """Largest depth, metres."""
        ...


def require_depths(field: str, depths: DepthRange) -> None:
    """Raise InvalidValueError, naming the field, unless the largest depth is above the smallest."""
    expected = f"a number above nearest_m, {depths.nearest_m:g}"
    require(depths.farthest_m > depths.nearest_m, f"{field}.farthest_m", depths.farthest_m, expected)


@dataclass(frozen=True, eq=False)
class RectifiedRows:
    """Positions and images of two cameras, rectified. Positions are (n, 2) float64, px; NaN stays NaN."""

    pair: StereoPair
    rectified: Rectification

    @classmethod
    def of(cls, pair: StereoPair) -> "RectifiedRows":
        """Rectify two cameras.

        Raises
        ------
        DataError
            If the second camera is not beside the first.
        """
        try:
            return cls(pair, rectify(pair.first, pair.first_from_second))
        except ValueError as error:
            raise DataError("second camera", first_line(error), "two cameras side by side") from error

    @property
    def disparity_scale(self) -> float:
        """Disparity of a point times its depth, px m."""
        return self.rectified.camera.fx * self.rectified.baseline_m

    def in_range(self, disparity: Array | float, depths: DepthRange) -> NDArray[np.bool_]:
        """Which disparities (of any shape), px, have a depth within the range."""
        least, most = (self.disparity_scale / depth_m for depth_m in (depths.farthest_m, depths.nearest_m))
        return np.asarray((disparity >= least) & (disparity <= most), np.bool_)

    def from_first(self, uv: Array) -> Array:
        """(n, 2): rectified positions of positions in the first camera."""
        return self.rectified.camera.project(self.pair.first.bearings(uv) @ self.rectified.first_from_rectified)

    def from_second(self, uv: Array) -> Array:
        """(n, 2): rectified positions of positions in the second camera."""
        return self.rectified.camera.project(self.pair.second.bearings(uv) @ self.rectified.second_from_rectified)

    def to_second(self, uv: Array) -> Array:
        """(n, 2): positions in the second camera of rectified positions."""
        return self.pair.second.project(self.rectified.camera.bearings(uv) @ self.rectified.second_from_rectified.T)

    def images(self, images: Images) -> Images:
        """Both images, rectified."""
        first, second = (
            np.asarray(cv2.remap(image, *maps, cv2.INTER_LINEAR), np.uint8)
            for image, maps in zip(images, self._maps, strict=True)
        )
        return first, second

    @cached_property
    def _maps(self) -> tuple[tuple[NDArray[np.float32], NDArray[np.float32]], ...]:
        return rectifying_maps(self.rectified, self.pair.first, self.pair.second)


def vertex(values: NDArray[np.floating], place: int) -> float:
    """Where the parabola through a value and its neighbours is smallest, from the place of the value, px.

    `values`: (n,) of successive pixels; `place`: the smallest. 0 at an end, and where the three are on a line.
    """
    if not 0 < place < len(values) - 1:
        return 0.0
    before, here, after = (float(value) for value in values[place - 1 : place + 2])
    bend = before - 2.0 * here + after
    return 0.5 * (before - after) / bend if bend > 0.0 else 0.0
