"""The world that is rendered: triangles with textures, flat rectangles of them, and notes on what differs from a model.

World frame: x east, y north, z up, metres. Textures hold reflectance, 0 (black) to 1 (white).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.pose import transform


@dataclass(frozen=True, slots=True)
class World:
    """A triangle mesh with flat faces and textures.

    Parameters
    ----------
    vertices
        (v, 3) float64, metres, world frame.
    faces
        (t, 3) int64, vertices of each triangle; counter-clockwise seen from the side the normal points to.
    corner_uv
        (t, 3, 2) float64, texture coordinates of each triangle's corners, in repeats of the texture:
        column / side and row / side, where whole numbers are borders between texels, row 0 first.
    texture
        (t,) int64, index of each triangle's texture.
    textures
        (side, side) float32 each, reflectance, side a power of two. They repeat infinitely.
    blocks_light
        (t,) bool, whether a triangle casts shadows; a sky that encloses the world must not.

    Raises
    ------
    ValueError
        If shapes do not fit together, an index is out of range, a texture is not square with a side that is a power
        of two, or a triangle has no area.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    corner_uv: NDArray[np.float64]
    texture: NDArray[np.int64]
    textures: tuple[NDArray[np.float32], ...]
    blocks_light: NDArray[np.bool_]

    def __post_init__(self) -> None:
        count = len(self.faces)
        shapes = [array.shape for array in (self.faces, self.corner_uv, self.texture, self.blocks_light)]
        if shapes != [(count, 3), (count, 3, 2), (count,), (count,)]:
            raise ValueError("faces (t, 3), corner_uv (t, 3, 2), texture (t,) and blocks_light (t,) must agree")
        _require_range("faces", self.faces, len(self.vertices))
        _require_range("texture", self.texture, len(self.textures))
        for image in self.textures:
            side = image.shape[0]
            if image.shape != (side, side) or side & (side - 1):
                raise ValueError(f"a texture's sides must be equal and a power of two, not {image.shape}")
        if not np.all(np.linalg.norm(_cross(self.corners), axis=1) > 0.0):
            raise ValueError("a triangle has no area")

    @property
    def corners(self) -> NDArray[np.float64]:
        """(t, 3, 3) float64: the three corners of each triangle, metres."""
        corners: NDArray[np.float64] = self.vertices[self.faces]
        return corners

    @property
    def normals(self) -> NDArray[np.float64]:
        """(t, 3) float64: unit normals of the triangles."""
        cross = _cross(self.corners)
        unit: NDArray[np.float64] = cross / np.linalg.norm(cross, axis=1, keepdims=True)
        return unit


def texture_gradients(world: World) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Affine map from points to texture coordinates: ``uv = gradient @ p_world + offset`` on each triangle.

    Returns gradient (t, 2, 3), offset (t, 2). `gradient`: repeats per metre, along the triangle's plane.
    """
    first = world.corners[:, 0]
    edges = world.corners[:, 1:] - first[:, None]  # (t, 2, 3)
    steps = world.corner_uv[:, 1:] - world.corner_uv[:, :1]  # (t, 2 edges, 2 coordinates)
    gram = edges @ np.swapaxes(edges, 1, 2)
    gradient = np.swapaxes(np.swapaxes(edges, 1, 2) @ np.linalg.solve(gram, steps), 1, 2)
    offset = world.corner_uv[:, 0] - np.einsum("tij,tj->ti", gradient, first)
    return gradient, offset


def _cross(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _require_range(name: str, values: NDArray[np.int64], count: int) -> None:
    if np.any((values < 0) | (values >= count)):
        raise ValueError(f"{name} must lie in 0..{count - 1}")


@dataclass(frozen=True, slots=True, eq=False)
class Quad:
    """A rectangle or parallelogram, described as seen from its front."""

    corner: NDArray[np.float64]  # (3,) float64, upper left corner, metres, world frame
    # right, down: (3,) float64, upper and left edge from that corner, metres
    right: NDArray[np.float64]
    down: NDArray[np.float64]
    texture: int = 0  # index of the texture
    repeat_m: float = 1.0  # size of one repeat of the texture, metres
    start: tuple[float, float] = (0.0, 0.0)  # texture coordinates of the upper left corner, repeats
    blocks_light: bool = True  # whether it casts a shadow

    def dressed(self, texture: int, *, repeat_m: float, start: tuple[float, float]) -> "Quad":
        """The same rectangle with another texture."""
        return replace(self, texture=texture, repeat_m=repeat_m, start=start)

    def reversed(self) -> "Quad":
        """The same rectangle, facing the other way."""
        return replace(self, corner=self.corner + self.right, right=-self.right)

    def turned(self) -> "Quad":
        """The same rectangle with its texture rotated by 90 degrees clockwise."""
        return replace(self, corner=self.corner + self.right, right=self.down, down=-self.right)

    def pieces(self, count: int) -> "Iterator[Quad]":
        """The same rectangle with its texture, cut into `count` pieces along each side."""
        right, down = self.right / count, self.down / count
        columns, rows = (np.linalg.norm([right, down], axis=1) / self.repeat_m).tolist()
        for row in range(count):
            for column in range(count):
                start = (self.start[0] + column * columns, self.start[1] + row * rows)
                corner = self.corner + column * right + row * down
                yield replace(self, corner=corner, right=right, down=down, start=start)

    @property
    def corners(self) -> NDArray[np.float64]:
        """(4, 3) float64: corners counter-clockwise from the upper left, metres."""
        below = self.corner + self.down
        return np.stack([self.corner, below, below + self.right, self.corner + self.right])

    @property
    def corner_uv(self) -> NDArray[np.float64]:
        """(4, 2) float64: texture coordinates of the corners, repeats."""
        columns, rows = np.array([np.linalg.norm(self.right), np.linalg.norm(self.down)]) / self.repeat_m
        uv: NDArray[np.float64] = np.array([[0.0, 0.0], [0.0, rows], [columns, rows], [columns, 0.0]]) + self.start
        return uv


def box(centre: NDArray[np.float64], half_m: NDArray[np.float64], rotation: Rotation) -> Iterator[Quad]:
    """The six faces of a box, facing out. Textures of vertical faces are upright.

    Parameters
    ----------
    centre
        (3,) float64, metres, world frame.
    half_m
        (3,) float64, half of its size along its own axes.
    rotation
        From the axes of the box to those of the world.
    """
    x, y, z = np.diag(half_m)
    for outward, right, down in ((-y, x, -z), (y, -x, -z), (x, y, -z), (-x, -y, -z), (z, x, -y), (-z, x, y)):
        corner, right, down = rotation.apply([outward - right - down, 2 * right, 2 * down])
        yield Quad(centre + corner, right, down)


def assemble(quads: Sequence[Quad], textures: tuple[NDArray[np.float32], ...]) -> World:
    """Build a world from quads: each becomes two triangles.

    Parameters
    ----------
    quads
        In any order.
    textures
        As in `tracknoise.simulation.world.World`.
    """
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    faces = (4 * np.arange(len(quads))[:, None, None] + halves).reshape(-1, 3)
    uv = np.concatenate([quad.corner_uv for quad in quads])
    return World(
        vertices=np.concatenate([quad.corners for quad in quads]),
        faces=faces,
        corner_uv=uv[faces],
        texture=np.repeat([quad.texture for quad in quads], 2),
        textures=textures,
        blocks_light=np.repeat([quad.blocks_light for quad in quads], 2),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Scenery:
    """A world with notes."""

    world: World  # the world
    notes: tuple[str, ...] = ()  # things that were left out, replaced or used, one sentence each


def moved(world: World, pose: NDArray[np.float64]) -> World:
    """Move a world. Shapes: pose (4, 4)."""
    return replace(world, vertices=transform(pose, world.vertices))


def joined(worlds: Sequence[World]) -> World:
    """Merge worlds. Textures that they share are kept once."""
    textures = {id(texture): texture for world in worlds for texture in world.textures}
    index = {key: position for position, key in enumerate(textures)}
    starts = np.cumsum([0, *(len(world.vertices) for world in worlds[:-1])])
    texture_index = [np.array([index[id(texture)] for texture in world.textures], np.int64) for world in worlds]
    return World(
        vertices=np.concatenate([world.vertices for world in worlds]),
        faces=np.concatenate([world.faces + start for world, start in zip(worlds, starts, strict=True)]),
        corner_uv=np.concatenate([world.corner_uv for world in worlds]),
        texture=np.concatenate([indices[world.texture] for world, indices in zip(worlds, texture_index, strict=True)]),
        textures=tuple(textures.values()),
        blocks_light=np.concatenate([world.blocks_light for world in worlds]),
    )
