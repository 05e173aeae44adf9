import numpy as np
import pytest

from tracknoise.paper.light_stage import revolved, tabletop
from tracknoise.simulation.ray_casting import Raycaster
from tracknoise.simulation.world import World, joined, texture_gradients

PLAIN = (np.full((1, 1), 0.5, np.float32),)
FOOT = np.array([0.2, -0.1, 0.05])
CAN = np.array([[0.0, 0.12], [0.03, 0.12], [0.03, 0.0]])


def can(profile: np.ndarray = CAN) -> World:
    return revolved(profile, FOOT, texture=0, textures=PLAIN, repeat_m=0.05)


def test_a_surface_of_revolution_is_where_its_profile_says() -> None:
    raycaster = Raycaster(can())
    start = FOOT + np.array([1.0, 0.0, 0.06])
    distance, hit = raycaster.distances(start, np.array([[-1.0, 0.0, 0.0]]))
    assert hit.all()
    np.testing.assert_allclose(distance, 1.0 - 0.03, atol=1e-4)
    above = FOOT + np.array([0.01, 0.01, 1.0])
    np.testing.assert_allclose(raycaster.distances(above, np.array([[0.0, 0.0, -1.0]]))[0], 1.0 - 0.12, atol=1e-9)


def test_all_faces_look_outward() -> None:
    world = can()
    middle = FOOT + np.array([0.0, 0.0, 0.06])
    assert (np.einsum("ti,ti->t", world.normals, world.corners.mean(axis=1) - middle) > 0).all()


def test_the_texture_is_upright_and_fits_round() -> None:
    """Seen from outside, rows run down and columns to the right, and a whole number of repeats goes round."""
    world = can()
    gradient, _ = texture_gradients(world)
    side = np.abs(world.normals[:, 2]) < 0.5
    np.testing.assert_allclose(gradient[side, 1], np.broadcast_to((0, 0, -1 / 0.05), (side.sum(), 3)), atol=1e-6)
    right = np.cross(np.array([0.0, 0.0, 1.0]), world.normals[side])
    along = np.einsum("ti,ti->t", gradient[side, 0], right)
    np.testing.assert_allclose(along, round(2 * np.pi * 0.03 / 0.05) / (2 * np.pi * 0.03), rtol=1e-3)


@pytest.mark.parametrize("profile", [CAN, CAN[1:], np.array([[0.0, 0.1], [0.05, 0.0], [0.0, 0.0]])])
def test_triangles_without_area_are_left_out(profile: np.ndarray) -> None:
    assert len(can(profile).faces) > 72


def test_worlds_are_joined_face_by_face() -> None:
    one, other = can(), can(np.array([[0.02, 0.1], [0.02, 0.0]]))
    both = joined([one, other])
    np.testing.assert_array_equal(both.corners, np.concatenate([one.corners, other.corners]))
    np.testing.assert_array_equal(both.corner_uv, np.concatenate([one.corner_uv, other.corner_uv]))


def test_scenes_differ_and_come_again() -> None:
    first, again, second = (tabletop(np.random.default_rng(seed)) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first.corners, again.corners)
    assert not np.array_equal(first.vertices[:200], second.vertices[:200])


def test_things_stand_on_the_table() -> None:
    for seed in range(2):
        world = tabletop(np.random.default_rng(seed))
        assert world.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-9)
        standing = world.vertices[world.vertices[:, 2] > 0.001]
        assert np.hypot(standing[:, 0], standing[:, 1]).max() < 0.25
        assert standing[:, 2].max() < 0.2
