import numpy as np

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import cloud_depth

CAMERA = Camera(8, 6, 10.0, 20.0, 3.0, 2.0)


def at(u: float, v: float, depth_m: float) -> tuple[float, float, float]:
    return ((u - 3.0) / 10.0 * depth_m, (v - 2.0) / 20.0 * depth_m, depth_m)


def depth_of(*points: tuple[float, float, float]):
    return cloud_depth(CAMERA, np.array(points).reshape(-1, 3), nearest_m=0.5, radius_px=1.5)


def test_points_go_to_the_pixel_that_they_are_projected_into():
    depth = depth_of(at(1.4, 2.4, 3.0), at(4.6, 3.6, 5.0), at(-0.4, -0.4, 2.0), at(7.4, 5.4, 7.0))
    assert depth.radius_px == 1.5
    assert depth.depth_m.shape == (6, 8)
    np.testing.assert_array_equal(np.argwhere(depth.valid), [(0, 0), (2, 1), (4, 5), (5, 7)])
    np.testing.assert_allclose(depth.depth_m[depth.valid], (2.0, 3.0, 5.0, 7.0))


def test_the_nearest_wins_in_whatever_order():
    for order in ([0, 1, 2], [2, 1, 0], [1, 0, 2]):
        points = [at(1.0, 1.0, 9.0), at(1.2, 0.8, 4.0), at(0.8, 1.1, 6.0)]
        depth = depth_of(*(points[index] for index in order))
        assert depth.valid.sum() == 1
        np.testing.assert_allclose(depth.depth_m[1, 1], 4.0)


def test_what_is_outside_behind_or_too_near_is_left_out():
    outside = [at(-0.6, 2.0, 3.0), at(7.6, 2.0, 3.0), at(2.0, -0.6, 3.0), at(2.0, 5.6, 3.0)]
    depth = depth_of(*outside, (0.0, 0.0, -4.0), (0.0, 0.0, 0.0), at(3.0, 2.0, 0.49))
    assert not depth.valid.any()
    assert depth_of(at(3.0, 2.0, 0.51)).valid.sum() == 1
    assert not depth_of().valid.any()
