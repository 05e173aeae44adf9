"""Parts of procedural worlds: textured boxes, ground and sky."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.simulation.pattern import CLOUDS, GROUND, MASONRY, facade, paint, plain
from tracknoise.simulation.quad import Quad, box

_TEXTURE_SIDE = 1024
_RECIPES = (MASONRY,) * 5 + (GROUND,) * 2 + (CLOUDS,)
MASONRY_TEXTURES, _GROUND_TEXTURES, _CLOUDS_TEXTURE = range(5), range(5, 7), 7

_TILE_M = 7.0
_FAR_M = 300.0


def paint_textures(rng: np.random.Generator) -> tuple[NDArray[np.float32], ...]:
    """Textures that the other functions use, by index."""
    return tuple(paint(recipe, _TEXTURE_SIDE, rng) for recipe in _RECIPES)


def paint_plain_textures(rng: np.random.Generator) -> tuple[NDArray[np.float32], ...]:
    """Textures of the same places: walls with windows, plain ground and plain sky."""
    walls = [facade(_TEXTURE_SIDE, rng) for _ in MASONRY_TEXTURES]
    return (*walls, *(plain(_TEXTURE_SIDE, rng) for _ in (*_GROUND_TEXTURES, _CLOUDS_TEXTURE)))


def sky() -> Iterator[Quad]:
    """Clouds on the inside of a large box, in pieces: a few huge triangles would slow down ray casting."""
    for face in box(np.zeros(3), np.full(3, _FAR_M), Rotation.identity()):
        clouds = replace(face.reversed(), texture=_CLOUDS_TEXTURE, repeat_m=_FAR_M, blocks_light=False)
        yield from clouds.pieces(4)


def ground(rng: np.random.Generator, x_m: tuple[float, float], y_m: tuple[float, float]) -> Iterator[Quad]:
    """Slabs in a square grid over at least the given ranges, each rotated at random."""
    for x in np.arange(*x_m, _TILE_M):
        for y in np.arange(*y_m, _TILE_M):
            slab = Quad(np.array([x, y + _TILE_M, 0.0]), np.array([_TILE_M, 0.0, 0.0]), np.array([0.0, -_TILE_M, 0.0]))
            for _ in range(rng.integers(4)):
                slab = slab.turned()
            yield dressed(slab, rng, _GROUND_TEXTURES, repeat_m=7.0)


def block(
    rng: np.random.Generator,
    centre: tuple[float, float, float],
    size: tuple[float, float, float] | NDArray[np.float64],
    *,
    repeat_m: float,
    turn_deg: float = 0.0,
    tilt_deg: float = 0.0,
) -> Iterator[Quad]:
    """A box of given centre and size, rotated about the vertical and tilted about the horizontal axes within limits."""
    limits = np.array([turn_deg, tilt_deg, tilt_deg])
    rotation = Rotation.from_euler("ZYX", rng.uniform(-limits, limits), degrees=True)
    for face in box(np.array(centre), np.asarray(size) / 2, rotation):
        yield dressed(face, rng, MASONRY_TEXTURES, repeat_m=repeat_m)


def dressed(quad: Quad, rng: np.random.Generator, textures: range, *, repeat_m: float) -> Quad:
    """The quad with one of the textures, at a random offset."""
    return quad.dressed(int(rng.choice(textures)), repeat_m=repeat_m, start=(rng.uniform(), rng.uniform()))
