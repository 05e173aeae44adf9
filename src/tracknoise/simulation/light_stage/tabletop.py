"""Objects on a table, from a random seed.

World frame: x to the right and y away, as the cameras see it, z up, metres; the origin is the middle of the table.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.simulation.light_stage.revolved import revolved
from tracknoise.simulation.pattern import Recipe, paint
from tracknoise.simulation.quad import Quad, assemble, box
from tracknoise.simulation.world import World

_TEXTURE_SIDE = 1024
_CLOTH = Recipe(exponent=1.6, mean=0.45, contrast=0.1, shapes=40)
_PRINT = Recipe(exponent=1.5, mean=0.5, contrast=0.1, shapes=90)
_RECIPES = (_CLOTH, *(_PRINT,) * 6)  # smooth between its shapes, like manufactured objects
_TABLE, _COVERS = 0, range(1, 7)
_TABLE_M, _TABLE_REPEAT_M = 2.4, 0.24
_COVER_REPEAT_M = 0.15
_BOARDS, _BOTTLES, _THINGS = 2, 4, 7  # of seven things two are boxes, two are boards, and three are bottles
_RING_M = 0.095
"""Distance of the outer objects from the middle one."""


def tabletop(rng: np.random.Generator) -> World:
    """Build a scene of about 0.3 m: boxes, leaning boards and bottles on a table that fills the view.

    Parameters
    ----------
    rng
        Random generator of everything that differs between scenes.
    """
    textures = tuple(paint(recipe, _TEXTURE_SIDE, rng) for recipe in _RECIPES)
    quads: list[Quad] = list(_table(rng))
    bottles: list[World] = []
    for thing, (x, y) in zip(rng.permutation(_THINGS), _places(rng), strict=True):
        if thing < _BOARDS:
            quads += _box(rng, x, y)
        elif thing < _BOTTLES:
            quads += _board(rng, x, y)
        else:
            bottles.append(_bottle(rng, x, y, textures))
    return joined([assemble(quads, textures), *bottles])


def joined(worlds: list[World]) -> World:
    """Merge worlds that have the same textures."""
    ends = np.cumsum([len(world.vertices) for world in worlds])
    return World(
        vertices=np.concatenate([world.vertices for world in worlds]),
        faces=np.concatenate(
            [world.faces + end - len(world.vertices) for world, end in zip(worlds, ends, strict=True)]
        ),
        corner_uv=np.concatenate([world.corner_uv for world in worlds]),
        texture=np.concatenate([world.texture for world in worlds]),
        textures=worlds[0].textures,
        blocks_light=np.concatenate([world.blocks_light for world in worlds]),
    )


def _places(rng: np.random.Generator) -> Iterator[tuple[float, float]]:
    """One in the middle, six around it."""
    yield float(rng.uniform(-0.015, 0.015)), float(rng.uniform(-0.015, 0.015))
    start = rng.uniform(0.0, 2.0 * np.pi)
    for sixth in range(6):
        angle = start + np.deg2rad(60.0 * sixth + rng.uniform(-10.0, 10.0))
        radius = _RING_M * rng.uniform(0.9, 1.2)
        yield radius * np.cos(angle), radius * np.sin(angle)


def _table(rng: np.random.Generator) -> Iterator[Quad]:
    half = _TABLE_M / 2.0
    top = Quad(np.array([-half, half, 0.0]), np.array([_TABLE_M, 0.0, 0.0]), np.array([0.0, -_TABLE_M, 0.0]))
    dressed = top.dressed(_TABLE, repeat_m=_TABLE_REPEAT_M, start=(rng.uniform(), rng.uniform()))
    yield from dressed.pieces(6)


def _box(rng: np.random.Generator, x: float, y: float) -> Iterator[Quad]:
    half = rng.uniform((0.02, 0.02, 0.02), (0.04, 0.04, 0.06))
    turn = Rotation.from_euler("z", rng.uniform(0.0, 360.0), degrees=True)
    yield from _dressed(rng, np.array([x, y, half[2]]), half, turn)


def _board(rng: np.random.Generator, x: float, y: float) -> Iterator[Quad]:
    """A thin box that leans back."""
    half = rng.uniform((0.03, 0.003, 0.04), (0.05, 0.008, 0.06))
    lean = np.deg2rad(rng.uniform(20.0, 55.0))
    turn = Rotation.from_euler("ZX", [np.deg2rad(rng.uniform(-40.0, 40.0)), -lean])
    rise = half[2] * np.cos(lean) + half[1] * np.sin(lean)
    yield from _dressed(rng, np.array([x, y, rise]), half, turn)


def _dressed(
    rng: np.random.Generator, centre: NDArray[np.float64], half_m: NDArray[np.float64], turn: Rotation
) -> Iterator[Quad]:
    cover = int(rng.choice(_COVERS))
    for face in box(centre, half_m, turn):
        yield face.dressed(cover, repeat_m=_COVER_REPEAT_M, start=(rng.uniform(), rng.uniform()))


def _bottle(rng: np.random.Generator, x: float, y: float, textures: tuple[NDArray[np.float32], ...]) -> World:
    """A body with a shoulder and a neck; short and wide ones look like inverted cups."""
    radius, height, neck = rng.uniform((0.018, 0.06, 0.35), (0.035, 0.12, 0.9))
    shoulder = np.linspace(0.0, np.pi / 2, 6)
    curve = np.stack([radius * (neck + (1.0 - neck) * np.sin(shoulder)), height * (0.65 + 0.2 * np.cos(shoulder))], -1)
    top = np.array([[0.0, height], [radius * neck, height]])
    profile = np.concatenate([top, curve, [[radius, 0.0]]])
    cover = int(rng.choice(_COVERS))
    return revolved(profile, np.array([x, y, 0.0]), texture=cover, textures=textures, repeat_m=_COVER_REPEAT_M)
