"""Dense depth maps and how they are read between pixels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

EDGE_RELATIVE_SPREAD = 0.02


@dataclass(frozen=True, slots=True)
class DepthMap:
    """Depth of every pixel of an image.

    Parameters
    ----------
    depth_m
        (height, width) float32 or float64, depth along z, metres; meaningless where not valid.
    valid
        (height, width) bool.

    Raises
    ------
    ValueError
        If the two arrays have different shapes.
    """

    depth_m: NDArray[np.floating]
    valid: NDArray[np.bool_]

    def __post_init__(self) -> None:
        if self.depth_m.shape != self.valid.shape or self.depth_m.ndim != 2:
            raise ValueError(f"depth {self.depth_m.shape} and valid {self.valid.shape} must be the same 2-D shape")


@dataclass(frozen=True, slots=True)
class DepthSample:
    """Depth read at sub-pixel positions.

    Attributes
    ----------
    depth_m
        (n,) float64, metres; 1 where not valid.
    valid
        (n,) bool: all four neighbours are valid and agree.
    edge
        (n,) bool: all four neighbours are valid, but they span a depth discontinuity.
    """

    depth_m: NDArray[np.float64]
    valid: NDArray[np.bool_]
    edge: NDArray[np.bool_]


def interpolate(depth: DepthMap, uv: NDArray[np.float64], *, spread: float = EDGE_RELATIVE_SPREAD) -> DepthSample:
    """Read dense depth at sub-pixel positions from the four neighbouring pixels.

    Inverse depth is interpolated bilinearly: on a plane inverse depth is linear in the image, so that the result
    is exact there. Where the farthest of the four neighbours exceeds the nearest by more than `spread`, relative
    to the nearest, the position lies on an edge and has no depth. All four have a say, even those of weight 0 at a
    pixel's centre, where they are the pixels to the right and below: corners like to lie on outlines, and a feature on
    an outline may belong to either side of it.

    Parameters
    ----------
    depth
        The map.
    uv
        (n, 2) float64, px.
    spread
        Largest relative difference between the four neighbours, no unit.
    """
    corners, inside = _neighbours(depth, uv)
    known = inside & corners.valid.all(axis=0)
    z = np.where(corners.valid, corners.depth_m, 1.0)
    nearest, farthest = z.min(axis=0), z.max(axis=0)
    agree = farthest - nearest <= spread * nearest
    inverse = (corners.weight / z).sum(axis=0)
    usable = known & agree
    return DepthSample(np.where(usable, 1.0 / inverse, 1.0), usable, known & ~agree)


def farthest_neighbour(depth: DepthMap, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Largest valid depth among the four pixels around sub-pixel positions.

    Parameters
    ----------
    depth
        The map.
    uv
        (n, 2) float64, px.

    Returns
    -------
    depth_m : (n,) float64
        Metres; 0 where there is none.
    valid : (n,) bool
        Whether any of the four is valid.
    """
    corners, inside = _neighbours(depth, uv)
    valid = corners.valid & inside
    farthest: NDArray[np.float64] = np.where(valid, corners.depth_m, 0.0).max(axis=0)
    return farthest, np.any(valid, axis=0)


@dataclass(frozen=True, slots=True)
class _Corners:
    depth_m: NDArray[np.float64]  # (4, n)
    valid: NDArray[np.bool_]  # (4, n)
    weight: NDArray[np.float64]  # (4, n)


def _neighbours(depth: DepthMap, uv: NDArray[np.float64]) -> tuple[_Corners, NDArray[np.bool_]]:
    """The 2x2 pixels around each position, and whether the position lies between pixel centres of the map."""
    height, width = depth.depth_m.shape
    u, v = uv[:, 0], uv[:, 1]
    inside = (u >= 0) & (u <= width - 1) & (v >= 0) & (v <= height - 1)
    u, v = np.where(inside, u, 0.0), np.where(inside, v, 0.0)
    left = np.clip(np.floor(u).astype(np.intp), 0, max(width - 2, 0))
    top = np.clip(np.floor(v).astype(np.intp), 0, max(height - 2, 0))
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    fu, fv = u - left, v - top
    rows, columns = np.stack([top, top, bottom, bottom]), np.stack([left, right, left, right])
    weight = np.stack([(1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv])
    return _Corners(depth.depth_m[rows, columns].astype(np.float64), depth.valid[rows, columns], weight), inside
