"""Rays of an image, and the exact points of the surface that they meet.

Embree finds the first triangle, and its plane in float64 gives the exact point.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from tracknoise.geometry.cameras import Camera, CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.simulation.world import World

MISS = -1
_LIFT_M = 1e-3
"""Distance of the origins of rays to a light from the surface, so that it does not shade itself."""


class Raycaster:
    """Casts rays into a world.

    Embree works in float32. That is precise enough to find the first triangle, but not the point: on a large triangle
    it is off by up to 1 mm. Points are therefore computed from the plane of the triangle.

    Parameters
    ----------
    world
        The world to cast into.
    """

    def __init__(self, world: World) -> None:
        self.normals = world.normals
        self.plane_offsets = np.einsum("ti,ti->t", self.normals, world.corners[:, 0])
        self._corners = world.corners.astype(np.float32)
        self._blocks_light = world.blocks_light
        self._scene = _embree(self._corners)

    def first_triangle(self, origin: NDArray[np.float64], directions: NDArray[np.float32]) -> NDArray[np.int32]:
        """First triangle that each ray hits.

        Shapes: origin (3,) or (n, 3) m in the world frame, directions (n, 3) in the world frame; returns (n,). Index of
        the triangle. `MISS` if a ray hits nothing.
        """
        start = np.broadcast_to(origin.astype(np.float32), directions.shape)
        triangles: NDArray[np.int32] = self._scene.run(start, directions, query="INTERSECT")
        return triangles

    def distances(
        self, origin: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Distance along each ray to the first surface.

        Parameters
        ----------
        origin
            (3,) or (n, 3) float64, metres, world frame: one for all rays, or one for each.
        directions
            (n, 3) float64, world frame.

        Returns
        -------
        distance : (n,) float64
            In lengths of the direction, exact except for rounding. Directions of depth 1 give depths in metres. 0 if
            nothing is hit.
        hit : (n,) bool
        """
        triangle = self.first_triangle(origin, directions.astype(np.float32))
        hit = triangle != MISS
        normals = self.normals[triangle]
        origins = np.broadcast_to(origin, normals.shape)
        ahead = self.plane_offsets[triangle] - np.einsum("ni,ni->n", normals, origins)
        along = np.einsum("ni,ni->n", normals, directions)
        return np.divide(ahead, along, out=np.zeros(len(directions)), where=hit), hit

    def lit(self, points: NDArray[np.float64], towards_light: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points are lit by a light at infinity.

        Parameters
        ----------
        points
            (n, 3) float64, metres, world frame.
        towards_light
            (3,) float64, unit direction to the light.

        Returns
        -------
        (n,) bool
        """
        starts = (points + _LIFT_M * towards_light).astype(np.float32)
        directions = np.broadcast_to(towards_light.astype(np.float32), starts.shape)
        clear: NDArray[np.bool_] = self._blockers.run(starts, directions, query="OCCLUDED") == MISS
        return clear

    @cached_property
    def _blockers(self) -> EmbreeScene:
        return _embree(self._corners[self._blocks_light])


def surface_points(
    raycaster: Raycaster, camera: CameraModel, world_from_camera: NDArray[np.float64], uv: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """First surface points on the rays through pixels: exact truth.

    Parameters
    ----------
    raycaster
        Ray caster of the world.
    camera
        Camera of the pixels.
    world_from_camera
        (4, 4) float64, or (n, 4, 4) with a pose for each pixel, as under a rolling shutter.
    uv
        (n, 2) float64, px.

    Returns
    -------
    points_world : (n, 3) float64
        Metres; the position of the camera where nothing is hit, or the pixel has no ray.
    hit : (n,) bool
    """
    directions, depth_m, hit = _cast(raycaster, camera, world_from_camera, uv)
    return world_from_camera[..., :3, 3] + depth_m[:, None] * directions, hit


def depth_map(raycaster: Raycaster, camera: CameraModel, world_from_camera: NDArray[np.float64]) -> DepthMap:
    """Exact depth at the pixel centres, float64. Shapes: world_from_camera (4, 4)."""
    shape = (camera.height, camera.width)
    v, u = np.indices(shape, dtype=np.float64)
    uv = np.stack([u.ravel(), v.ravel()], axis=-1)
    rolled = world_from_camera.ndim > 2
    poses = np.repeat(world_from_camera, camera.width, axis=0) if rolled else world_from_camera
    _, depth_m, hit = _cast(raycaster, camera, poses, uv)
    return DepthMap(depth_m.reshape(shape), hit.reshape(shape))


def _embree(corners: NDArray[np.float32]) -> EmbreeScene:
    """An Embree scene in which no ray passes between adjacent triangles."""
    scene = EmbreeScene(robust=True)
    TriangleMesh(scene, corners)
    return scene


def _cast(
    raycaster: Raycaster, camera: CameraModel, world_from_camera: NDArray[np.float64], uv: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Directions of depth 1 through pixels, world frame; depths; hits. A pixel without a ray hits nothing."""
    rotation, centre = world_from_camera[..., :3, :3], world_from_camera[..., :3, 3]
    bearings = camera.bearings(uv)
    seeing = ~np.isnan(bearings[:, 0])
    rotations = np.broadcast_to(rotation, (len(uv), 3, 3))
    directions = np.einsum("nij,nj->ni", rotations, np.where(seeing[:, None], bearings, (0.0, 0.0, 1.0)))
    depth_m, hit = raycaster.distances(centre, directions)
    return directions, np.where(seeing, depth_m, 0.0), hit & seeing


_Floats = NDArray[np.float64]
Step = tuple[_Floats | float, _Floats | float]
"""Change of x and y of a bearing from one pixel to the next: one for all rays, or for each."""


@dataclass(frozen=True, slots=True)
class Rays:
    """Rays of some rows of an image, with bearings (x, y, 1).

    All arrays broadcast to (rows, samples, width): what is the same in a row, or in a column, is there once.
    """

    # x, y: float64
    x: _Floats
    y: _Floats
    # right, down: steps to the next pixel
    right: Step
    down: Step
    blind: NDArray[np.bool_] | bool  # bool: there is no ray, and x and y are 0

    @property
    def shape(self) -> tuple[int, ...]:
        """(rows, samples, width)."""
        return np.broadcast_shapes(self.x.shape, self.y.shape)


class ImageRays(Protocol):
    """The rays of one camera."""

    def rows(self, top: int, bottom: int) -> Rays:
        """Rays of some rows of pixels."""
        ...

    def corners(self, top: int, bottom: int) -> Rays:
        """Rays through the corners of these pixels, (rows + 1, 1, width + 1)."""
        ...


class PinholeRays:
    """Rays of a camera without distortion: columns and rows are independent of each other.

    Shapes: offsets (samples, 2) px.
    """

    def __init__(self, camera: Camera, offsets: _Floats) -> None:
        right, down = offsets.T
        self._x = (np.arange(camera.width) + right[:, None] - camera.cx) / camera.fx
        self._y = (np.arange(camera.height)[:, None] + down - camera.cy) / camera.fy
        self._right, self._down = (1.0 / camera.fx, 0.0), (0.0, 1.0 / camera.fy)
        self._corner_x = (np.arange(camera.width + 1, dtype=np.float64) - 0.5 - camera.cx) / camera.fx
        self._corner_y = (np.arange(camera.height + 1, dtype=np.float64) - 0.5 - camera.cy) / camera.fy

    def rows(self, top: int, bottom: int) -> Rays:
        """See `ImageRays.rows`."""
        return Rays(self._x[None], self._y[top:bottom, :, None], self._right, self._down, False)

    def corners(self, top: int, bottom: int) -> Rays:
        """See `ImageRays.corners`."""
        y = self._corner_y[top : bottom + 1]
        return Rays(self._corner_x[None, None], y[:, None, None], self._right, self._down, False)


class LensRays:
    """Rays of any camera, each computed with its model, once. Pixels without a ray are blind.

    Parameters
    ----------
    camera
        The camera.
    offsets
        (samples, 2) float64, positions of the rays in a pixel, from its centre, px.
    """

    def __init__(self, camera: CameraModel, offsets: _Floats) -> None:
        v, u = np.indices((camera.height, camera.width), dtype=np.float64)
        centres = np.stack([u, v], axis=-1)[:, None]  # (height, 1, width, 2)
        bearings = camera.bearings(centres + offsets[:, None])[..., :2]
        self._blind = np.isnan(bearings[..., 0])
        self._xy = np.where(self._blind[..., None], 0.0, bearings)
        v, u = np.indices((camera.height + 1, camera.width + 1), dtype=np.float64) - 0.5
        self._corners = camera.bearings(np.stack([u, v], axis=-1))[:, None, :, :2]  # (height + 1, 1, width + 1, 2)
        self._right, self._down = (
            _per_sample(camera, centres, np.array(half), len(offsets)) for half in ((0.5, 0.0), (0.0, 0.5))
        )

    def rows(self, top: int, bottom: int) -> Rays:
        """See `ImageRays.rows`."""
        (x, y), right, down = (
            (grid[top:bottom, ..., 0], grid[top:bottom, ..., 1]) for grid in (self._xy, self._right, self._down)
        )
        return Rays(x, y, right, down, self._blind[top:bottom])

    def corners(self, top: int, bottom: int) -> Rays:
        """See `ImageRays.corners`."""
        some = self._corners[top : bottom + 1]
        blind = np.isnan(some[..., 0])
        seen: _Floats = np.where(blind[..., None], 0.0, some)
        return Rays(seen[..., 0], seen[..., 1], (0.0, 0.0), (0.0, 0.0), blind)


def image_rays(camera: CameraModel, offsets: _Floats) -> ImageRays:
    """The rays of a camera; `offsets` as in `LensRays`."""
    if isinstance(camera, Camera) and not camera.distortion:
        return PinholeRays(camera, offsets)
    return LensRays(camera, offsets)


def _per_sample(camera: CameraModel, centres: _Floats, half: _Floats, samples: int) -> _Floats:
    """(height, samples, width, 2): difference of the bearings of a pixel's two sides; 0 where one has no ray."""
    step = (camera.bearings(centres + half) - camera.bearings(centres - half))[..., :2]
    return np.broadcast_to(np.nan_to_num(step, nan=0.0), (len(step), samples, *step.shape[2:]))
