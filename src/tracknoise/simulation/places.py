"""Worlds by name, and the motions that do not collide with their objects."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from tracknoise.simulation.objects import objects_world, plain_world
from tracknoise.simulation.procedural import procedural_world
from tracknoise.simulation.scenery import Scenery


@dataclass(frozen=True, slots=True)
class Place:
    """A kind of world.

    Parameters
    ----------
    build
        Builds a world from a random generator and, if `takes_models`, a folder of models or None.
    motions
        Names in `tracknoise.simulation.motion.MOTIONS` of paths without collisions.
    takes_models
        Whether it can contain Gazebo models.
    """

    build: Callable[[np.random.Generator, Path | None], Scenery]
    motions: tuple[str, ...]
    takes_models: bool


def _plaza(rng: np.random.Generator, models: Path | None) -> Scenery:
    return Scenery(procedural_world(rng))


_PAST_OBJECTS = ("sideways", "sideways-left", "linear", "linear-straight", "arvr")

PLACES: Mapping[str, Place] = MappingProxyType(
    {
        "plaza": Place(_plaza, ("sideways", "sideways-left", "fixating", "forward", "arvr"), takes_models=False),
        "objects": Place(objects_world, _PAST_OBJECTS, takes_models=True),
        "objects-plain": Place(plain_world, _PAST_OBJECTS, takes_models=True),
    }
)
"""Kinds of worlds by name."""
