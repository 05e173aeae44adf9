"""Flat rectangles with textures, from which worlds are built."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.simulation.world import World


@dataclass(frozen=True, slots=True, eq=False)
class Quad:
    """A rectangle or parallelogram, described as seen from its front.

    Parameters
    ----------
    corner
        (3,) float64, upper left corner, metres, world frame.
    right, down
        (3,) float64, upper and left edge from that corner, metres.
    texture
        Index of the texture.
    repeat_m
        Size of one repeat of the texture, metres.
    start
        Texture coordinates of the upper left corner, repeats.
    blocks_light
        Whether it casts a shadow.
    """

    corner: NDArray[np.float64]
    right: NDArray[np.float64]
    down: NDArray[np.float64]
    texture: int = 0
    repeat_m: float = 1.0
    start: tuple[float, float] = (0.0, 0.0)
    blocks_light: bool = True

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
