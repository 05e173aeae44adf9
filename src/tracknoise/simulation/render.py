"""Images of a world through a camera of any model."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.simulation.light import Lighting
from tracknoise.simulation.ray_casting import MISS, Raycaster, Rays, depth_map, image_rays
from tracknoise.simulation.textures import Atlas
from tracknoise.simulation.world import Scenery, World, texture_gradients

_RAYS_AT_ONCE = 16384  # so that the working set stays in the processor's cache
_SKY, _BLACK = np.float32(0.8), np.float32(0.0)
_TINY = 1e-300
_SHADOW_TOLERANCE = 1e-3
"""Relative tolerance of the distance from a lamp to a point that counts as lit, no unit."""

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Quality:
    """Rendering quality.

    Parameters
    ----------
    supersampling
        Rays along each side of a pixel. The pixel is their mean.
    shadows
        Whether surfaces block the lamps.

    Raises
    ------
    ValueError
        If `supersampling` is less than 1.
    """

    supersampling: int = 2
    shadows: bool = False

    def __post_init__(self) -> None:
        if self.supersampling < 1:
            raise ValueError(f"supersampling must be at least 1, not {self.supersampling}")


@dataclass(frozen=True, slots=True)
class _View:
    """A world seen from one pose: the values that shading needs for each triangle.

    A point on a triangle's plane is seen at bearing p = (x, y, 1) where its texture coordinates are the ratios
    (rows[0] . p) / (rows[2] . p) and (rows[1] . p) / (rows[2] . p).
    """

    world_from_camera: NDArray[np.float64]  # (4, 4)
    rows: NDArray[np.float64]  # (9, t + 1), the 3x3 matrix of each triangle; the last is for rays that hit nothing
    ahead: NDArray[np.float64]  # (t,) rows[2] . p times depth
    light: NDArray[np.float32]  # (lamps, t) irradiance of the visible side
    height_m: NDArray[np.float64]  # (point lamps, t) height of each above the triangle's plane, on that side


@dataclass(frozen=True)
class _Seen:
    """What n rays see from one pose."""

    view: _View
    rays: Rays
    triangle: NDArray[np.intp]  # (n,) for a ray that hits nothing, the last index
    shrink: NDArray[np.float64]  # (n,) depth / ahead
    reflectance: NDArray[np.float32]  # (n,)
    missed: NDArray[np.bool_]  # (n,)

    @cached_property
    def points(self) -> NDArray[np.float64]:
        """(n, 3). Only shadows and point lamps need them."""
        pose, depth_m = self.view.world_from_camera, self.view.ahead[self.triangle] * self.shrink
        points: NDArray[np.float64] = pose[:3, 3] + depth_m[:, None] * _rotated(pose, self.rays, np.float64)
        return points


_Lights = Callable[[_Seen], Iterable[NDArray[np.float32]]]
"""Returns the irradiance of the visible points for each of several lights, (n,) float32 each."""


class Renderer:
    """Renders one world through one camera.

    Parameters
    ----------
    world
        The world to render.
    raycaster
        Ray caster of the same world.
    camera
        The camera. Each ray is that of its model; pixels without a ray are black.
    lighting
        The light.
    quality
        The rendering quality.
    """

    def __init__(
        self, world: World, raycaster: Raycaster, *, camera: CameraModel, lighting: Lighting, quality: Quality
    ) -> None:
        self._raycaster, self._camera, self._lighting, self._quality = raycaster, camera, lighting, quality
        self._atlas = Atlas(world.textures)
        self._texture = world.texture
        self._gradient, self._offset = texture_gradients(world)
        self._rays = image_rays(camera, sample_offsets(quality.supersampling))
        self._side = self._atlas.side(world.texture)

    def image(self, world_from_camera: NDArray[np.float64]) -> NDArray[np.float32]:
        """Irradiance at the sensor, without noise.

        Parameters
        ----------
        world_from_camera
            (4, 4) float64, or (height, 4, 4) with a pose for each row, as under a rolling shutter.

        Returns
        -------
        (height, width) float32
            0 (black) to 1 (the sensor's full range) and above.
        """
        (image,) = self._render(world_from_camera, lambda seen: [self._light(seen)])
        return image

    def images_by_lamp(self, world_from_camera: NDArray[np.float64]) -> list[NDArray[np.float32]]:
        """Irradiance at the sensor for each point lamp alone, plus ambient light. Rays are cast once.

        Parameters
        ----------
        world_from_camera
            (4, 4) float64.

        Returns
        -------
        list of (height, width) float32
            One per point lamp, in the units of `image`.
        """
        ambient = np.float32(self._lighting.ambient)
        lamps = range(len(self._lighting.point_lamps))
        return self._render(world_from_camera, lambda seen: (ambient + self._from_lamp(seen, lamp) for lamp in lamps))

    def _render(self, world_from_camera: NDArray[np.float64], lights: _Lights) -> list[NDArray[np.float32]]:
        """(height, width) float32 each: one image per light."""
        camera, samples = self._camera, self._quality.supersampling**2
        bands = []
        for view, top, bottom in self._bands(world_from_camera):
            rays = self._rays.rows(top, bottom)
            seen = self._look(view, rays, self._rays.corners(top, bottom))
            shades = [np.where(seen.missed, _SKY, seen.reflectance * light) for light in lights(seen)]
            visible = [np.where(rays.blind, _BLACK, shade.reshape(-1, samples, camera.width)) for shade in shades]
            bands.append([shade.mean(axis=1, dtype=np.float32) for shade in visible])
        return [np.concatenate(image) for image in zip(*bands, strict=True)]

    def _bands(self, world_from_camera: NDArray[np.float64]) -> Iterator[tuple[_View, int, int]]:
        """What is rendered from one pose: the view, its first row, and the row after its last."""
        height = self._camera.height
        if world_from_camera.ndim > 2:
            yield from ((self._view(pose), row, row + 1) for row, pose in enumerate(world_from_camera))
            return
        view = self._view(world_from_camera)
        step = max(_RAYS_AT_ONCE // (self._quality.supersampling**2 * self._camera.width), 1)
        yield from ((view, top, min(top + step, height)) for top in range(0, height, step))

    def _view(self, world_from_camera: NDArray[np.float64]) -> _View:
        rotation, centre = world_from_camera[:3, :3], world_from_camera[:3, 3]
        normals = self._raycaster.normals
        ahead = self._raycaster.plane_offsets - np.einsum("ti,i->t", normals, centre)
        here = np.einsum("tci,i->tc", self._gradient, centre) + self._offset
        rows = np.zeros((len(normals) + 1, 3, 3))
        rows[:-1, 2] = np.einsum("ti,ij->tj", normals, rotation)
        rows[:-1, :2] = here[:, :, None] * rows[:-1, None, 2]
        rows[:-1, :2] += ahead[:, None, None] * np.einsum("tci,ij->tcj", self._gradient, rotation)
        rows[MISS, 2, 2] = 1.0
        seen_side = -np.sign(ahead)
        seen = normals * seen_side[:, None]
        light = np.array([lamp.irradiance(seen) for lamp in self._lighting.lamps], np.float32)
        return _View(
            world_from_camera,
            np.ascontiguousarray(rows.reshape(-1, 9).T),
            ahead,
            light.reshape(-1, len(normals)),
            self._heights(seen_side),
        )

    def _heights(self, seen_side: NDArray[np.float64]) -> NDArray[np.float64]:
        """(point lamps, t) float64: height of each lamp above each triangle's plane, metres."""
        positions = np.array([lamp.position_m for lamp in self._lighting.point_lamps]).reshape(-1, 3)
        above = np.einsum("li,ti->lt", positions, self._raycaster.normals) - self._raycaster.plane_offsets
        heights: NDArray[np.float64] = above * seen_side
        return heights

    def _look(self, view: _View, rays: Rays, corners: Rays) -> _Seen:
        """Visible points along the rays of some rows of pixels."""
        triangle = self._first_triangles(view, rays, corners)
        s, t, shrink, footprint = self._locate(view, triangle, rays)
        reflectance = self._atlas.read(self._texture[triangle], s, t, footprint)
        return _Seen(view, rays, triangle.ravel(), shrink.ravel(), reflectance.ravel(), triangle.ravel() == MISS)

    def _first_triangles(self, view: _View, rays: Rays, corners: Rays) -> NDArray[np.intp]:
        """First triangle that each ray hits, (rows, samples, width).

        Where one triangle is seen at all four corners of a pixel, all of the pixel sees it, but for parts of others in
        front of it that are smaller than a pixel: these are not in the image.
        """
        pose = view.world_from_camera
        at = self._raycaster.first_triangle(pose[:3, 3], _rotated(pose, corners, np.float32))
        at = np.where(corners.blind, MISS, at.reshape(corners.shape))[:, 0]
        first = at[:-1, :-1]
        same = (first == at[:-1, 1:]) & (first == at[1:, :-1]) & (first == at[1:, 1:]) & (first != MISS)
        found = np.broadcast_to(first[:, None], rays.shape).astype(np.intp)
        row, column = np.nonzero(~same)
        x, y = (np.broadcast_to(one, rays.shape)[row, :, column] for one in (rays.x, rays.y))
        directions = _rotated(pose, replace(rays, x=x, y=y), np.float32)
        found[row, :, column] = self._raycaster.first_triangle(pose[:3, 3], directions).reshape(x.shape)
        return found

    def _locate(
        self, view: _View, triangle: NDArray[np.intp], rays: Rays
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float32]]:
        """Texture coordinates, depth / ahead, and footprint (texels) of the visible points along the rays."""
        a, b, c, d, e, f, g, h, i = view.rows.take(triangle, axis=1)
        x, y = rays.x, rays.y
        shrink = 1.0 / (g * x + h * y + i)
        s, t = (a * x + b * y + c) * shrink, (d * x + e * y + f) * shrink
        along_x, along_y = (a - s * g, d - t * g), (b - s * h, e - t * h)
        right, down = (
            (along_x[0] * step_x + along_y[0] * step_y, along_x[1] * step_x + along_y[1] * step_y)
            for step_x, step_y in ((shrink * x, shrink * y) for x, y in (rays.right, rays.down))
        )
        return s, t, shrink, self._footprint(right, down, self._side[triangle])

    def _footprint(
        self, right: tuple[_Floats, _Floats], down: tuple[_Floats, _Floats], side: NDArray[np.int64]
    ) -> NDArray[np.float32]:
        """Number of texels per ray, from the steps in the texture that one pixel to the right, or down, makes.

        The n^2 rays of a pixel are 1/n px apart. Along a single direction, such as that of foreshortening on a slanted
        surface, their projections are only 1/n^2 px apart. The texture therefore needs less blur.
        """
        n = self._quality.supersampling
        longer = np.sqrt(np.maximum(right[0] ** 2 + right[1] ** 2, down[0] ** 2 + down[1] ** 2))
        shorter = np.abs(right[0] * down[1] - right[1] * down[0]) / np.maximum(longer, _TINY)
        return (np.maximum(longer / n**2, shorter / n) * side).astype(np.float32)

    def _light(self, seen: _Seen) -> NDArray[np.float32]:
        """Irradiance of the visible points from all lamps."""
        lighting, light = self._lighting, seen.view.light
        if self._quality.shadows:
            total = np.full(len(seen.triangle), lighting.ambient, np.float32)
            for lamp, irradiance in zip(lighting.lamps, light, strict=True):
                total += irradiance[seen.triangle] * self._raycaster.lit(seen.points, lamp.towards)
        else:
            total = (lighting.ambient + light.sum(axis=0))[seen.triangle]
        for index in range(len(lighting.point_lamps)):
            total += self._from_lamp(seen, index)
        return total

    def _from_lamp(self, seen: _Seen, index: int) -> NDArray[np.float32]:
        """Irradiance of the visible points from one point lamp."""
        lamp = self._lighting.point_lamps[index]
        light = lamp.irradiance(seen.points, seen.view.height_m[index, seen.triangle]).astype(np.float32)
        if self._quality.shadows:
            light *= self._reached(np.array(lamp.position_m), seen.points)
        return light

    def _reached(self, lamp: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether the first surface on the line from a lamp to each point is the surface of the point."""
        share, _ = self._raycaster.distances(lamp, points - lamp)
        reached: NDArray[np.bool_] = share > 1.0 - _SHADOW_TOLERANCE
        return reached


def sample_offsets(supersampling: int) -> NDArray[np.float64]:
    """Positions of the rays within a pixel.

    One ray per cell of an n x n grid, shifted so that no two rays share a row or column. An edge along the image axes
    then has n^2 shades instead of n. The pattern is point-symmetric about the centre of the pixel. Returns (n * n, 2)
    px. Right and down from the centre of the pixel, px.
    """
    n = supersampling
    column, row = np.indices((n, n)).reshape(2, -1)
    right = (column + (row + 0.5) / n) / n - 0.5
    down = (row + (n - 1 - column + 0.5) / n) / n - 0.5
    return np.stack([right, down], axis=-1)


_Float = TypeVar("_Float", np.float32, np.float64)


def _rotated(world_from_camera: NDArray[np.float64], rays: Rays, precision: type[_Float]) -> NDArray[_Float]:
    """(n, 3): the bearings (x, y, 1) of n rays in the world frame, computed in float64."""
    directions = np.empty((*rays.shape, 3), precision)
    for axis, (right, down, forward) in enumerate(world_from_camera[:3, :3]):
        directions[..., axis] = right * rays.x + down * rays.y + forward
    return directions.reshape(-1, 3)


Poses = NDArray[np.float64]
"""(4, 4), or (height, 4, 4) with a pose for each row."""


@dataclass(frozen=True, slots=True)
class Optics:
    """What a renderer is made for."""

    camera: CameraModel
    lighting: Lighting  # the light
    quality: Quality  # the rendering quality


class RenderedWorld:
    """Images, depth maps and ray casts of one world. Several sequences can share it.

    Parameters
    ----------
    build
        Builds the world. It must be possible to pickle it: a copy in another process builds its world again.
    """

    def __init__(self, build: Callable[[], Scenery]) -> None:
        self._build = build
        self._renderers: dict[Optics, Renderer] = {}

    def __reduce__(self) -> tuple[type["RenderedWorld"], tuple[Callable[[], Scenery]]]:
        """Only what builds it."""
        return type(self), (self._build,)

    @property
    def notes(self) -> tuple[str, ...]:
        """See `Scenery.notes`."""
        return self._scenery.notes

    def irradiance(self, optics: Optics, exposures: Iterable[Poses]) -> NDArray[np.float32]:
        """(height, width) float32: the mean of the images from one or several poses; see `Renderer.image`."""
        if optics not in self._renderers:
            self._renderers[optics] = Renderer(
                self._scenery.world,
                self.raycaster,
                camera=optics.camera,
                lighting=optics.lighting,
                quality=optics.quality,
            )
        images = [self._renderers[optics].image(poses) for poses in exposures]
        return images[0] if len(images) == 1 else np.mean(images, axis=0, dtype=np.float32)

    def depth(self, camera: CameraModel, poses: Poses) -> DepthMap:
        """Exact depth at the pixel centres, float64."""
        return depth_map(self.raycaster, camera, poses)

    @cached_property
    def _scenery(self) -> Scenery:
        return self._build()

    @cached_property
    def raycaster(self) -> Raycaster:
        """Of the exact surface."""
        return Raycaster(self._scenery.world)
