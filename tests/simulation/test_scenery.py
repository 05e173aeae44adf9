import numpy as np

from tracknoise.simulation.world import Quad, assemble, joined, moved

LIGHT, DARK = np.full((2, 2), 0.9, np.float32), np.full((4, 4), 0.1, np.float32)


def slab(texture: int = 0) -> Quad:
    return Quad(np.zeros(3), np.array([2.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0]), texture=texture)


def test_a_moved_world_keeps_its_looks() -> None:
    pose = np.array([[0.0, -1.0, 0.0, 5.0], [1.0, 0.0, 0.0, 6.0], [0.0, 0.0, 1.0, 7.0], [0.0, 0.0, 0.0, 1.0]])
    world = assemble([slab()], (LIGHT,))
    there = moved(world, pose)
    np.testing.assert_allclose(there.corners[0], [[5, 6, 7], [6, 6, 7], [6, 8, 7]])
    np.testing.assert_array_equal(there.corner_uv, world.corner_uv)


def test_joined_worlds_keep_their_triangles_and_textures() -> None:
    first, second = assemble([slab(1)], (LIGHT, DARK)), assemble([slab(), slab(1)], (DARK, LIGHT))
    both = joined([first, second])
    np.testing.assert_array_equal(both.corners, np.concatenate([first.corners, second.corners]))
    worn = [float(both.textures[index][0, 0]) for index in both.texture]
    np.testing.assert_allclose(worn, [0.1, 0.1, 0.1, 0.1, 0.9, 0.9])
    assert len(both.textures) == 2
