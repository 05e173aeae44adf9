import numpy as np
import pytest

from tracknoise.geometry.cameras import Camera
from tracknoise.simulation.built_worlds import PLACES, plaza
from tracknoise.simulation.motion import MOTIONS
from tracknoise.simulation.ray_casting import Raycaster, depth_map
from tracknoise.simulation.world import World

SEEDS = [0, 1]


@pytest.fixture(scope="module", params=SEEDS)
def world(request: pytest.FixtureRequest) -> World:
    return plaza(np.random.default_rng(request.param)).world


@pytest.fixture(scope="module")
def raycaster(world: World) -> Raycaster:
    return Raycaster(world)


def test_the_generator_decides(world: World, request: pytest.FixtureRequest) -> None:
    seed = request.node.callspec.params["world"]
    again = plaza(np.random.default_rng(seed)).world
    np.testing.assert_array_equal(again.vertices, world.vertices)
    np.testing.assert_array_equal(again.textures[0], world.textures[0])
    other = plaza(np.random.default_rng(seed + 1)).world
    assert other.vertices.shape != world.vertices.shape or np.abs(other.vertices - world.vertices).max() > 0.1


@pytest.mark.parametrize("name", PLACES["plaza"].motions)
def test_every_view_is_full_deep_and_clear_of_surfaces(raycaster: Raycaster, name: str) -> None:
    camera = Camera(40, 30, 34.6, 34.6, 19.5, 14.5)
    path = MOTIONS[name](1000, np.random.default_rng(0))
    near = []
    for pose in path[::37]:
        depth = depth_map(raycaster, camera, pose)
        assert depth.valid.all()
        near.append(np.mean(depth.depth_m < 60.0))
        assert depth.depth_m.min() > 0.7
        assert np.quantile(depth.depth_m, 0.9) > 2.0 * np.quantile(depth.depth_m, 0.1)
    assert np.mean(near) > 0.5
