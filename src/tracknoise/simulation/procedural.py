"""A world from a random seed, with surfaces at all depths from 2 m to 300 m.

A plaza with boxes is around the origin. A street of buildings leads north from its eastern half. Panels surround both,
and a box of clouds is far behind them. No path of `tracknoise.simulation.motion` touches a surface.
"""

from collections.abc import Iterator

import numpy as np

from tracknoise.simulation.fittings import MASONRY_TEXTURES, block, dressed, ground, paint_textures, sky
from tracknoise.simulation.motion import LANE_NORTH_M, LANE_X_M, ORBIT_M
from tracknoise.simulation.quad import Quad, assemble
from tracknoise.simulation.world import World

_WEST, _EAST, _SOUTH, _NORTH = -22.0, 27.0, -22.0, LANE_NORTH_M + 50.0
_ORBIT_CLEARANCE_M, _LANE_CLEARANCE_M = 1.5, 2.0
_UP = np.array([0.0, 0.0, 1.0])


def procedural_world(rng: np.random.Generator) -> World:
    """Build a world.

    Parameters
    ----------
    rng
        Random generator of everything that differs between worlds.
    """
    textures = paint_textures(rng)
    slabs = ground(rng, (_WEST - 14.0, _EAST + 14.0), (_SOUTH - 14.0, _NORTH + 14.0))
    quads = [*sky(), *slabs, *_fence(rng), *_street(rng), *_centre(rng), *_surroundings(rng)]
    return assemble(quads, textures)


def _fence(rng: np.random.Generator) -> Iterator[Quad]:
    """Tall panels around everything, at different distances."""
    corners = np.array([[_WEST, _SOUTH], [_WEST, _NORTH], [_EAST, _NORTH], [_EAST, _SOUTH]])
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length = float(np.linalg.norm(end - start))
        along = np.append((end - start) / length, 0.0)
        inward = np.cross(along, _UP)
        for begin in np.arange(0.0, length, 6.0):
            size = rng.uniform((5.5, 8.0), (7.5, 16.0))
            foot = np.append(start, 0.0) + begin * along - rng.uniform(0.0, 3.0) * inward
            panel = Quad(foot + size[1] * _UP, size[0] * along, -size[1] * _UP)
            yield dressed(panel, rng, MASONRY_TEXTURES, repeat_m=10.0)


def _street(rng: np.random.Generator) -> Iterator[Quad]:
    """Buildings on both sides of the lane, and crates at the kerb."""
    for side in (-1.0, 1.0):
        y = 16.0
        while y < _NORTH:
            length, depth, height = rng.uniform((4.0, 3.0, 3.0), (9.0, 5.0, 9.0))
            x = LANE_X_M + side * (rng.uniform(4.5, 6.5) + depth / 2)
            yield from block(rng, (x, y + length / 2, height / 2), (depth, length, height), repeat_m=6.5)
            crate = rng.uniform(0.4, 1.3, 3)
            kerb = LANE_X_M + side * rng.uniform(3.0, 3.8)
            yield from block(rng, (kerb, y, crate[2] / 2), crate, repeat_m=4.0, turn_deg=90.0)
            y += length + rng.uniform(0.5, 3.0)


def _centre(rng: np.random.Generator) -> Iterator[Quad]:
    """A heap of boxes on the plaza, and tilted boxes above it."""
    reach = ORBIT_M - _ORBIT_CLEARANCE_M
    for _ in range(9):
        size = rng.uniform((0.5, 0.5, 0.5), (1.4, 1.4, 2.2))
        x, y = _polar(rng.uniform(0.0, reach - 1.2), rng)
        yield from block(rng, (x, y, size[2] / 2), size, repeat_m=4.0, turn_deg=180.0)
    for _ in range(8):
        x, y = _polar(rng.uniform(0.5, reach - 0.8), rng)
        size = rng.uniform(0.25, 0.8, 3)
        yield from block(rng, (x, y, rng.uniform(1.2, 3.4)), size, repeat_m=3.0, turn_deg=180.0, tilt_deg=40.0)


def _surroundings(rng: np.random.Generator) -> Iterator[Quad]:
    """Boxes around the plaza, outside the lane."""
    placed = 0
    while placed < 36:
        x, y = _polar(rng.uniform(ORBIT_M + _ORBIT_CLEARANCE_M + 1.2, 20.0), rng)
        if abs(x - LANE_X_M) > _LANE_CLEARANCE_M + 1.6:
            placed += 1
            size = rng.uniform((0.6, 0.6, 0.8), (2.2, 2.2, 5.0))
            yield from block(rng, (x, y, size[2] / 2), size, repeat_m=5.0, turn_deg=180.0)


def _polar(radius_m: float, rng: np.random.Generator) -> tuple[float, float]:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return radius_m * np.cos(angle), radius_m * np.sin(angle)
