"""The world that is rendered: triangles with textures.

World frame: x east, y north, z up, metres. Textures hold reflectance, 0 (black) to 1 (white).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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

    Returns
    -------
    gradient : (t, 2, 3) float64
        Repeats per metre, along the triangle's plane.
    offset : (t, 2) float64
        Repeats.
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
