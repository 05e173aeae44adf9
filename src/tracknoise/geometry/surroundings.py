"""The surface around image points: the nearest depth edge, and the angle under which the surface is seen.

Depth is read on a star of `DIRECTIONS` straight lines that start at the point, once per pixel, up to `REACH_PX`. On
each line, an edge lies between two successive known depths that differ by more than

    EDGE_RELATIVE_SPREAD + HOLE_RELATIVE_SLOPE (gap - 1)        relative to the nearer one   (edge)

plus `EDGE_SIGMAS` standard deviations of the depth there. The gap, px, is more than 1 where depth is missing between
the two. An edge belongs to the nearer surface, so that its position is the end of that surface. The distance of a
straight edge is exact to a half pixel and 4 %.

On a plane, inverse depth is linear in the image. A plane is fitted to the depths that lie within `SLOPE_REACH_PX` and
before the first edge of their line; its normal and the ray make the angle of incidence.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.accuracy import DepthAccuracy
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import EDGE_RELATIVE_SPREAD

DIRECTIONS = 12
REACH_PX = 15
"""Edges farther away than this are not looked for: the window of a Lucas-Kanade tracker is 15 px wide."""
SLOPE_REACH_PX = 7
"""Depths up to this distance determine the local plane: half a window."""
HOLE_RELATIVE_SLOPE = 0.005
"""How much depth may change per px across a hole without an edge, relative to the nearer side, no unit."""
EDGE_SIGMAS = 4.0
"""Depths that differ by less than this many standard deviations may be of one surface."""

_FARTHEST_M = 1e9
"""Stands for an infinite depth."""

T = TypeVar("T", bound=np.generic)
ReadDepth = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.bool_]]]
"""Takes pixels (n, 2); returns their depth (n,), metres, infinite where a ray hits nothing, and whether it is known."""


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What lies around image points.

    Attributes
    ----------
    edge_px : (n,) float64
        Distance to the nearest depth edge, px: positive on its near side, negative on its far side, infinite where
        there is none within `REACH_PX`. NaN where depth is unknown.
    incidence_deg : (n,) float64
        Angle between the ray and the normal of the surface, from 0 to 90 degrees; NaN where it is unknown.
    """

    edge_px: NDArray[np.float64]
    incidence_deg: NDArray[np.float64]


def unknown_surroundings(count: int) -> Surroundings:
    """Surroundings of points about which nothing is known."""
    return Surroundings(np.full(count, np.nan), np.full(count, np.nan))


def joined_surroundings(parts: Sequence[Surroundings]) -> Surroundings:
    """The points of all parts, in order."""
    edges, angles = ([getattr(part, name) for part in parts] for name in ("edge_px", "incidence_deg"))
    return Surroundings(np.concatenate([np.empty(0), *edges]), np.concatenate([np.empty(0), *angles]))


def find_surroundings(
    camera: CameraModel, uv: NDArray[np.float64], read_depth: ReadDepth, accuracy: DepthAccuracy
) -> Surroundings:
    """Nearest depth edge and angle of incidence of image points.

    Parameters
    ----------
    camera
        Of the image.
    uv
        (n, 2) float64, px.
    read_depth
        Reads dense depth.
    accuracy
        Uncertainty of these depths.
    """
    offsets = _star()
    around = (uv[:, None] + offsets).reshape(-1, 2)
    read_m, known = read_depth(around)
    hit = (known & np.isfinite(read_m)).reshape(len(uv), len(offsets))
    depth_m = np.minimum(read_m, _FARTHEST_M).reshape(hit.shape)
    edges = _first_edges(depth_m[:, 0], _on_lines(depth_m), _on_lines(known.reshape(hit.shape)), accuracy)
    nearest = np.take_along_axis(edges, np.abs(edges).argmin(axis=1)[:, None], axis=1)[:, 0]
    incidence_deg = _incidence_deg(camera, uv, depth_m, hit & _before(edges), offsets)
    return Surroundings(*(np.where(hit[:, 0], found, np.nan) for found in (nearest, incidence_deg)))


def _on_lines(values: NDArray[T]) -> NDArray[T]:
    """Values at the positions of the star by line, (n, lines, reach), without those at the point itself."""
    return values[:, 1:].reshape(len(values), DIRECTIONS, REACH_PX)


def _star() -> NDArray[np.float64]:
    """(1 + lines x reach, 2): the point itself, then each line from its start to its end, px."""
    angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    radius = np.arange(1, REACH_PX + 1)
    lines = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)[:, None]  # (lines, reach, 2)
    return np.concatenate([np.zeros((1, 2)), lines.reshape(-1, 2)])


def _first_edges(
    centre_m: NDArray[np.float64],
    depth_m: NDArray[np.float64],
    known: NDArray[np.bool_],
    accuracy: DepthAccuracy,
) -> NDArray[np.float64]:
    """Signed distance of the first edge of each line, (n, lines), by (edge); infinite where there is none."""
    found = np.full(depth_m.shape[:2], np.inf)
    before_m = np.broadcast_to(centre_m[:, None], found.shape)
    before_px = np.zeros(found.shape)
    for radius in range(1, depth_m.shape[2] + 1):
        here_m, there = depth_m[..., radius - 1], known[..., radius - 1]
        nearer_m = np.minimum(here_m, before_m)
        allowed = EDGE_RELATIVE_SPREAD + HOLE_RELATIVE_SLOPE * (radius - before_px - 1.0)
        slack_m = allowed * nearer_m + EDGE_SIGMAS * accuracy.sigma_m(nearer_m)
        deeper = here_m > before_m
        jumps = there & np.isinf(found) & (np.maximum(here_m, before_m) - nearer_m > slack_m)
        found = np.where(jumps, np.where(deeper, before_px + 0.5, 0.5 - radius), found)
        before_m, before_px = np.where(there, here_m, before_m), np.where(there, float(radius), before_px)
    return found


def _before(edges: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether each position of the star lies before the first edge of its line and near enough for the plane."""
    radius = np.arange(1, REACH_PX + 1)
    inside = (radius < np.abs(edges)[..., None]) & (radius <= SLOPE_REACH_PX)
    return np.concatenate(
        [np.ones((len(edges), 1), np.bool_), inside.reshape(len(edges), DIRECTIONS * REACH_PX)], axis=1
    )


def _incidence_deg(
    camera: CameraModel,
    uv: NDArray[np.float64],
    depth_m: NDArray[np.float64],
    usable: NDArray[np.bool_],
    offsets: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Angle between ray and normal, (n,) degrees; NaN where the fitted plane is not determined."""
    near = np.hypot(*offsets.T) <= SLOPE_REACH_PX + 0.5
    inverse, du, dv = _fitted_inverse_depth(depth_m[:, near], usable[:, near], offsets[near])
    ray, by_u, by_v = (camera.bearings(uv + np.array(step)) for step in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
    (a, c), (b, d) = (by_u - ray)[:, :2].T, (by_v - ray)[:, :2].T  # what the ray changes by per px
    determinant = a * d - b * c
    x, y = (d * du - c * dv) / determinant, (a * dv - b * du) / determinant
    normal = np.stack([x, y, inverse - x * ray[:, 0] - y * ray[:, 1]], axis=-1)
    cosine = inverse / (np.linalg.norm(normal, axis=-1) * np.linalg.norm(ray, axis=-1))
    return np.asarray(np.rad2deg(np.arccos(np.clip(cosine, 0.0, 1.0))))


def _fitted_inverse_depth(
    depth_m: NDArray[np.float64], usable: NDArray[np.bool_], offsets: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Inverse depth at the point, and its slope per px in u and in v, (3, n); NaN where they are not determined."""
    design = np.concatenate([np.ones((len(offsets), 1)), offsets], axis=1)
    weight = usable.astype(np.float64)
    inverse = np.divide(1.0, depth_m, out=np.zeros_like(depth_m), where=usable)
    normal = (weight @ (design[:, :, None] * design[:, None, :]).reshape(len(design), 9)).reshape(-1, 3, 3)
    spread = np.linalg.det(normal) / np.maximum(normal[:, 0, 0], 1.0)  # of the positions, px^4
    determined = spread > normal[:, 0, 0] ** 2  # not of positions on one line
    solved = np.linalg.solve(np.where(determined[:, None, None], normal, np.eye(3)), (inverse @ design)[..., None])
    return np.asarray(np.where(determined, solved[..., 0].T, np.nan))
