"""Points that were found in two images, with their depths."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SHORT_PX, LONG_PX = 3.0, 15.0
"""Median image motion of the two baselines at which images, poses and depths are compared, px."""
FEWEST_POINTS = 12
"""A pair of images with fewer points is not used."""


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Points of one image that were found again in another.

    Attributes
    ----------
    first, second
        The two frames.
    uv_first, uv_second
        (n, 2) float64, px.
    depth_first_m, depth_second_m
        (n,) float64, metres: depth at the point in each frame; NaN where unknown.
    """

    first: int
    second: int
    uv_first: NDArray[np.float64]
    uv_second: NDArray[np.float64]
    depth_first_m: NDArray[np.float64]
    depth_second_m: NDArray[np.float64]

    @property
    def motion_px(self) -> float:
        """Median length of the image motion, px."""
        return float(np.median(np.linalg.norm(self.uv_second - self.uv_first, axis=1)))

    @property
    def has_depth(self) -> bool:
        """Whether enough points have a depth in the first frame."""
        return int(np.isfinite(self.depth_first_m).sum()) >= FEWEST_POINTS


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """Image motion of a recording.

    Attributes
    ----------
    steps
        Pairs of consecutive frames.
    wide
        Pairs whose image motion has just reached `SHORT_PX` or `LONG_PX`, or as far as points could be followed.
    """

    steps: tuple[Pair, ...]
    wide: tuple[Pair, ...]
