import numpy as np
from scipy.spatial.transform import Rotation

from tracknoise.simulation.world import Quad, assemble, box, texture_gradients

TEXTURES = (np.zeros((1, 1), np.float32),)


def slab() -> Quad:
    return Quad(np.array([1.0, 2.0, 3.0]), np.array([4.0, 0.0, 0.0]), np.array([0.0, 0.0, -2.0]), repeat_m=0.5)


def test_a_quad_faces_who_sees_its_corner_at_the_upper_left() -> None:
    np.testing.assert_allclose(assemble([slab()], TEXTURES).normals, [[0.0, -1.0, 0.0]] * 2)


def test_reversing_turns_the_normal() -> None:
    np.testing.assert_allclose(assemble([slab().reversed()], TEXTURES).normals, [[0.0, 1.0, 0.0]] * 2)


def test_turning_keeps_the_rectangle_and_its_front() -> None:
    turned = slab().turned()
    assert {tuple(corner) for corner in turned.corners} == {tuple(corner) for corner in slab().corners}
    np.testing.assert_allclose(assemble([turned], TEXTURES).normals, [[0.0, -1.0, 0.0]] * 2)


def test_texture_coordinates_count_repeats() -> None:
    np.testing.assert_allclose(slab().corner_uv, [[0.0, 0.0], [0.0, 4.0], [8.0, 4.0], [8.0, 0.0]])


def test_pieces_cover_the_same_rectangle_in_the_same_texture() -> None:
    whole, pieces = assemble([slab()], TEXTURES), assemble(list(slab().pieces(3)), TEXTURES)
    area = [
        0.5 * np.linalg.norm(np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]), axis=1).sum()
        for c in (whole.corners, pieces.corners)
    ]
    np.testing.assert_allclose(area[0], area[1])
    gradient, offset = texture_gradients(whole)
    np.testing.assert_allclose(pieces.corner_uv, pieces.corners @ gradient[0].T + offset[0], atol=1e-12)


def test_a_box_has_its_size_and_faces_outward() -> None:
    centre, half = np.array([1.0, -2.0, 0.5]), np.array([0.5, 1.0, 2.0])
    rotation = Rotation.from_euler("ZYX", [20.0, 30.0, -10.0], degrees=True)
    world = assemble(list(box(centre, half, rotation)), TEXTURES)
    outward = world.corners.mean(axis=1) - centre
    assert np.all(np.einsum("ti,ti->t", world.normals, outward) > 0.0)
    own = rotation.inv().apply(world.vertices - centre)
    np.testing.assert_allclose(np.abs(own), np.broadcast_to(half, own.shape), atol=1e-12)


def test_the_upright_faces_of_a_box_have_upright_textures() -> None:
    for face in list(box(np.zeros(3), np.ones(3), Rotation.identity()))[:4]:
        np.testing.assert_allclose(face.down, [0.0, 0.0, -2.0])
