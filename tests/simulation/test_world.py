from dataclasses import replace

import numpy as np
import pytest

from tracknoise.simulation.world import World, texture_gradients


@pytest.fixture
def world() -> World:
    """A triangle on the ground and a slanted one."""
    return World(
        vertices=np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [1.0, 1.0, 4.0]]),
        faces=np.array([[0, 1, 2], [1, 2, 3]]),
        corner_uv=np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0.2, 0.1], [3.0, -1.0], [0.5, 2.0]]]),
        texture=np.array([0, 0]),
        textures=(np.zeros((2, 2), np.float32),),
        blocks_light=np.array([True, True]),
    )


def test_normals_follow_the_right_hand_rule(world: World) -> None:
    np.testing.assert_allclose(world.normals[0], [0.0, 0.0, 1.0])
    np.testing.assert_allclose(np.linalg.norm(world.normals, axis=1), 1.0)


def test_texture_gradients_give_the_corners_their_coordinates(world: World) -> None:
    gradient, offset = texture_gradients(world)
    uv = np.einsum("tij,tkj->tki", gradient, world.corners) + offset[:, None]
    np.testing.assert_allclose(uv, world.corner_uv, atol=1e-12)


def test_texture_gradients_lie_in_the_plane(world: World) -> None:
    gradient, _ = texture_gradients(world)
    np.testing.assert_allclose(np.einsum("tij,tj->ti", gradient, world.normals), 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"faces": np.array([[0, 1, 2], [1, 2, 4]])}, "faces must lie in 0..3"),
        ({"faces": np.array([[0, 1, 2], [1, 1, 3]])}, "no area"),
        ({"texture": np.array([0, 1])}, "texture must lie in 0..0"),
        ({"texture": np.array([0])}, "must agree"),
        ({"textures": (np.zeros((2, 4), np.float32),)}, "power of two, not \\(2, 4\\)"),
        ({"textures": (np.zeros((3, 3), np.float32),)}, "power of two, not \\(3, 3\\)"),
    ],
)
def test_what_does_not_fit_together_is_refused(world: World, change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(world, **change)
