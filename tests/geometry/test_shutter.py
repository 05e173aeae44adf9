import numpy as np

from tracknoise.geometry.camera import Camera
from tracknoise.geometry.shutter import RollingShutter

CAMERA = Camera(640, 480, 500.0, 500.0, 319.5, 239.5)


def test_rows_are_exposed_one_after_the_other_around_the_time_of_the_frame():
    uv = np.array([[0.0, -0.5], [100.0, 239.5], [639.0, 479.5]])
    np.testing.assert_allclose(RollingShutter(0.02).delays_s(CAMERA, uv), [-0.01, 0.0, 0.01])


def test_in_a_turned_image_time_passes_along_columns():
    uv = np.array([[-0.5, 7.0], [639.5, 8.0]])
    np.testing.assert_allclose(RollingShutter(-0.02, axis=0).delays_s(CAMERA, uv), [0.01, -0.01])
