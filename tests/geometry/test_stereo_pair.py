"""Two cameras beside each other: closed forms, and lenses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Camera, EquidistantCamera
from tracknoise.geometry.pose import invert, transform
from tracknoise.geometry.stereo_pair import StereoPair

PINHOLE = Camera(640, 480, 450.0, 450.0, 319.5, 239.5)
FISHEYE = EquidistantCamera(640, 480, 190.0, 190.0, 319.5, 239.5, (0.01, -0.002, 0.0, 0.0))
BESIDE = np.eye(4)
BESIDE[0, 3] = 0.12
TURNED = np.eye(4)
TURNED[:3, :3] = Rotation.from_rotvec([0.02, -0.05, 0.1]).as_matrix()
TURNED[:3, 3] = (0.1, 0.03, -0.02)
PAIRS = [
    StereoPair(PINHOLE, PINHOLE, BESIDE),
    StereoPair(PINHOLE, FISHEYE, TURNED),
    StereoPair(FISHEYE, FISHEYE, BESIDE),
]


def seen(pair: StereoPair, depth_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions of points of some depths in both cameras."""
    uv = np.random.default_rng(2).uniform((220.0, 160.0), (420.0, 320.0), (len(depth_m), 2))
    points = pair.first.unproject(uv, depth_m)
    return uv, pair.second.project(transform(invert(pair.first_from_second), points))


@pytest.mark.parametrize("pair", PAIRS)
def test_points_have_their_depth_and_no_distance_from_their_line(pair):
    depth_m = np.linspace(0.8, 20.0, 50)
    first, second = seen(pair, depth_m)
    np.testing.assert_allclose(pair.depth_m(first, second), depth_m, rtol=1e-6)
    np.testing.assert_allclose(pair.epipolar_px(first, second), 0.0, atol=1e-6)


def test_errors_across_and_along_are_those_of_a_rectified_pair():
    first, second = seen(PAIRS[0], np.full(40, 4.0))
    across, along = PAIRS[0].errors_px(first, second + np.array([0.5, 0.25]), first, second)
    np.testing.assert_allclose(across, -0.25, rtol=0.2)  # an angle times the pixels for an angle there
    np.testing.assert_allclose(along, -0.5, rtol=0.2)
    assert abs(np.mean(np.abs(along)) - 0.5) < 0.05


@pytest.mark.parametrize("pair", PAIRS)
def test_a_pixel_of_the_second_camera_is_one_across_and_along_together(pair):
    first, second = seen(pair, np.full(60, 3.0))
    for moved in ((0.3, 0.0), (0.0, 0.3)):
        size = np.hypot(*pair.errors_px(first, second + np.array(moved), first, second))
        assert np.median(size) == pytest.approx(0.3, rel=0.12)


def test_points_behind_the_cameras_have_no_depth():
    first, second = seen(PAIRS[0], np.full(5, 4.0))
    assert np.isnan(PAIRS[0].depth_m(first, second + np.array([40.0, 0.0]))).all()
