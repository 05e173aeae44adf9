import numpy as np
import pytest

from tracknoise.simulation.built_worlds import PLACES
from tracknoise.simulation.motion import MOTIONS


def test_every_motion_suits_a_place() -> None:
    assert {motion for place in PLACES.values() for motion in place.motions} == set(MOTIONS)


@pytest.mark.parametrize("name", PLACES)
def test_places_are_built_from_a_generator_alone(name: str) -> None:
    scenery = PLACES[name].build(np.random.default_rng(0), None)
    assert len(scenery.world.faces) > 500
    assert scenery.notes == ()


def test_ground_and_sky_are_plain_and_walls_are_not() -> None:
    """Ground and sky have the last three textures, walls the first five."""
    worlds = [PLACES[name].build(np.random.default_rng(2), None).world for name in ("objects", "objects-plain")]
    textured, plain = (np.array([np.ptp(texture) for texture in world.textures]) for world in worlds)
    assert textured.min() > 0.2
    assert plain[5:].max() == 0.0
    assert plain[:5].min() > 0.2
