"""Depth maps, dense and sparse: reading between pixels, other cameras' views of them, and point clouds."""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.accuracy import EXACT_DEPTH, DepthAccuracy
from tracknoise.geometry.cameras import CameraModel

LEAST_DEPTH_M = 1e-6
"""Smaller numbers are no depth of a scene; the inverse of some overflows."""
EDGE_RELATIVE_SPREAD = 0.02
_SPARSE_RELATIVE_SPREAD = 0.1
_LENS_EVERY_PX, _LENS_LEAST = 8, 0.25
"""Pixels at which it is seen whether a lens changes depths along z from pixel to pixel, and the part of an edge's
spread from which on that counts."""


@dataclass(frozen=True, slots=True)
class DepthMap:
    """Depth of every pixel of an image.

    Parameters
    ----------
    depth_m
        (height, width) float32 or float64, depth along z, metres; meaningless where not valid.
    valid
        (height, width) bool.
    radius_px
        None where depth is dense, and read by interpolation; where it is sparse (lidar), the largest
        distance to the nearest valid pixel, whose depth is used, px.
    accuracy
        Uncertainty of these depths where it matters for what is visible; exact by default.

    Raises
    ------
    ValueError
        If the two arrays have different shapes, or the radius is negative.
    """

    depth_m: NDArray[np.floating]
    valid: NDArray[np.bool_]
    radius_px: float | None = None
    accuracy: DepthAccuracy = EXACT_DEPTH

    def __post_init__(self) -> None:
        if self.depth_m.shape != self.valid.shape or self.depth_m.ndim != 2:
            raise ValueError(f"depth {self.depth_m.shape} and valid {self.valid.shape} must be the same 2-D shape")
        if self.radius_px is not None and not self.radius_px >= 0:
            raise ValueError(f"radius_px must be at least 0, not {self.radius_px}")


@dataclass(frozen=True, slots=True)
class DepthSample:
    """Depth read at sub-pixel positions."""

    depth_m: NDArray[np.float64]  # (n,) float64, metres; 1 where not valid
    valid: NDArray[np.bool_]  # (n,) bool: the depth is known there
    edge: NDArray[np.bool_]  # (n,) bool: depth was measured around, but on both sides of a discontinuity


def sample(depth: DepthMap, uv: NDArray[np.float64], camera: CameraModel) -> DepthSample:
    """Read a map at sub-pixel positions: with `interpolate` if it is dense, with `nearest` if it is sparse.

    Parameters
    ----------
    depth
        The map.
    uv
        (n, 2) float64, px.
    camera
        Of the image.
    """
    return interpolate(depth, uv, camera) if depth.radius_px is None else nearest(depth, uv, depth.radius_px)


def interpolate(
    depth: DepthMap, uv: NDArray[np.float64], camera: CameraModel, *, spread: float = EDGE_RELATIVE_SPREAD
) -> DepthSample:
    """Read dense depth at sub-pixel positions from the four neighbouring pixels.

    Inverse depth is interpolated bilinearly: on a plane inverse depth is linear in the image, so that the result
    is exact there. Where the farthest of the four neighbours exceeds the nearest by more than `spread`, relative
    to the nearest, the position lies on an edge and has no depth. All four count, even those of weight 0 at a pixel's
    centre, which are the pixels to the right and below: corners often lie on outlines, and a feature on an outline may
    belong to either side of it. Far from the axis of a fisheye lens depth along z changes that much from pixel to pixel
    of a smooth surface; there it is an edge only if distances along the rays differ by as much too. Shapes: uv (n, 2)
    px of the map, whose corners are those of the image.
    """
    corners, inside = _neighbours(depth, uv)
    complete = inside & corners.valid.all(axis=0)
    z = np.where(corners.valid, corners.depth_m, 1.0)
    agree = _agree(z, spread)
    per_range = _depth_per_range(camera, *depth.depth_m.shape)
    if per_range is not None:
        agree |= _agree(z / per_range[corners.rows, corners.columns], spread)
    inverse = (corners.weight / z).sum(axis=0)
    usable = complete & agree
    return DepthSample(np.where(usable, 1.0 / inverse, 1.0), usable, complete & ~agree)


def _agree(lengths: NDArray[np.float64], spread: float) -> NDArray[np.bool_]:
    """(n,): whether the largest of lengths (k, n) exceeds the smallest by at most `spread`, relative to that."""
    nearest = lengths.min(axis=0)
    return np.asarray(lengths.max(axis=0) - nearest <= spread * nearest)


@lru_cache(maxsize=2)
def _depth_per_range(camera: CameraModel, height: int, width: int) -> NDArray[np.float64] | None:
    """(height, width): depth along z over the distance along the ray, at the pixels of a map of the whole image.

    1 where a pixel has no ray. None where it changes from pixel to pixel by too little to make an edge.
    """
    size, image = np.array([width, height]), np.array([camera.width, camera.height])

    def at(columns: NDArray[np.float64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
        pixels = np.stack([columns, rows], axis=-1).reshape(-1, 2)
        rays = camera.bearings((pixels + 0.5) * image / size - 0.5)
        return np.asarray(rays[:, 2] / np.linalg.norm(rays, axis=1)).reshape(columns.shape)

    rows, columns = np.meshgrid(
        np.arange(0.0, height - 1, _LENS_EVERY_PX), np.arange(0.0, width - 1, _LENS_EVERY_PX), indexing="ij"
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        change = np.abs(np.log(at(columns + 1.0, rows + 1.0) / at(columns, rows)))
        if not np.nanmax(change, initial=0.0) > _LENS_LEAST * EDGE_RELATIVE_SPREAD:
            return None
        per_range = at(*reversed(np.indices((height, width), dtype=np.float64)))
    return np.where(per_range > 0.0, per_range, 1.0)


def enlarged(depth: DepthMap, camera: CameraModel) -> DepthMap:
    """A dense map of a smaller image that shows the same, at the pixels of a larger one: see `interpolate`.

    Pixels on edges have no depth, nor have those beyond the centres of the outermost pixels of the smaller image.

    Parameters
    ----------
    depth
        The map.
    camera
        Of the larger image; the corners of both images are the same.
    """
    rows, columns = depth.depth_m.shape
    width, height = camera.width, camera.height
    u, v = ((np.arange(side) + 0.5) * count / side - 0.5 for side, count in ((width, columns), (height, rows)))
    read = interpolate(depth, np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2), camera)
    return DepthMap(read.depth_m.reshape(height, width), read.valid.reshape(height, width), accuracy=depth.accuracy)


def nearest(depth: DepthMap, uv: NDArray[np.float64], radius_px: float) -> DepthSample:
    """Read sparse depth at sub-pixel positions: the depth of the nearest valid pixel centre.

    Of several at the same distance, the one of least depth counts, so that nothing depends on the order of pixels.
    Where the farthest valid depth within the radius exceeds the nearest by more than a tenth, the position lies on an
    edge and has no depth: pixels of a lidar may belong to two surfaces, and the nearest may belong to the wrong one. On
    a slanted surface the difference is smaller: on a road, two rows apart, it reaches a tenth only beyond 60 m from
    KITTI's camera. Shapes: uv (n, 2) px.
    """
    depth_m, distance_px = _around(depth, uv, radius_px)
    valid = np.isfinite(distance_px)
    has_depth = valid.any(axis=0)
    closest = valid & (distance_px == distance_px.min(axis=0))
    at_closest = np.where(closest, depth_m, np.inf).min(axis=0)
    front, back = np.where(valid, depth_m, np.inf).min(axis=0), np.where(valid, depth_m, 0.0).max(axis=0)
    agree = back <= (1.0 + _SPARSE_RELATIVE_SPREAD) * front
    return DepthSample(np.where(has_depth & agree, at_closest, 1.0), has_depth & agree, has_depth & ~agree)


def at_pixels(depth: DepthMap, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Depth of the pixels in which positions lie.

    Parameters
    ----------
    depth
        The map.
    uv
        (n, 2) float64, px; they may lie outside the image.

    Returns
    -------
    depth_m : (n,) float64
        Metres; 1 where not valid.
    valid : (n,) bool
    """
    height, width = depth.depth_m.shape
    column, row = np.floor(uv + 0.5).astype(np.intp).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    flat = np.where(inside, row * width + column, 0)
    valid = inside & depth.valid.ravel()[flat]
    return np.where(valid, depth.depth_m.ravel()[flat], 1.0).astype(np.float64), valid


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


def _around(
    depth: DepthMap, uv: NDArray[np.float64], radius_px: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depth of the pixels around each position, (k, n), and their distance, infinite where too far or not valid."""
    height, width = depth.depth_m.shape
    reach = int(radius_px + 0.5)
    rows, columns = np.indices((2 * reach + 1, 2 * reach + 1)).reshape(2, -1, 1) - reach
    near = np.all((uv > -reach - 1) & (uv < (width + reach, height + reach)), axis=1)
    centre = np.floor(np.where(near[:, None], uv, 0.0) + 0.5).astype(np.intp)
    rows, columns = rows + centre[:, 1], columns + centre[:, 0]
    distance_px = np.hypot(columns - uv[:, 0], rows - uv[:, 1])
    usable = near & (distance_px <= radius_px)
    usable &= (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    rows, columns = np.where(usable, rows, 0), np.where(usable, columns, 0)
    usable &= depth.valid[rows, columns]
    return depth.depth_m[rows, columns].astype(np.float64), np.where(usable, distance_px, np.inf)


@dataclass(frozen=True, slots=True)
class _Corners:
    depth_m: NDArray[np.float64]  # (4, n)
    valid: NDArray[np.bool_]  # (4, n)
    weight: NDArray[np.float64]  # (4, n)
    rows: NDArray[np.intp]  # (4, n)
    columns: NDArray[np.intp]  # (4, n)


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
    depth_m, valid = depth.depth_m[rows, columns].astype(np.float64), depth.valid[rows, columns]
    return _Corners(depth_m, valid, weight, rows, columns), inside


_TOUCH = 1e-9
"""How far outside of a triangle a pixel may lie, in px and in barycentric coordinates: rounding must leave no holes."""

_STRIP = 16
"""Rows whose triangles are drawn together: few enough for the processor's cache."""


def reproject_depth(
    depth: DepthMap,
    camera: CameraModel,
    target: CameraModel,
    target_from_camera: NDArray[np.float64],
) -> DepthMap:
    """Depth of every pixel of a target camera, from the dense depth map of another camera.

    Each four neighbouring pixels of the map are two triangles of the surface. A triangle across a discontinuity is left
    out. A target pixel gets the depth of the triangle on its ray, the nearest of several. Inverse depth is
    interpolated in the target image, so that planes stay exact. Pixels without a triangle have no depth: holes are not
    filled.

    Parameters
    ----------
    depth
        Dense depth along the z axis of `camera`.
    camera, target
        Both cameras.
    target_from_camera
        (4, 4) float64, metres: from the frame of `camera` to that of `target`.

    Returns
    -------
    DepthMap
        Of the target's size; depth in float64.
    """
    vertices = _vertices(depth, camera, target, target_from_camera)
    nearest = np.zeros(target.height * target.width)
    for top in range(0, len(vertices[0]) - 1, _STRIP):
        _draw(nearest, target, vertices[:, top : top + _STRIP + 1])
    seen = nearest > 0.0
    depth_m = np.divide(1.0, nearest, out=np.zeros_like(nearest), where=seen)
    size = (target.height, target.width)
    return DepthMap(depth_m.reshape(size), seen.reshape(size), accuracy=depth.accuracy)


def _vertices(
    depth: DepthMap, camera: CameraModel, target: CameraModel, target_from_camera: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Vertices (3, height, width): u and v of each pixel of the map in the target, px, and inverse depth; or NaN."""
    height, width = depth.valid.shape
    rays = _rays(camera, height, width, target_from_camera[:3, :3].tobytes())
    z = np.where(depth.valid, depth.depth_m, np.nan)
    planes = np.empty((3, height, width))  # of x, y and z: each is computed faster than every third number
    for plane, ray, shift in zip(planes, rays, target_from_camera[:3, 3], strict=True):
        np.multiply(ray, z, out=plane)
        plane += shift
    planes[:, ~(planes[2] > 0.0)] = np.nan
    vertices = np.empty((3, height, width))
    vertices[:2] = np.moveaxis(target.project(np.moveaxis(planes, 0, -1)), -1, 0)
    np.divide(1.0, planes[2], out=vertices[2])
    return vertices


@lru_cache(maxsize=1)
def _rays(camera: CameraModel, height: int, width: int, rotation: bytes) -> NDArray[np.float64]:
    """Rays through the pixels of a map with depth 1, turned: (3, height, width)."""
    rows, columns = np.indices((height, width), dtype=np.float64)
    rays = camera.unproject(np.stack([columns, rows], axis=-1), np.ones((height, width)))
    return np.ascontiguousarray(np.moveaxis(rays @ np.frombuffer(rotation).reshape(3, 3).T, -1, 0))


def _draw(nearest: NDArray[np.float64], target: CameraModel, vertices: NDArray[np.float64]) -> None:
    """Enter the inverse depth of triangles where it is the largest of a pixel so far.

    Each four neighbouring vertices (3, rows, columns) are two triangles, which share the side from the upper right to
    the lower left. Those with a vertex that is unknown, or whose depths differ by more than `EDGE_RELATIVE_SPREAD`, are
    left out.
    """
    halves = (slice(None, -1), slice(1, None))
    first, right, below, last = (vertices[:, rows, columns] for rows in halves for columns in halves)
    high, low = np.maximum(right[2], below[2]), np.minimum(right[2], below[2])
    upper, lower = (
        np.maximum(high, end) <= (1.0 + EDGE_RELATIVE_SPREAD) * np.minimum(low, end) for end in (first[2], last[2])
    )
    covers, starts, extents = upper | lower, [], []
    for axis, size in enumerate((target.width, target.height)):
        sides = right[axis], below[axis]
        ends = np.where(upper, first[axis], sides[0]), np.where(lower, last[axis], sides[0])
        start = np.maximum(np.ceil(_reduced(np.minimum, *ends, *sides) - _TOUCH), 0.0)
        more = np.minimum(np.floor(_reduced(np.maximum, *ends, *sides) + _TOUCH), size - 1.0) - start
        covers &= more >= 0.0
        starts.append(start)
        extents.append(more)
    drawn = np.flatnonzero(covers)
    left, top = (values.ravel().take(drawn) for values in starts)
    extent = [values.ravel().take(drawn) for values in extents]
    width = vertices.shape[2]
    quads = _Quads(vertices, drawn + drawn // (width - 1), upper.ravel().take(drawn), lower.ravel().take(drawn))
    columns, rows = (int(values.max(initial=-1.0)) + 1 for values in extent)
    for step in np.ndindex(columns, rows):
        reached = None if not any(step) else np.flatnonzero((extent[0] >= step[0]) & (extent[1] >= step[1]))
        u, v = (start if reached is None else start.take(reached) for start in (left, top))
        u, v = u + step[0], v + step[1]
        value, inside = quads.interpolated(u, v, reached)
        np.maximum.at(nearest, (v[inside] * target.width + u[inside]).astype(np.intp), value[inside])


def _reduced(extreme: np.ufunc, array: NDArray[np.float64], *further: NDArray[np.float64]) -> NDArray[np.float64]:
    """Minimum or maximum of several arrays, one call each: faster than a reduction along the first axis."""
    for more in further:
        array = extreme(array, more)
    return array


class _Quads(NamedTuple):
    """Quadrilaterals of vertices (3, rows, columns): place of the upper left, and which triangles are drawn, (n,)."""

    vertices: NDArray[np.float64]
    place: NDArray[np.intp]
    upper: NDArray[np.bool_]
    lower: NDArray[np.bool_]

    def interpolated(
        self, u: NDArray[np.float64], v: NDArray[np.float64], chosen: NDArray[np.intp] | None
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Inverse depth at one pixel of each that is chosen, and whether a triangle that is drawn covers the pixel."""
        place, upper, lower = (part if chosen is None else part.take(chosen) for part in self[1:])
        width = self.vertices.shape[2]
        us, vs, inverses = (plane.ravel() for plane in self.vertices)
        right, below = place + 1, place + width
        u0, v0, inverse0 = us.take(right), vs.take(right), inverses.take(right)
        u1, v1, inverse1 = us.take(below) - u0, vs.take(below) - v0, inverses.take(below) - inverse0
        du, dv = u - u0, v - v0
        with np.errstate(all="ignore"):  # of triangles without an area, and of vertices that are unknown
            from_side = u1 * dv - v1 * du
            is_upper = from_side * (u1 * (vs.take(place) - v0) - v1 * (us.take(place) - u0)) >= 0.0
            end = np.where(is_upper, place, below + 1)
            u2, v2, inverse2 = us.take(end) - u0, vs.take(end) - v0, inverses.take(end) - inverse0
            area = u1 * v2 - v1 * u2
            along, across = (du * v2 - dv * u2) / area, from_side / area
            inside = np.where(is_upper, upper, lower)
            inside &= (along >= -_TOUCH) & (across >= -_TOUCH) & (along + across <= 1.0 + _TOUCH)
            return inverse0 + along * inverse1 + across * inverse2, inside


def cloud_depth(camera: CameraModel, points: NDArray[np.float64], *, nearest_m: float, radius_px: float) -> DepthMap:
    """Sparse depth map of a cloud of points: each pixel has the depth of the nearest point that is projected into it.

    Parameters
    ----------
    camera
        The camera of the depth map.
    points
        (n, 3) float64, metres, camera frame, finite.
    nearest_m
        Points of less depth are ignored, metres.
    radius_px
        See `DepthMap`.
    """
    seen = points[points[:, 2] >= nearest_m]
    uv = camera.project(seen)
    inside = camera.contains(uv)
    columns, rows = np.floor(uv[inside] + 0.5).astype(np.intp).T
    depth_m = np.full((camera.height, camera.width), np.inf)
    np.minimum.at(depth_m, (rows, columns), seen[inside, 2])
    return DepthMap(depth_m, np.isfinite(depth_m), radius_px)
