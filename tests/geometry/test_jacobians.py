import numpy as np
import pytest

from tracknoise.geometry.cameras import Camera, CameraModel, DoubleSphereCamera, EucmCamera, FovCamera, OmniCamera
from tracknoise.geometry.projection import projection_jacobian

POINTS = np.array([[0.3, -0.2, 2.0], [-1.0, 0.5, 3.0], [0.0, 0.0, 0.7]])


def test_a_pinhole_has_the_derivatives_of_the_textbook() -> None:
    camera = Camera(640, 480, 500.0, 510.0, 319.5, 239.5)
    x, y, z = POINTS.T
    zero = np.zeros_like(x)
    expected = np.array([[500.0 / z, zero, -500.0 * x / z**2], [zero, 510.0 / z, -510.0 * y / z**2]]).transpose(2, 0, 1)
    np.testing.assert_allclose(projection_jacobian(camera, POINTS), expected, rtol=1e-8, atol=1e-7)


@pytest.mark.parametrize(
    "camera",
    [
        Camera(640, 480, 500.0, 510.0, 319.5, 239.5, (-0.3, 0.1, 0.001, -0.002)),
        DoubleSphereCamera(640, 480, 300.0, 300.0, 319.5, 239.5, -0.2, 0.6),
        OmniCamera(640, 480, 700.0, 705.0, 319.5, 239.5, 1.2, (-0.2, 0.05, 0.001, -0.002)),
        EucmCamera(640, 480, 300.0, 305.0, 319.5, 239.5, 0.6, 1.1),
        FovCamera(640, 480, 260.0, 265.0, 319.5, 239.5, 0.93),
    ],
)
def test_small_moves_of_points_move_pixels_as_the_derivatives_say(camera: CameraModel) -> None:
    rng = np.random.default_rng(0)
    moves = 1e-4 * rng.standard_normal(POINTS.shape)
    moved = (camera.project(POINTS + moves) - camera.project(POINTS - moves)) / 2.0
    predicted = np.einsum("nij,nj->ni", projection_jacobian(camera, POINTS), moves)
    np.testing.assert_allclose(moved, predicted, atol=1e-6)
