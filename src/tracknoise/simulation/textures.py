"""Textures: filtered lookup in mip pyramids, and patterns from a random generator.

The lookup interpolates trilinearly at exact positions. OpenCV's remap rounds them to 1/32 px, which would appear as
tracker error.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray


class Atlas:
    """The mip pyramids of several textures in one flat array, so that one lookup can read several textures.

    Shapes: textures (side, side). All together have fewer than 2^31 texels: their indices are int32, which halves what
    a lookup moves through the processor's cache.
    """

    def __init__(self, textures: tuple[NDArray[np.float32], ...]) -> None:
        pyramids = [list(_pyramid(texture)) for texture in textures]
        self._depth = np.array([len(levels) - 1 for levels in pyramids])
        self._finest = np.cumsum([0, *(len(levels) for levels in pyramids[:-1])])  # of each texture: index of a level
        levels = [level for pyramid in pyramids for level in pyramid]
        self._sides = np.array([len(level) for level in levels], np.int32)
        self._starts = np.cumsum([0, *(level.size for level in levels[:-1])], dtype=np.int32)
        self._texels = np.concatenate([level.ravel() for level in levels])

    def side(self, texture: NDArray[np.int64]) -> NDArray[np.int64]:
        """Side of each texture, texels."""
        sides: NDArray[np.int64] = 1 << self._depth[texture]
        return sides

    def read(
        self, texture: NDArray[np.int64], s: NDArray[np.float64], t: NDArray[np.float64], footprint: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Texture values at positions, each averaged approximately over its footprint.

        Returns: in the unit of the textures. `s, t`: column and row in repeats of the texture.
        """
        coarsest, finest = self._depth[texture], self._finest[texture]
        level = np.minimum(np.log2(np.maximum(footprint, np.float32(1.0))), coarsest.astype(np.float32))
        finer = level.astype(np.intp)
        blend = level - finer.astype(np.float32)
        column, row = _within_repeat(s), _within_repeat(t)
        fine = self._bilinear(finest + finer, column, row)
        coarse = self._bilinear(finest + np.minimum(finer + 1, coarsest), column, row)
        return _blend(fine, coarse, blend)

    def _bilinear(self, level: NDArray[np.intp], s: NDArray[np.float32], t: NDArray[np.float32]) -> NDArray[np.float32]:
        side, start = self._sides.take(level), self._starts.take(level)
        scale, last = side.astype(np.float32), side - 1
        column, across = _split(s, scale)
        row, down = _split(t, scale)
        left, right = column & last, (column + 1) & last
        upper, lower = start + (row & last) * side, start + ((row + 1) & last) * side
        texels = self._texels
        above = _blend(texels.take(upper + left), texels.take(upper + right), across)
        below = _blend(texels.take(lower + left), texels.take(lower + right), across)
        return _blend(above, below, down)


def _within_repeat(coordinate: NDArray[np.float64]) -> NDArray[np.float32]:
    """Coordinate within one repeat. Whole repeats are subtracted in float64, so that float32 keeps its precision."""
    return (coordinate - np.floor(coordinate)).astype(np.float32)


def _split(
    coordinate: NDArray[np.float32], scale: NDArray[np.float32]
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Index of the texel centre at or before a coordinate (-1 before the first), and the fraction to the next."""
    texel = coordinate * scale
    texel -= np.float32(0.5)
    index = np.floor(texel)
    return index.astype(np.int32), texel - index


def _blend(first: NDArray[np.float32], second: NDArray[np.float32], share: NDArray[np.float32]) -> NDArray[np.float32]:
    return first + share * (second - first)


def _pyramid(texture: NDArray[np.float32]) -> Iterator[NDArray[np.float32]]:
    """The texture and its means over 2x2, 4x4, ... texels, down to a single one."""
    yield texture
    while texture.shape[0] > 2:
        upper, lower = texture[::2], texture[1::2]
        texture = upper[:, ::2] + upper[:, 1::2]
        texture += lower[:, ::2] + lower[:, 1::2]
        texture *= np.float32(0.25)
        yield texture
    if texture.shape[0] > 1:
        yield texture.mean(dtype=np.float32, keepdims=True)


_DARKEST, _LIGHTEST = 0.03, 0.97
_SUBTEXEL_BITS = 4
_TONES = (0.35, 0.8)
"""Reflectances of plain surfaces."""


@dataclass(frozen=True, slots=True)
class Recipe:
    """Recipe of a texture."""

    # the amplitude spectrum is frequency to the power of minus this value; 1 is typical of natural images
    exponent: float
    # mean, contrast: mean and standard deviation of the natural part, reflectance
    mean: float
    contrast: float
    shapes: int  # number of crisp shapes


MASONRY = Recipe(exponent=1.0, mean=0.5, contrast=0.13, shapes=90)
GROUND = Recipe(exponent=0.8, mean=0.45, contrast=0.14, shapes=40)
CLOUDS = Recipe(exponent=1.4, mean=0.75, contrast=0.1, shapes=0)


def plain(side: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """A texture of one random tone. Returns (side, side). Reflectance."""
    return np.full((side, side), rng.uniform(*_TONES), np.float32)


def facade(side: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """A wall of one tone with a grid of windows, whose frames and panes differ in tone.

    Returns (side, side). Reflectance.
    """
    texture = plain(side, rng)
    columns, rows = rng.integers(2, 5, 2)
    width, height, frame = side // (2 * columns), side // (2 * rows), max(side // 64, 1)
    tone = rng.uniform(*_TONES)
    for row in range(rows):
        for column in range(columns):
            top, left = side * row // rows + height // 2, side * column // columns + width // 2
            texture[top : top + height, left : left + width] = tone
            pane = texture[top + frame : top + height - frame, left + frame : left + width - frame]
            pane[:] = rng.uniform(_DARKEST, 0.5 * tone)
    return texture


def paint(recipe: Recipe, side: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Make a texture that repeats without visible seams.

    Parameters
    ----------
    recipe
        The recipe.
    side
        Texels, a power of two, at least 64.
    rng
        Random generator of everything else.

    Returns
    -------
    (side, side) float32
        Reflectance, 0.03 to 0.97.
    """
    texture = np.float32(recipe.mean) + np.float32(recipe.contrast) * _natural(side, recipe.exponent, rng)
    for _ in range(recipe.shapes):
        size = int(side * 10.0 ** rng.uniform(-1.7, -0.65))
        top, left = rng.integers(0, side - size, 2)
        patch = texture[top : top + size, left : left + size]
        opacity = _STENCILS[rng.integers(len(_STENCILS))](size, rng) * np.float32(rng.uniform(0.6, 1.0))
        patch += opacity * (np.float32(rng.uniform(_DARKEST, _LIGHTEST)) - patch)
    clipped: NDArray[np.float32] = np.clip(texture, _DARKEST, _LIGHTEST)
    return clipped


def _natural(side: int, exponent: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Periodic noise with a 1/f^exponent amplitude spectrum, mean 0, standard deviation 1."""
    spectrum = np.fft.rfft2(rng.standard_normal((side, side), dtype=np.float32))
    noise = np.fft.irfft2(spectrum * _amplitudes(side, exponent), s=(side, side))
    scaled: NDArray[np.float32] = noise / noise.std()
    return scaled


@lru_cache(maxsize=4)
def _amplitudes(side: int, exponent: float) -> NDArray[np.float32]:
    """(side, side // 2 + 1) float32: 1/f^exponent, 0 at f = 0. Textures of one recipe share it."""
    frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side)[None])
    frequency[0, 0] = np.inf
    amplitudes: NDArray[np.float32] = (frequency**-exponent).astype(np.float32)
    amplitudes.setflags(write=False)
    return amplitudes


def _polygon(size: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """A convex or star-shaped polygon of three to seven corners."""
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, rng.integers(3, 8)))
    radii = rng.uniform(0.4, 1.0, len(angles)) * size / 2
    corners = size / 2 + radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    stencil = np.zeros((size, size), np.uint8)
    cv2.fillPoly(stencil, [_subtexels(corners)], 255, cv2.LINE_AA, _SUBTEXEL_BITS)
    return _opacity(stencil)


def _glyph(size: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """A character-like figure: strokes between points of a coarse grid."""
    points = np.stack(np.meshgrid([0.2, 0.5, 0.8], [0.12, 0.38, 0.63, 0.88]), axis=-1).reshape(-1, 2) * size
    stencil = np.zeros((size, size), np.uint8)
    for _ in range(rng.integers(2, 5)):
        stroke = rng.choice(points, rng.integers(2, 4), replace=False)
        thickness = max(int(size * rng.uniform(0.06, 0.14)), 1)
        cv2.polylines(stencil, [_subtexels(stroke)], False, 255, thickness, cv2.LINE_AA, _SUBTEXEL_BITS)
    return _opacity(stencil)


def _checkers(size: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """A checkerboard with two to six squares per side."""
    index = np.arange(size) * int(rng.integers(2, 7)) // size
    return ((index[:, None] + index) % 2).astype(np.float32)


def _stripes(size: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Parallel stripes at any angle, with edges one texel wide."""
    angle, period = rng.uniform(0.0, np.pi), max(size * rng.uniform(0.1, 0.35), 4.0)
    row, column = np.indices((size, size))
    phase = (column * np.cos(angle) + row * np.sin(angle)) % period
    inside = period / 4 - np.abs(phase - period / 2)  # texels from the stripe's edge
    opacity: NDArray[np.float32] = np.clip(inside + 0.5, 0.0, 1.0).astype(np.float32)
    return opacity


_STENCILS = (_polygon, _glyph, _checkers, _stripes)


def _subtexels(points: NDArray[np.float64]) -> NDArray[np.int32]:
    return np.rint(points * (1 << _SUBTEXEL_BITS)).astype(np.int32)


def _opacity(stencil: NDArray[np.uint8]) -> NDArray[np.float32]:
    return stencil.astype(np.float32) / np.float32(255.0)
