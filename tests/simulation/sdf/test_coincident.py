import numpy as np

from tracknoise.simulation.sdf_meshes import HAIR_M, set_apart

FACE = np.array([[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]])  # faces up
UP = np.array([0.0, 0.0, HAIR_M])


def test_two_sides_of_one_face_are_moved_to_their_sides() -> None:
    back = FACE[[1, 0, 2]]
    apart = set_apart(np.stack([FACE, back]))
    np.testing.assert_allclose(apart[0], FACE + UP, atol=1e-15)
    np.testing.assert_allclose(apart[1], back - UP, atol=1e-15)


def test_faces_that_share_an_edge_stay() -> None:
    both = np.stack([FACE, FACE * [-1.0, 1.0, 1.0]])
    np.testing.assert_array_equal(set_apart(both), both)
