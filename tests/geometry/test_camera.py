import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracknoise.geometry.cameras import Camera, CameraModel

PINHOLE = Camera(640, 480, 500.0, 510.0, 321.25, 239.5)
# Freiburg 1 of TUM RGB-D: strong distortion of a real lens.
LENS = Camera(640, 480, 517.3, 516.5, 318.6, 255.3, (0.2624, -0.9531, -0.0054, 0.0026, 1.1633))
FOUR = Camera(640, 480, 458.7, 457.3, 367.2, 248.4, (-0.2834, 0.0740, 0.00019, 1.76e-05))
RATIONAL = Camera(
    1280, 720, 610.7, 610.5, 639.5, 366.5, (0.5213, -2.6937, 0.0008, -0.0003, 1.6139, 0.3983, -2.5153, 1.5359)
)
CAMERAS = pytest.mark.parametrize(
    "camera", [PINHOLE, LENS, FOUR, RATIONAL], ids=["pinhole", "distorted", "four", "rational"]
)


def grid(camera: Camera, step: float = 20.0) -> np.ndarray:
    u, v = np.meshgrid(np.arange(-0.5, camera.width, step), np.arange(-0.5, camera.height, step))
    return np.stack([u.ravel(), v.ravel()], axis=-1)


@CAMERAS
def test_projects_as_opencv(camera):
    points = np.random.default_rng(1).uniform((-1.0, -0.8, 2.0), (1.0, 0.8, 9.0), (500, 3))
    expected, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion or (0.0,) * 5)
    )
    np.testing.assert_allclose(camera.project(points), expected[:, 0], rtol=0, atol=1e-9)


@CAMERAS
def test_unproject_and_project_return_to_the_pixel(camera):
    uv = grid(camera)
    depth = np.random.default_rng(2).uniform(0.3, 80.0, len(uv))
    points = camera.unproject(uv, depth)
    np.testing.assert_array_equal(points[:, 2], depth)
    np.testing.assert_allclose(camera.project(points), uv, rtol=0, atol=1e-9)


def test_bearings_of_a_distorted_camera_agree_with_opencv():
    uv = grid(LENS)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-15)
    expected = cv2.undistortPoints(uv[:, None], LENS.matrix, np.array(LENS.distortion), criteria=criteria)
    np.testing.assert_allclose(LENS.bearings(uv)[:, :2], expected[:, 0], rtol=0, atol=1e-9)


@CAMERAS
def test_it_is_a_camera_model_before_and_after_a_turn(camera):
    assert isinstance(camera, CameraModel)
    points = np.random.default_rng(1).uniform((-0.5, -0.4, 1.0), (0.5, 0.4, 2.0), (100, 3))
    uv = camera.project(points)
    turned = camera.turned().project(points[:, [1, 0, 2]] * (1.0, -1.0, 1.0))
    np.testing.assert_allclose(turned, np.column_stack([uv[:, 1], camera.width - 1 - uv[:, 0]]), atol=1e-9)


def test_principal_point_looks_straight_ahead():
    np.testing.assert_array_equal(PINHOLE.bearings(np.array([321.25, 239.5])), (0.0, 0.0, 1.0))
    np.testing.assert_allclose(PINHOLE.project(np.array([0.1, -0.2, 2.0])), (321.25 + 25.0, 239.5 - 51.0))


def test_points_beside_or_behind_the_camera_have_no_image():
    points = np.array([[0.0, 0.0, -1.0], [1.0, 1.0, 0.0], [0.0, 0.0, np.nan]])
    assert np.isnan(PINHOLE.project(points)).all()


@CAMERAS
def test_accepts_no_points(camera):
    assert camera.project(np.empty((0, 3))).shape == (0, 2)
    assert camera.unproject(np.empty((0, 2)), np.empty(0)).shape == (0, 3)
    assert camera.contains(np.empty((0, 2))).shape == (0,)


def test_contains_the_outermost_half_pixels():
    uv = np.array([[-0.5, -0.5], [-0.51, 0.0], [639.49, 479.49], [639.5, 0.0], [0.0, 479.5], [np.nan, 0.0]])
    assert PINHOLE.contains(uv).tolist() == [True, False, True, False, False, False]


def test_halved_camera_sees_each_point_where_the_halved_image_shows_it():
    """Averaging 2x2 pixels puts the centre of pixels 2i and 2i+1, at 2i + 0.5, on pixel i."""
    points = np.random.default_rng(3).uniform((-1.0, -0.8, 2.0), (1.0, 0.8, 9.0), (50, 3))
    halved = PINHOLE.halved()
    assert (halved.width, halved.height) == (320, 240)
    np.testing.assert_allclose(halved.project(points), (PINHOLE.project(points) + 0.5) / 2 - 0.5, atol=1e-12)


def test_halving_an_image_moves_a_blob_as_the_halved_camera_says():
    """The centroid of a blob in an image averaged 2x2, against the projection: an image that knows nothing of us."""
    camera = Camera(64, 48, 50.0, 50.0, 31.0, 23.0)
    point = np.array([0.13, -0.07, 1.0])
    u, v = camera.project(point)
    columns, rows = np.arange(64), np.arange(48)[:, None]
    image = np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / 18.0)
    small = image.reshape(24, 2, 32, 2).mean(axis=(1, 3))
    centroid = (small.sum(axis=0) @ np.arange(32) / small.sum(), small.sum(axis=1) @ np.arange(24) / small.sum())
    np.testing.assert_allclose(camera.halved().project(point), centroid, atol=1e-6)


@given(
    st.tuples(st.floats(-0.5, 639.5), st.floats(-0.5, 479.5)),
    st.floats(0.01, 1e5),
    st.sampled_from([PINHOLE, LENS, PINHOLE.halved()]),
)
def test_every_pixel_survives_the_round_trip(pixel, depth_m, camera):
    uv = np.array([pixel])
    np.testing.assert_allclose(camera.project(camera.unproject(uv, np.array([depth_m]))), uv, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "wrong", [{"width": 0}, {"height": -1}, {"fx": 0.0}, {"fy": float("nan")}, {"distortion": (0.1, 0.2)}]
)
def test_impossible_cameras_are_refused(wrong):
    good = {"width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.0, "cy": 23.0}
    with pytest.raises(ValueError, match=r"must be positive|must have 0, 4, 5 or 8"):
        Camera(**(good | wrong))
