"""A world from a seed, with surfaces at all depths from 2 m to 300 m.

A plaza with boxes lies around the origin, a street of buildings leads north from its eastern half, panels fence both
in, and a box of clouds stands far behind all. Every path of `tracknoise.simulation.motion` is clear of surfaces.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.simulation.motion import LANE_NORTH_M, LANE_X_M, ORBIT_M
from tracknoise.simulation.pattern import CLOUDS, GROUND, MASONRY, paint
from tracknoise.simulation.quad import Quad, assemble, box
from tracknoise.simulation.world import World

_TEXTURE_SIDE = 1024
_RECIPES = (MASONRY,) * 5 + (GROUND,) * 2 + (CLOUDS,)
_MASONRY, _GROUND, _CLOUDS = range(5), range(5, 7), 7

_WEST, _EAST, _SOUTH, _NORTH = -22.0, 27.0, -22.0, LANE_NORTH_M + 50.0
_TILE_M = 7.0
_FAR_M = 300.0
_ORBIT_CLEARANCE_M, _LANE_CLEARANCE_M = 1.5, 2.0
_UP = np.array([0.0, 0.0, 1.0])


def procedural_world(rng: np.random.Generator) -> World:
    """Build a world.

    Parameters
    ----------
    rng
        Decides all that differs between worlds.
    """
    textures = tuple(paint(recipe, _TEXTURE_SIDE, rng) for recipe in _RECIPES)
    quads = [*_backdrop(), *_ground(rng), *_fence(rng), *_street(rng), *_centre(rng), *_surroundings(rng)]
    return assemble(quads, textures)


def _backdrop() -> Iterator[Quad]:
    """Clouds on the inside of a large box, in pieces: a few huge triangles would spoil the search tree of the rays."""
    for face in box(np.zeros(3), np.full(3, _FAR_M), Rotation.identity()):
        sky = replace(face.reversed(), texture=_CLOUDS, repeat_m=_FAR_M, blocks_light=False)
        yield from sky.pieces(4)


def _ground(rng: np.random.Generator) -> Iterator[Quad]:
    """Slabs in a square grid, each turned at random."""
    for x in np.arange(_WEST - 14.0, _EAST + 14.0, _TILE_M):
        for y in np.arange(_SOUTH - 14.0, _NORTH + 14.0, _TILE_M):
            slab = Quad(np.array([x, y + _TILE_M, 0.0]), np.array([_TILE_M, 0.0, 0.0]), np.array([0.0, -_TILE_M, 0.0]))
            for _ in range(rng.integers(4)):
                slab = slab.turned()
            yield _dress(slab, rng, _GROUND, repeat_m=7.0)


def _fence(rng: np.random.Generator) -> Iterator[Quad]:
    """Tall panels around everything, some farther out than others."""
    corners = np.array([[_WEST, _SOUTH], [_WEST, _NORTH], [_EAST, _NORTH], [_EAST, _SOUTH]])
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length = float(np.linalg.norm(end - start))
        along = np.append((end - start) / length, 0.0)
        inward = np.cross(along, _UP)
        for begin in np.arange(0.0, length, 6.0):
            size = rng.uniform((5.5, 8.0), (7.5, 16.0))
            foot = np.append(start, 0.0) + begin * along - rng.uniform(0.0, 3.0) * inward
            panel = Quad(foot + size[1] * _UP, size[0] * along, -size[1] * _UP)
            yield _dress(panel, rng, _MASONRY, repeat_m=10.0)


def _street(rng: np.random.Generator) -> Iterator[Quad]:
    """Buildings on both sides of the lane, and crates at the kerb."""
    for side in (-1.0, 1.0):
        y = 16.0
        while y < _NORTH:
            length, depth, height = rng.uniform((4.0, 3.0, 3.0), (9.0, 5.0, 9.0))
            x = LANE_X_M + side * (rng.uniform(4.5, 6.5) + depth / 2)
            yield from _block(rng, (x, y + length / 2, height / 2), (depth, length, height), repeat_m=6.5)
            crate = rng.uniform(0.4, 1.3, 3)
            kerb = LANE_X_M + side * rng.uniform(3.0, 3.8)
            yield from _block(rng, (kerb, y, crate[2] / 2), crate, repeat_m=4.0, turn_deg=90.0)
            y += length + rng.uniform(0.5, 3.0)


def _centre(rng: np.random.Generator) -> Iterator[Quad]:
    """A heap of boxes on the plaza, and tilted ones that hang above it."""
    reach = ORBIT_M - _ORBIT_CLEARANCE_M
    for _ in range(9):
        size = rng.uniform((0.5, 0.5, 0.5), (1.4, 1.4, 2.2))
        x, y = _polar(rng.uniform(0.0, reach - 1.2), rng)
        yield from _block(rng, (x, y, size[2] / 2), size, repeat_m=4.0, turn_deg=180.0)
    for _ in range(8):
        x, y = _polar(rng.uniform(0.5, reach - 0.8), rng)
        size = rng.uniform(0.25, 0.8, 3)
        yield from _block(rng, (x, y, rng.uniform(1.2, 3.4)), size, repeat_m=3.0, turn_deg=180.0, tilt_deg=40.0)


def _surroundings(rng: np.random.Generator) -> Iterator[Quad]:
    """Boxes around the plaza, clear of the lane."""
    placed = 0
    while placed < 36:
        x, y = _polar(rng.uniform(ORBIT_M + _ORBIT_CLEARANCE_M + 1.2, 20.0), rng)
        if abs(x - LANE_X_M) > _LANE_CLEARANCE_M + 1.6:
            placed += 1
            size = rng.uniform((0.6, 0.6, 0.8), (2.2, 2.2, 5.0))
            yield from _block(rng, (x, y, size[2] / 2), size, repeat_m=5.0, turn_deg=180.0)


def _block(
    rng: np.random.Generator,
    centre: tuple[float, float, float],
    size: tuple[float, float, float] | NDArray[np.float64],
    *,
    repeat_m: float,
    turn_deg: float = 0.0,
    tilt_deg: float = 0.0,
) -> Iterator[Quad]:
    """A box of given centre and size, turned by up to so much about the vertical and tilted about level axes."""
    limits = np.array([turn_deg, tilt_deg, tilt_deg])
    rotation = Rotation.from_euler("ZYX", rng.uniform(-limits, limits), degrees=True)
    for face in box(np.array(centre), np.asarray(size) / 2, rotation):
        yield _dress(face, rng, _MASONRY, repeat_m=repeat_m)


def _dress(quad: Quad, rng: np.random.Generator, textures: range, *, repeat_m: float) -> Quad:
    """The quad with one of the textures, shifted at random."""
    return quad.dressed(int(rng.choice(textures)), repeat_m=repeat_m, start=(rng.uniform(), rng.uniform()))


def _polar(radius_m: float, rng: np.random.Generator) -> tuple[float, float]:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return radius_m * np.cos(angle), radius_m * np.sin(angle)
