"""Filtered texture lookup: mip pyramids with trilinear interpolation.

OpenCV's remap rounds positions to 1/32 px, which would appear as tracker error. This lookup uses exact positions.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray


class Atlas:
    """The mip pyramids of several textures in one flat array, so that one lookup can read several textures.

    Parameters
    ----------
    textures
        (side, side) float32 each, side a power of two. They repeat infinitely.
    """

    def __init__(self, textures: tuple[NDArray[np.float32], ...]) -> None:
        pyramids = [list(_pyramid(texture)) for texture in textures]
        sizes = [[level.size for level in levels] for levels in pyramids]
        ends = np.cumsum([sum(size) for size in sizes])
        self._depth = np.array([len(levels) - 1 for levels in pyramids])
        self._starts = np.zeros((len(textures), int(self._depth.max(initial=0)) + 1), np.intp)
        for starts, size, end in zip(self._starts, sizes, ends, strict=True):
            starts[: len(size)] = end - np.cumsum(size[::-1])[::-1]
        self._texels = np.concatenate([level.ravel() for levels in pyramids for level in levels])

    def side(self, texture: NDArray[np.int64]) -> NDArray[np.int64]:
        """Side of each texture, texels."""
        sides: NDArray[np.int64] = 1 << self._depth[texture]
        return sides

    def read(
        self, texture: NDArray[np.int64], s: NDArray[np.float64], t: NDArray[np.float64], footprint: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Texture values at positions, each averaged approximately over its footprint.

        Parameters
        ----------
        texture
            (n,) int64, index of the texture.
        s, t
            (n,) float64, column and row in repeats of the texture.
        footprint
            (n,) float32, width of the visible area, texels of the finest level.

        Returns
        -------
        (n,) float32
            In the unit of the textures.
        """
        coarsest = self._depth[texture]
        level = np.minimum(np.log2(np.maximum(footprint, np.float32(1.0))), coarsest.astype(np.float32))
        finer = level.astype(np.intp)
        blend = level - finer.astype(np.float32)
        column, row = _within_repeat(s), _within_repeat(t)
        fine = self._bilinear(texture, column, row, finer)
        coarse = self._bilinear(texture, column, row, np.minimum(finer + 1, coarsest))
        return _blend(fine, coarse, blend)

    def _bilinear(
        self, texture: NDArray[np.int64], s: NDArray[np.float32], t: NDArray[np.float32], level: NDArray[np.intp]
    ) -> NDArray[np.float32]:
        side_log2 = self._depth[texture] - level
        last = (1 << side_log2) - 1
        scale = (last + 1).astype(np.float32)
        column, across = _split(s, scale)
        row, down = _split(t, scale)
        start = self._starts[texture, level]
        left, right = column & last, (column + 1) & last
        upper = start + ((row & last) << side_log2)
        lower = start + (((row + 1) & last) << side_log2)
        texels = self._texels
        above = _blend(texels.take(upper + left), texels.take(upper + right), across)
        below = _blend(texels.take(lower + left), texels.take(lower + right), across)
        return _blend(above, below, down)


def _within_repeat(coordinate: NDArray[np.float64]) -> NDArray[np.float32]:
    """Coordinate within one repeat. Whole repeats are subtracted in float64, so that float32 keeps its precision."""
    return (coordinate - np.floor(coordinate)).astype(np.float32)


def _split(coordinate: NDArray[np.float32], scale: NDArray[np.float32]) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Index of the texel centre at or before a coordinate (-1 before the first), and the fraction to the next."""
    texel = coordinate * scale
    texel -= np.float32(0.5)
    index = np.floor(texel)
    return index.astype(np.intp), texel - index


def _blend(first: NDArray[np.float32], second: NDArray[np.float32], share: NDArray[np.float32]) -> NDArray[np.float32]:
    return first + share * (second - first)


def _pyramid(texture: NDArray[np.float32]) -> Iterator[NDArray[np.float32]]:
    """The texture and its means over 2x2, 4x4, ... texels, down to a single one."""
    yield texture
    while texture.shape[0] > 1:
        half = texture.shape[0] // 2
        texture = texture.reshape(half, 2, half, 2).mean(axis=(1, 3), dtype=np.float32)
        yield texture
