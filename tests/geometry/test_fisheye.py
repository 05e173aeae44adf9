import pickle
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracknoise.geometry.cameras import (
    LENSES,
    CameraModel,
    DoubleSphereCamera,
    EquidistantCamera,
    EucmCamera,
    FovCamera,
    OmniCamera,
    coefficients_of,
    make_camera,
    model_of,
)

IDEAL = EquidistantCamera(640, 480, 300.0, 310.0, 321.25, 239.5)
TUM_VI = EquidistantCamera(512, 512, 190.98, 190.97, 254.93, 256.9, (0.0034, 0.0007, -0.0020, 0.00020))
WIDE = EquidistantCamera(800, 600, 420.0, 418.0, 390.0, 305.5, (-0.03, 0.01, -0.02, 0.004))
SPHERES = DoubleSphereCamera(512, 512, 158.28, 158.27, 254.96, 256.52, -0.172, 0.593)
FAR_SPHERES = DoubleSphereCamera(640, 480, 500.0, 501.0, 318.0, 241.0, 0.6, 0.4)
OMNI = OmniCamera(752, 480, 703.1, 704.5, 372.3, 239.8, 0.96, (-0.21, 0.04, 0.0011, -0.0007))
MIRROR = OmniCamera(640, 480, 1150.0, 1152.0, 318.0, 242.0, 2.31, (-0.12, 0.35, -0.0004, 0.0009))
EUCM = EucmCamera(640, 480, 240.0, 241.5, 318.0, 243.0, 0.61, 1.13)
NARROW_EUCM = EucmCamera(640, 480, 320.0, 322.0, 318.0, 243.0, 0.31, 0.72)
FOV = FovCamera(640, 480, 262.0, 263.0, 322.0, 238.0, 0.93)
NAMED = {
    "ideal": IDEAL, "tum_vi": TUM_VI, "wide": WIDE, "spheres": SPHERES, "far_spheres": FAR_SPHERES, "omni": OMNI,
    "mirror": MIRROR, "eucm": EUCM, "narrow_eucm": NARROW_EUCM, "fov": FOV,
}  # fmt: skip
CAMERAS = pytest.mark.parametrize("camera", NAMED.values(), ids=NAMED)


def grid(camera: CameraModel, step: float = 7.3) -> np.ndarray:
    u, v = np.meshgrid(np.arange(-0.5, camera.width, step), np.arange(-0.5, camera.height, step))
    return np.stack([u.ravel(), v.ravel()], axis=-1)


def in_front(count: int = 500) -> np.ndarray:
    """Points up to 85 degrees from the axis, at 1 cm to 100 m."""
    random = np.random.default_rng(1)
    theta, phi = np.deg2rad(random.uniform(0.0, 85.0, count)), random.uniform(0.0, 2.0 * np.pi, count)
    rays = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    return rays * 10.0 ** random.uniform(-2.0, 2.0, (count, 1))


@pytest.mark.parametrize("camera", [IDEAL, TUM_VI, WIDE])
def test_the_equidistant_model_projects_as_opencv(camera):
    points = in_front()
    expected, _ = cv2.fisheye.projectPoints(
        points[:, None], np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion)
    )
    np.testing.assert_allclose(camera.project(points), expected[:, 0], rtol=0, atol=1e-9)


def test_the_equidistant_model_by_hand():
    """At 45 degrees, with k1 = 0.1: r = pi/4 (1 + 0.1 (pi/4)^2)."""
    camera = EquidistantCamera(640, 480, 100.0, 200.0, 320.0, 240.0, (0.1, 0.0, 0.0, 0.0))
    radius = np.pi / 4 * (1 + 0.1 * (np.pi / 4) ** 2)
    uv = camera.project(np.array([[2.0, 0.0, 2.0], [0.0, -3.0, 3.0], [0.0, 0.0, 5.0]]))
    np.testing.assert_allclose(uv, [[320 + 100 * radius, 240], [320, 240 - 200 * radius], [320, 240]], atol=1e-12)


def test_double_sphere_by_hand():
    """The point (3, 0, 4) with xi = 0.2, alpha = 0.5: d1 = 5, shifted z = 5, d2 = sqrt(34)."""
    camera = DoubleSphereCamera(640, 480, 100.0, 200.0, 320.0, 240.0, 0.2, 0.5)
    below = 0.5 * np.sqrt(34.0) + 0.5 * 5.0
    uv = camera.project(np.array([[3.0, 0.0, 4.0], [0.0, 3.0, 4.0], [0.0, 0.0, 4.0]]))
    np.testing.assert_allclose(uv, [[320 + 300 / below, 240], [320, 240 + 600 / below], [320, 240]], atol=1e-12)


def test_without_its_spheres_the_double_sphere_model_is_a_pinhole():
    points = in_front(50)
    camera = DoubleSphereCamera(640, 480, 100.0, 100.0, 0.0, 0.0, 0.0, 0.0)
    expected = 100.0 * points[:, :2] / points[:, 2:]
    np.testing.assert_allclose(camera.project(points), expected, rtol=1e-12)


@pytest.mark.parametrize("camera", [OMNI, MIRROR, replace(OMNI, xi=0.0), replace(MIRROR, distortion=())])
def test_the_omnidirectional_model_projects_as_opencv(camera):
    points = in_front()
    uv = camera.project(points)
    seen = np.isfinite(uv[:, 0])
    expected, _ = cv2.omnidir.projectPoints(
        points[:, None], np.zeros(3), np.zeros(3), camera.matrix, camera.xi, np.array(camera.distortion or [0.0] * 4)
    )
    assert seen.mean() > 0.6
    np.testing.assert_allclose(uv[seen], expected.reshape(-1, 2)[seen], rtol=1e-12, atol=1e-9)


def test_the_omnidirectional_model_by_hand():
    """The point (3, 0, 4) with xi = 0.5 is at 0.6 / 1.3 of the plane; k1 = 0.1 and p2 = 0.01 move it there."""
    camera = OmniCamera(640, 480, 100.0, 200.0, 320.0, 240.0, 0.5, (0.1, 0.0, 0.0, 0.01))
    m = 0.6 / 1.3
    uv = camera.project(np.array([[3.0, 0.0, 4.0], [0.0, 3.0, 4.0], [0.0, 0.0, 4.0]]))
    radial = m * (1 + 0.1 * m * m)
    expected = [[320 + 100 * (radial + 0.03 * m * m), 240], [320 + 100 * 0.01 * m * m, 240 + 200 * radial], [320, 240]]
    np.testing.assert_allclose(uv, expected, atol=1e-12)


def test_the_enhanced_unified_model_by_hand():
    """The point (3, 0, 4) with alpha = 0.5, beta = 9 / 4: d = sqrt(81 / 4 + 16)."""
    camera = EucmCamera(640, 480, 100.0, 200.0, 320.0, 240.0, 0.5, 2.25)
    below = 0.5 * np.sqrt(20.25 + 16.0) + 0.5 * 4.0
    uv = camera.project(np.array([[3.0, 0.0, 4.0], [0.0, 3.0, 4.0], [0.0, 0.0, 4.0]]))
    np.testing.assert_allclose(uv, [[320 + 300 / below, 240], [320, 240 + 600 / below], [320, 240]], atol=1e-12)


def test_the_unified_model_is_two_models():
    """Mei's with xi and Khomutenko's with alpha = xi / (1 + xi), beta = 1 and 1 / (1 + xi) of the focal length."""
    xi, points = 0.8, in_front(100)
    mei = OmniCamera(640, 480, 540.0, 550.0, 320.0, 240.0, xi)
    unified = EucmCamera(640, 480, 540.0 / (1 + xi), 550.0 / (1 + xi), 320.0, 240.0, xi / (1 + xi), 1.0)
    np.testing.assert_allclose(mei.project(points), unified.project(points), atol=1e-9)


def test_the_field_of_view_model_by_hand():
    """With omega = pi / 2 the radius 1 / 2 is seen at atan(1) / omega = 1 / 2, and the radius infinity at 1."""
    camera = FovCamera(640, 480, 100.0, 200.0, 320.0, 240.0, np.pi / 2)
    uv = camera.project(np.array([[1.0, 0.0, 2.0], [0.0, -3.0, 6.0], [0.0, 0.0, 5.0], [1e9, 0.0, 1.0]]))
    np.testing.assert_allclose(uv, [[370, 240], [320, 140], [320, 240], [420, 240]], atol=1e-6)
    assert np.isnan(camera.bearings(np.array([420.1, 240.0]))[0])
    np.testing.assert_allclose(camera.bearings(np.array([370.0, 240.0])), [0.5, 0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize(
    "camera",
    [
        OmniCamera(640, 480, 100.0, 100.0, 0.0, 0.0, 0.0),
        EucmCamera(640, 480, 100.0, 100.0, 0.0, 0.0, 0.0, 1.3),
        FovCamera(640, 480, 100.0, 100.0, 0.0, 0.0, 0.0),
    ],
)
def test_without_their_parameter_these_models_are_pinholes(camera):
    points = in_front(50)
    np.testing.assert_allclose(camera.project(points), 100.0 * points[:, :2] / points[:, 2:], rtol=1e-12)
    np.testing.assert_allclose(camera.bearings(camera.project(points)), points / points[:, 2:], rtol=1e-9)


@CAMERAS
def test_a_camera_is_made_again_from_its_name_and_numbers(camera):
    model, coefficients = model_of(camera), coefficients_of(camera)
    assert model in LENSES
    optics = (camera.fx, camera.fy, camera.cx, camera.cy)
    assert make_camera(model, (camera.width, camera.height), optics, coefficients) == camera
    with pytest.raises(ValueError, match="distortion is"):
        make_camera(model, (camera.width, camera.height), optics, (*coefficients, 0.0, 0.0))


@CAMERAS
def test_a_pixel_with_a_ray_returns_to_itself(camera):
    uv = grid(camera)
    rays = camera.bearings(uv)
    seen = np.isfinite(rays[:, 0])
    assert seen.mean() > 0.7
    np.testing.assert_allclose(camera.project(rays)[seen], uv[seen], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(np.isnan(rays[~seen, :2]), True)


@CAMERAS
def test_a_point_in_front_is_found_along_its_ray(camera):
    points = in_front()
    uv = camera.project(points)
    imaged = np.isfinite(uv[:, 0])
    assert imaged.mean() > 0.8
    found = camera.unproject(uv[imaged], points[imaged, 2])
    np.testing.assert_allclose(found, points[imaged], rtol=1e-7, atol=1e-9)


@given(
    st.tuples(st.floats(-0.5, 511.5), st.floats(-0.5, 511.5)), st.floats(0.01, 1e5), st.sampled_from([TUM_VI, SPHERES])
)
def test_every_pixel_survives_the_round_trip_or_has_no_ray(pixel, depth_m, camera):
    uv = np.array([pixel])
    points = camera.unproject(uv, np.array([depth_m]))
    if np.isfinite(points).all():
        np.testing.assert_allclose(camera.project(points), uv, rtol=0, atol=1e-6)
    else:
        assert np.hypot(*(uv[0] - (camera.cx, camera.cy))) > 256.0


@given(st.tuples(*[st.floats(-0.5, 0.5)] * 4), st.lists(st.floats(0.0, 1.57), min_size=1, max_size=5))
def test_whatever_angle_has_an_image_is_found_again(coefficients, angles):
    camera = EquidistantCamera(640, 480, 300.0, 300.0, 320.0, 240.0, coefficients)
    points = np.stack([np.sin(angles), np.zeros(len(angles)), np.cos(angles)], axis=-1)
    uv = camera.project(points)
    there = np.isfinite(uv[:, 0])
    np.testing.assert_allclose(camera.project(camera.bearings(uv[there])), uv[there], rtol=0, atol=1e-6)


def test_the_edge_of_the_half_space_is_where_the_ideal_model_puts_it():
    """r = theta: 90 degrees lie at 300 pi / 2 = 471 px to the right; a ray at 89 degrees has a slope of tan(89)."""
    beside = 321.25 + 300.0 * np.deg2rad([89.0, 89.999, 90.001, 120.0])
    rays = IDEAL.bearings(np.stack([beside, np.full(4, 239.5)], axis=-1))
    np.testing.assert_allclose(rays[:2, 0], np.tan(np.deg2rad([89.0, 89.999])), rtol=1e-9)
    assert np.isnan(rays[2:, 0]).all()


@CAMERAS
def test_points_beside_or_behind_the_camera_have_no_image(camera):
    points = np.array([[0.0, 0.0, -1.0], [1.0, 1.0, 0.0], [0.0, 0.0, np.nan], [3.0, 0.0, -0.1], [np.inf, 0.0, 1.0]])
    assert np.isnan(camera.project(points)).any(axis=1).all()


def test_beyond_its_turning_angle_a_lens_has_no_image():
    """With k1 = -1/3 the radius theta - theta^3 / 3 grows up to theta = 1 rad, to 2/3, and not further."""
    camera = EquidistantCamera(640, 480, 300.0, 300.0, 320.0, 240.0, (-1.0 / 3.0, 0.0, 0.0, 0.0))
    angles = np.array([0.99, 1.01, 1.4])
    uv = camera.project(np.stack([np.sin(angles), np.zeros(3), np.cos(angles)], axis=-1))
    np.testing.assert_allclose(uv[0, 0], 320.0 + 300.0 * (0.99 - 0.99**3 / 3.0))
    assert np.isnan(uv[1:]).all()
    assert np.isfinite(camera.bearings(np.array([320.0 + 199.9, 240.0]))).all()
    assert np.isnan(camera.bearings(np.array([320.0 + 200.1, 240.0]))[:2]).all()


@CAMERAS
def test_it_is_a_camera_model_before_and_after_a_turn(camera):
    assert isinstance(camera, CameraModel)
    assert pickle.loads(pickle.dumps(camera)) == camera
    points = in_front(200)
    uv = camera.project(points)
    turned = camera.turned().project(points[:, [1, 0, 2]] * (1.0, -1.0, 1.0))
    np.testing.assert_allclose(turned, np.column_stack([uv[:, 1], camera.width - 1 - uv[:, 0]]), atol=1e-9)
    four_times = camera.turned().turned().turned().turned()
    np.testing.assert_allclose(four_times.project(points), uv, atol=1e-9)


@CAMERAS
def test_the_halved_camera_sees_each_point_where_the_halved_image_shows_it(camera):
    points = in_front(50)
    np.testing.assert_allclose(camera.halved().project(points), (camera.project(points) + 0.5) / 2 - 0.5, atol=1e-9)


@CAMERAS
def test_accepts_no_points(camera):
    assert camera.project(np.empty((0, 3))).shape == (0, 2)
    assert camera.unproject(np.empty((0, 2)), np.empty(0)).shape == (0, 3)
    assert camera.contains(np.empty((0, 2))).shape == (0,)


def test_each_position_is_solved_for_itself():
    uv = grid(WIDE, 31.0)
    np.testing.assert_array_equal(WIDE.bearings(uv), np.concatenate([WIDE.bearings(row[None]) for row in uv]))


def test_only_cameras_whose_whole_image_has_rays_are_invertible():
    assert WIDE.is_invertible
    assert FAR_SPHERES.is_invertible
    assert NARROW_EUCM.is_invertible
    assert FOV.is_invertible
    assert not EUCM.is_invertible
    assert not TUM_VI.is_invertible  # its corners look 109 degrees off the axis
    assert not EquidistantCamera(640, 480, 300.0, 300.0, 320.0, 240.0, (1e308, 1e308, -1e308, 0.0)).is_invertible
    assert not EquidistantCamera(640, 480, 300.0, 300.0, 320.0, 240.0, (float("nan"), 0.0, 0.0, 0.0)).is_invertible


GOOD = {"width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.0, "cy": 23.0}


@pytest.mark.parametrize(
    "wrong", [{"width": 0}, {"height": -1}, {"fx": 0.0}, {"fy": float("nan")}, {"distortion": (0.1, 0.2)}]
)
def test_impossible_equidistant_cameras_are_refused(wrong):
    with pytest.raises(ValueError, match=r"must be positive|must have 4"):
        EquidistantCamera(**(GOOD | wrong))


@pytest.mark.parametrize(
    "wrong",
    [{"fx": -1.0}, {"xi": -1.0}, {"xi": 1.1}, {"xi": float("nan")}, {"alpha": -0.1}, {"alpha": 1.1}],
)
def test_impossible_double_sphere_cameras_are_refused(wrong):
    with pytest.raises(ValueError, match=r"must be positive|xi must be|alpha must be"):
        DoubleSphereCamera(**(GOOD | {"xi": 0.1, "alpha": 0.5} | wrong))


@pytest.mark.parametrize(
    ("kind", "good", "wrong"),
    [
        (OmniCamera, {"xi": 0.9}, {"xi": -1.0}),
        (OmniCamera, {"xi": 0.9}, {"xi": float("nan")}),
        (OmniCamera, {"xi": 0.9}, {"distortion": (0.1, 0.2)}),
        (EucmCamera, {"alpha": 0.5, "beta": 1.0}, {"alpha": 1.1}),
        (EucmCamera, {"alpha": 0.5, "beta": 1.0}, {"beta": 0.0}),
        (FovCamera, {"omega": 0.9}, {"omega": 3.2}),
        (FovCamera, {"omega": 0.9}, {"omega": -0.1}),
        (FovCamera, {"omega": 0.9}, {"fy": 0.0}),
    ],
)
def test_impossible_omnidirectional_unified_and_field_of_view_cameras_are_refused(kind, good, wrong):
    assert kind(**(GOOD | good))
    with pytest.raises(ValueError, match=r"must (be|have) "):
        kind(**(GOOD | good | wrong))
