import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracknoise.geometry.cameras import Camera, distort, undistort

BARREL = Camera(640, 480, 571.0, 571.0, 319.5, 239.5, (-0.3, 0.0, 0.0, 0.0, 0.0))
FREIBURG1 = Camera(640, 480, 517.3, 516.5, 318.6, 255.3, (0.2624, -0.9531, -0.0054, 0.0026, 1.1633))
KITTI_RAW = Camera(1392, 512, 959.8, 956.9, 696.0, 224.2, (-0.3728, 0.2037, 0.0022, 0.00138, -0.0723))
PINCUSHION = Camera(640, 480, 400.0, 400.0, 319.5, 239.5, (0.4, 0.1, 0.01, -0.01, 0.1))
FOUR = Camera(640, 480, 458.7, 457.3, 367.2, 248.4, (-0.2834, 0.0740, 0.00019, 1.76e-05))
RATIONAL = Camera(
    1280, 720, 610.7, 610.5, 639.5, 366.5, (0.5213, -2.6937, 0.0008, -0.0003, 1.6139, 0.3983, -2.5153, 1.5359)
)
LENSES = pytest.mark.parametrize(
    "lens",
    [BARREL, FREIBURG1, KITTI_RAW, PINCUSHION, FOUR, RATIONAL],
    ids=["barrel", "freiburg1", "kitti", "pincushion", "four", "rational"],
)


def whole_image(camera: Camera) -> np.ndarray:
    """Every fifth pixel, and the outermost border."""
    u, v = (np.linspace(-0.5, size - 0.5, size // 5) for size in (camera.width, camera.height))
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)


@LENSES
def test_every_pixel_returns_to_itself(lens):
    uv = whole_image(lens)
    np.testing.assert_allclose(lens.project(lens.bearings(uv)), uv, rtol=0, atol=1e-12)


@LENSES
def test_opencv_projects_each_ray_to_its_pixel(lens):
    uv = whole_image(lens)
    projected, _ = cv2.projectPoints(
        lens.bearings(uv), np.zeros(3), np.zeros(3), lens.matrix, np.array(lens.distortion)
    )
    np.testing.assert_allclose(projected[:, 0], uv, rtol=0, atol=2e-12)


@LENSES
def test_every_camera_point_in_the_image_returns_to_itself(lens):
    """The other way round: a second solution, if it existed, would show as another ray."""
    xy = lens.bearings(whole_image(lens)[::2])[:, :2]
    np.testing.assert_allclose(undistort(distort(xy, lens.distortion), lens.distortion), xy, rtol=0, atol=1e-11)


def test_barrel_by_hand():
    """With k1 = -0.3 a radius r is shown at r - 0.3 r^3, which grows up to r = 1 / sqrt(0.9), to 2/3 of that."""
    coefficients, turn = BARREL.distortion, 0.9**-0.5
    xy = np.array([[0.5, 0.0], [0.0, -1.0], [0.999 * turn, 0.0], [1.001 * turn, 0.0], [0.0, 1.7]])
    expected = [[0.4625, 0.0], [0.0, -0.7], [0.999 * turn - 0.3 * (0.999 * turn) ** 3, 0.0]]
    distorted = distort(xy, coefficients)
    np.testing.assert_allclose(distorted[:3], expected, atol=1e-15)
    assert np.isnan(distorted[3:]).all()
    distorted = np.array([[0.7, 0.0], [0.0, 0.999 * turn * 2 / 3], [0.0, 1.001 * turn * 2 / 3], [np.nan, 0.0]])
    found = undistort(distorted, coefficients)
    np.testing.assert_allclose(found[0], (1.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(distort(found[1], coefficients), distorted[1], atol=1e-15)
    assert np.isnan(found[2:]).all()


def test_points_far_off_the_axis_do_not_come_back_into_the_image():
    """At 1.8 the barrel's polynomial is back at 0.05, close to the image's centre."""
    points = np.array([[1.8, 0.0, 1.0], [0.0, -3.6, 2.0], [1e200, 0.0, 1.0]])
    folded, _ = cv2.projectPoints(points[:2], np.zeros(3), np.zeros(3), BARREL.matrix, np.array(BARREL.distortion))
    assert BARREL.contains(folded[:, 0]).all()
    assert np.isnan(BARREL.project(points)).all()
    assert not BARREL.contains(BARREL.project(points)).any()


def test_with_four_coefficients_the_fifth_is_zero():
    xy = np.random.default_rng(0).uniform(-0.8, 0.8, (100, 2))
    np.testing.assert_array_equal(distort(xy, FOUR.distortion), distort(xy, (*FOUR.distortion, 0.0)))
    np.testing.assert_array_equal(distort(xy, FOUR.distortion), distort(xy, (*FOUR.distortion, 0.0, 0.0, 0.0, 0.0)))


def test_the_rational_model_by_hand():
    """With k4 = 1 alone a radius r is shown at r / (1 + r^2), which grows up to r = 1, to 1/2."""
    coefficients = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    distorted = distort(np.array([[0.5, 0.0], [0.0, -0.999], [1.001, 0.0]]), coefficients)
    np.testing.assert_allclose(distorted[:2], [[0.4, 0.0], [0.0, -0.999 / (1 + 0.999**2)]], atol=1e-15)
    assert np.isnan(distorted[2]).all()
    found = undistort(np.array([[0.4, 0.0], [0.501, 0.0]]), coefficients)
    np.testing.assert_allclose(found[0], (0.5, 0.0), atol=1e-12)
    assert np.isnan(found[1]).all()


def test_beyond_a_pole_of_the_rational_model_there_is_no_image():
    """With k4 = -1 alone the radius r / (1 - r^2) grows without limit towards r = 1."""
    distorted = distort(np.array([[0.99, 0.0], [1.01, 0.0], [3.0, 0.0]]), (0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0))
    np.testing.assert_allclose(distorted[0], (0.99 / (1 - 0.99**2), 0.0))
    assert np.isnan(distorted[1:]).all()


def test_tangential_distortion_alone_folds_as_well():
    """x + 3 p2 x^2 along the first axis turns round at x = -1 / (6 p2)."""
    distorted = distort(np.array([[-1.6, 0.0], [-1.7, 0.0], [-9.0, 0.0]]), (0.0, 0.0, 0.0, 0.1, 0.0))
    np.testing.assert_allclose(distorted[0], (-1.6 + 0.3 * 2.56, 0.0))
    assert np.isnan(distorted[1:]).all()


@given(
    st.tuples(*[st.floats(-0.4, 0.4)] * 2, *[st.floats(-0.01, 0.01)] * 2, st.floats(-0.4, 0.4)),
    st.lists(st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6)), min_size=1, max_size=5),
)
def test_whatever_has_an_image_is_found_again(coefficients, positions):
    distorted = distort(np.array(positions), coefficients)
    there = np.isfinite(distorted).all(axis=1)
    found = undistort(distorted, coefficients)
    np.testing.assert_allclose(distort(found, coefficients)[there], distorted[there], rtol=0, atol=1e-13)
    assert np.isnan(found[~there]).all()


def test_each_position_is_solved_for_itself():
    distorted = np.random.default_rng(0).uniform(-0.8, 0.8, (60, 2))
    together = undistort(distorted, BARREL.distortion)
    alone = np.concatenate([undistort(row[None], BARREL.distortion) for row in distorted])
    np.testing.assert_array_equal(together, alone)
    assert 0 < np.isnan(together[:, 0]).sum() < 30


@LENSES
def test_lenses_that_can_be_inverted(lens):
    assert lens.is_invertible
    assert lens.halved().is_invertible


@pytest.mark.parametrize(
    "changed",
    [
        {"fx": 560.0, "fy": 560.0},  # the corner lies at 0.713, beyond the largest radius shown, 0.703
        {"distortion": (0.0, 0.0, 2.0, 2.0, 0.0)},
        {"distortion": (1e308,) * 5},
        {"distortion": (1e300, -1e300, 0.0, 0.0, 1e-300)},
        {"distortion": (0.0, 0.0, 0.0, 0.0, 0.0, 1e308, 1e308, -1e308)},
        {"distortion": (float("nan"), 0.0, 0.0, 0.0, 0.0)},
        {"cx": 1e300},
        {"fx": 1e-310, "distortion": ()},
    ],
)
def test_cameras_that_cannot_be_inverted(changed):
    entries = {name: getattr(BARREL, name) for name in BARREL.__dataclass_fields__}
    assert not Camera(**(entries | changed)).is_invertible
