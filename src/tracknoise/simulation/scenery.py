"""Worlds with what there is to say of them, moved and put together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.pose import transform
from tracknoise.simulation.world import World


@dataclass(frozen=True, slots=True, eq=False)
class Scenery:
    """A world and what there is to say of it.

    Parameters
    ----------
    world
        What is seen.
    notes
        What was left out, replaced or used, one sentence each.
    """

    world: World
    notes: tuple[str, ...] = ()


def moved(world: World, pose: NDArray[np.float64]) -> World:
    """The same world elsewhere.

    Parameters
    ----------
    world
        Any.
    pose
        (4, 4) float64, rigid, from where it is to where it shall be.
    """
    return replace(world, vertices=transform(pose, world.vertices))


def joined(worlds: Sequence[World]) -> World:
    """Several worlds as one; textures that they share are kept once.

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
