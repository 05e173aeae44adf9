"""The surface around image points: the nearest depth edge, and the angle under which the surface is seen.

Depth is read on eight straight lines from the point, along rows, columns and diagonals, once per pixel, up to
`REACH_PX`. Let w be the inverse depth, which is linear in the image of a plane, and w_a and w_b two successive known
values on a line, of which the smaller is w_f. There is an edge between them if each of these is larger than t w_f:

- the step |w_b - w_a|
- the distance of w_b from the straight line through w_a and the value before it
- the distance of w_a from the straight line through w_b and the value after it                          (edge)

and the two straight lines do not cross between a and b, with

    t = EDGE_RELATIVE_SPREAD + HOLE_RELATIVE_SLOPE (pixels without depth between them)

plus `EDGE_SIGMAS` standard deviations of the nearer depth, relative to it. A slanted plane, however steep, and a crease
between two planes are no edges. An edge belongs to the nearer surface, so that its position is the end of that surface.
The distance of a straight edge is exact to a pixel and 8 %.

The angle of incidence is that of a plane, fitted to the inverse depths that lie within `SLOPE_REACH_PX` and before the
first edge of their line.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.accuracy import DepthAccuracy
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.depth import EDGE_RELATIVE_SPREAD

REACH_PX = 15
"""Edges farther away than this are not looked for: the window of a Lucas-Kanade tracker is 15 px wide."""
SLOPE_REACH_PX = 7
"""Depths up to this distance determine the local plane: half a window."""
HOLE_RELATIVE_SLOPE = 0.005
"""How much more depth may change for each pixel of a hole without an edge, relative to the nearer side, no unit."""
EDGE_SIGMAS = 4.0
"""Depths that differ by less than this many standard deviations may be of one surface."""

_FARTHEST_M = 1e9
"""Stands for an infinite depth."""

_DIRECTIONS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)])
_OFFSETS: NDArray[np.float64] = _DIRECTIONS[:, None].astype(np.float64) * np.arange(REACH_PX + 2)[:, None]
"""Positions on the lines relative to the point, (lines, 1 + reach + 1, 2), px: from the point, one beyond the reach."""
_RADII: NDArray[np.float64] = np.hypot(_OFFSETS[..., 0], _OFFSETS[..., 1])
_ONCE = (_RADII > 0) | (np.arange(len(_OFFSETS)) == 0)[:, None]
"""The positions, (lines, 1 + reach + 1), with the point itself on the first line alone."""
_IN_PLANE = (_RADII <= SLOPE_REACH_PX) & _ONCE
"""Which positions determine the local plane, (lines, 1 + reach + 1)."""
_READ = (_RADII - _RADII[:, 1:2] <= REACH_PX) & _ONCE
"""Where depth is read, (lines, 1 + reach + 1): up to one position beyond the reach, which diagonals have earlier."""
_PLACE = np.where(_READ, np.cumsum(_READ).reshape(_READ.shape) - 1, 0)
"""Which depth that was read stands at a position, (lines, 1 + reach + 1): that of the point where none was."""


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What lies around image points."""

    # (n,): Distance to the nearest depth edge, px: positive on its near side, negative on its far side, infinite where
    # there is none within `REACH_PX`. NaN where depth is unknown.
    edge_px: NDArray[np.float64]
    # (n,): angle between the ray and the normal of the surface, from 0 to 90 degrees; NaN where it is unknown
    incidence_deg: NDArray[np.float64]


def unknown_surroundings(count: int) -> Surroundings:
    """Surroundings of points about which nothing is known."""
    return Surroundings(np.full(count, np.nan), np.full(count, np.nan))


def joined_surroundings(parts: Sequence[Surroundings]) -> Surroundings:
    """The points of all parts, in order."""
    edges, angles = ([getattr(part, name) for part in parts] for name in ("edge_px", "incidence_deg"))
    return Surroundings(np.concatenate([np.empty(0), *edges]), np.concatenate([np.empty(0), *angles]))


def around(uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, 2) px: where `find_surroundings` needs the depth for image points (n, 2), px."""
    return np.asarray((uv[:, None] + _OFFSETS[_READ]).reshape(-1, 2))


def find_surroundings(
    camera: CameraModel,
    uv: NDArray[np.float64],
    depth_m: NDArray[np.float64],
    read: NDArray[np.bool_],
    accuracy: DepthAccuracy,
) -> Surroundings:
    """Nearest depth edge and angle of incidence of image points.

    Parameters
    ----------
    camera
        Of the image.
    uv
        (n, 2) float64, px.
    depth_m
        (m,) float64, metres: depth at the pixels of `around`, infinite where a ray hits nothing.
    read
        (m,) bool: whether it is known.
    accuracy
        Uncertainty of these depths.
    """
    inverse = 1.0 / np.minimum(np.where(read, depth_m, 1.0), _FARTHEST_M)
    place = np.arange(len(uv))[:, None, None] * np.count_nonzero(_READ) + _PLACE
    valid, hit, inverse = read[place], (read & np.isfinite(depth_m))[place], inverse[place]
    edges = _first_edges(inverse, valid, accuracy)
    nearest = np.take_along_axis(edges, np.abs(edges).argmin(axis=1)[:, None], axis=1)[:, 0]
    inside = (np.abs(edges)[..., None] > _RADII) & _IN_PLANE
    incidence_deg = _incidence_deg(camera, uv, inverse, hit & inside)
    return Surroundings(*(np.where(hit[:, 0, 0], values, np.nan) for values in (nearest, incidence_deg)))


def _first_edges(
    inverse: NDArray[np.float64], valid: NDArray[np.bool_], accuracy: DepthAccuracy
) -> NDArray[np.float64]:
    """Signed distance of the first edge of each line, (n, lines), by (edge); infinite where there is none.

    `inverse` and `valid` are (n, lines, 1 + reach).
    """
    edge_px = np.full(inverse.shape[:2], np.inf)
    before, place = inverse[..., 0], np.zeros(edge_px.shape)
    slope = _opposite_slope(inverse, valid)
    for step in range(1, inverse.shape[2] - 1):
        here, there, gap = inverse[..., step], valid[..., step] & (_RADII[:, step] <= REACH_PX), step - place
        change, farther = here - before, np.minimum(here, before)
        after = np.where(valid[..., step + 1], inverse[..., step + 1] - here, 0.0)
        least = np.minimum(np.abs(change), _apart(change - slope * gap, change - after * gap))
        is_edge = there & np.isinf(edge_px) & (least > _allowed(np.maximum(here, before), gap, accuracy) * farther)
        end_px = np.where(change < 0, place + 0.5, 0.5 - step) * _RADII[:, 1]
        edge_px = np.where(is_edge, end_px, edge_px)
        before, place = np.where(there, here, before), np.where(there, float(step), place)
        slope = np.where(there, change / gap, slope)
    return edge_px


def _apart(start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least distance between two straight lines from their distances at both ends; 0 where they cross."""
    return np.where(start * end > 0, np.minimum(np.abs(start), np.abs(end)), 0.0)


def _opposite_slope(inverse: NDArray[np.float64], valid: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Change of the inverse depth towards the point, on the line that leads away from each line, (n, lines).

    It is 0 where that is unknown.
    """
    opposite = np.roll(np.arange(len(_OFFSETS)), len(_OFFSETS) // 2)
    change = inverse[..., 0] - inverse[:, opposite, 1]
    return np.where(valid[:, opposite, 1], change, 0.0)


def _allowed(nearer: NDArray[np.float64], gap: NDArray[np.float64], accuracy: DepthAccuracy) -> NDArray[np.float64]:
    """Largest step that is no edge, relative to the farther inverse depth."""
    spread = EDGE_RELATIVE_SPREAD + HOLE_RELATIVE_SLOPE * (gap - 1.0)
    return np.asarray(spread + EDGE_SIGMAS * accuracy.sigma_m(1.0 / nearer) * nearer)


def _incidence_deg(
    camera: CameraModel,
    uv: NDArray[np.float64],
    inverse: NDArray[np.float64],
    usable: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Angle between ray and normal, (n,) degrees; NaN where the fitted plane is not determined."""
    at_point, du, dv = _fitted_plane(inverse[:, _IN_PLANE], usable[:, _IN_PLANE], _OFFSETS[_IN_PLANE])
    ray, by_u, by_v = (camera.bearings(uv + np.array(step)) for step in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
    (a, c), (b, d) = (by_u - ray)[:, :2].T, (by_v - ray)[:, :2].T  # what the ray changes by per px
    determinant = a * d - b * c
    x, y = (d * du - c * dv) / determinant, (a * dv - b * du) / determinant
    normal = np.stack([x, y, at_point - x * ray[:, 0] - y * ray[:, 1]], axis=-1)
    cosine = at_point / (np.linalg.norm(normal, axis=-1) * np.linalg.norm(ray, axis=-1))
    return np.asarray(np.rad2deg(np.arccos(np.clip(cosine, 0.0, 1.0))))


def _fitted_plane(
    inverse: NDArray[np.float64], usable: NDArray[np.bool_], offsets: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Inverse depth at the point, and its slope per px in u and in v, (3, n); NaN where they are not determined."""
    design = np.concatenate([np.ones((len(offsets), 1)), offsets], axis=1)
    weight = usable.astype(np.float64)
    normal = (weight @ (design[:, :, None] * design[:, None, :]).reshape(len(design), 9)).reshape(-1, 3, 3)
    spread = np.linalg.det(normal) / np.maximum(normal[:, 0, 0], 1.0)  # of the positions, px^4
    determined = spread > normal[:, 0, 0] ** 2  # not of positions on one line
    safe = np.where(determined[:, None, None], normal, np.eye(3))
    solved = np.linalg.solve(safe, ((weight * inverse) @ design)[..., None])
    return np.asarray(np.where(determined, solved[..., 0].T, np.nan))
