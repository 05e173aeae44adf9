import numpy as np
import pytest

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.shutter import RollingShutter

CAMERA = Camera(640, 480, 500.0, 500.0, 319.5, 239.5)


def test_rows_are_exposed_one_after_the_other_around_the_time_of_the_frame():
    uv = np.array([[0.0, -0.5], [100.0, 239.5], [639.0, 479.5]])
    np.testing.assert_allclose(RollingShutter(0.02).delays_s(CAMERA, uv), [-0.01, 0.0, 0.01])


def test_in_a_turned_image_time_passes_along_columns():
    uv = np.array([[-0.5, 7.0], [639.5, 8.0]])
    np.testing.assert_allclose(RollingShutter(-0.02, axis=0).delays_s(CAMERA, uv), [0.01, -0.01])


@pytest.mark.parametrize("axis", [0, 1])
def test_a_turned_shutter_exposes_each_pixel_at_the_same_time(axis):
    uv = np.array([[3.0, 40.0], [600.0, 7.5]])
    shutter = RollingShutter(0.03, axis)
    turned_uv = np.stack([uv[:, 1], CAMERA.width - 1 - uv[:, 0]], axis=-1)
    turned_s = shutter.turned().delays_s(CAMERA.turned(), turned_uv)
    np.testing.assert_allclose(turned_s, shutter.delays_s(CAMERA, uv), atol=1e-15)
    assert shutter.turned().turned().turned().turned() == shutter


def test_backward_the_last_row_comes_first():
    assert RollingShutter(0.03, axis=0).backward() == RollingShutter(-0.03, axis=0)


@pytest.mark.parametrize("values", [(26.0, 1), (float("nan"), 1), (0.02, 2)])
def test_impossible_shutters_are_refused(values):
    with pytest.raises(ValueError, match=r"expected (seconds between -1 and 1|0 or 1)"):
        RollingShutter(*values)
