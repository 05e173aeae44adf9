"""Worlds with notes: move and merge them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.pose import transform
from tracknoise.simulation.world import World


@dataclass(frozen=True, slots=True, eq=False)
class Scenery:
    """A world with notes.

    Parameters
    ----------
    world
        The world.
    notes
        Things that were left out, replaced or used, one sentence each.
    """

    world: World
    notes: tuple[str, ...] = ()


def moved(world: World, pose: NDArray[np.float64]) -> World:
    """Move a world.

    Parameters
    ----------
    world
        The world to move.
    pose
        (4, 4) float64, rigid, from the old to the new position.
    """
    return replace(world, vertices=transform(pose, world.vertices))


def joined(worlds: Sequence[World]) -> World:
    """Merge worlds. Textures that they share are kept once.

    Parameters
    ----------
    worlds
        At least one.
    """
    textures = {id(texture): texture for world in worlds for texture in world.textures}
    index = {key: position for position, key in enumerate(textures)}
    starts = np.cumsum([0, *(len(world.vertices) for world in worlds[:-1])])
    own = [np.array([index[id(texture)] for texture in world.textures], np.int64) for world in worlds]
    return World(
        vertices=np.concatenate([world.vertices for world in worlds]),
        faces=np.concatenate([world.faces + start for world, start in zip(worlds, starts, strict=True)]),
        corner_uv=np.concatenate([world.corner_uv for world in worlds]),
        texture=np.concatenate([indices[world.texture] for world, indices in zip(worlds, own, strict=True)]),
        textures=tuple(textures.values()),
        blocks_light=np.concatenate([world.blocks_light for world in worlds]),
    )
