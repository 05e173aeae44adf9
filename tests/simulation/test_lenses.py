"""Images through lenses, against OpenCV's projection and a texture that is a formula."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tracknoise.geometry.cameras import (
    Camera,
    CameraModel,
    DoubleSphereCamera,
    EquidistantCamera,
    EucmCamera,
    FovCamera,
    OmniCamera,
)
from tracknoise.geometry.pose import invert, transform
from tracknoise.simulation.light import Lighting
from tracknoise.simulation.ray_casting import LensRays, PinholeRays, Raycaster, depth_map, surface_points
from tracknoise.simulation.render import Quality, Renderer, sample_offsets
from tracknoise.simulation.world import Quad, World, assemble

SIZE = (160, 120)
RADTAN = Camera(*SIZE, 120.0, 121.0, 78.0, 61.5, (-0.28, 0.07, 0.001, -0.002, 0.01))
FISHEYE = EquidistantCamera(*SIZE, 75.0, 76.0, 80.5, 58.5, (-0.02, 0.01, -0.01, 0.001))
SPHERES = DoubleSphereCamera(*SIZE, 70.0, 70.5, 79.0, 60.0, -0.18, 0.59)
OMNI = OmniCamera(*SIZE, 140.0, 141.0, 79.5, 60.5, 0.93, (-0.2, 0.04, 0.001, -0.001))
EUCM = EucmCamera(*SIZE, 72.0, 72.5, 79.5, 60.5, 0.58, 1.08)
FOV = FovCamera(*SIZE, 75.0, 76.0, 79.5, 60.5, 0.93)
LENSES = pytest.mark.parametrize(
    "camera",
    [RADTAN, FISHEYE, SPHERES, OMNI, EUCM, FOV],
    ids=["radtan", "equidistant", "double_sphere", "omni", "eucm", "fov"],
)
WALL_M = 2.0


def opencv(camera: CameraModel, points: np.ndarray) -> np.ndarray:
    """Positions of points without any of our code; models that OpenCV lacks are those of their papers, written out."""
    none = np.zeros(3)
    if isinstance(camera, Camera):
        return cv2.projectPoints(points, none, none, camera.matrix, np.array(camera.distortion))[0][:, 0]
    if isinstance(camera, EquidistantCamera):
        return cv2.fisheye.projectPoints(points[:, None], none, none, camera.matrix, np.array(camera.distortion))[0][
            :, 0
        ]
    if isinstance(camera, OmniCamera):
        distortion = np.array(camera.distortion)
        found, _ = cv2.omnidir.projectPoints(points[:, None], none, none, camera.matrix, camera.xi, distortion)
        return found.reshape(-1, 2)
    x, y, z = points.T
    if isinstance(camera, EucmCamera):
        below = camera.alpha * np.sqrt(camera.beta * (x * x + y * y) + z * z) + (1 - camera.alpha) * z
        return np.stack([camera.fx * x / below + camera.cx, camera.fy * y / below + camera.cy], axis=-1)
    if isinstance(camera, FovCamera):
        ru = np.sqrt(x * x + y * y) / z
        rd = np.arctan(2 * ru * np.tan(camera.omega / 2)) / camera.omega
        return np.stack([camera.fx * x / z * rd / ru + camera.cx, camera.fy * y / z * rd / ru + camera.cy], axis=-1)
    d1 = np.sqrt(x * x + y * y + z * z)
    d2 = np.sqrt(x * x + y * y + (camera.xi * d1 + z) ** 2)
    below = camera.alpha * d2 + (1 - camera.alpha) * (camera.xi * d1 + z)
    return np.stack([camera.fx * x / below + camera.cx, camera.fy * y / below + camera.cy], axis=-1)


def grey(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Reflectance of the wall: waves of 1 m."""
    return 0.5 + 0.2 * np.sin(2 * np.pi * x) + 0.2 * np.sin(2 * np.pi * z + 1.0)


@pytest.fixture
def wavy() -> World:
    """A wall of 40 m, at y = 2 m, whose texture repeats every metre; its texel (row, column) is at (-row, column)."""
    side = 256
    centres = (np.arange(side) + 0.5) / side
    texture = grey(centres[None], -centres[:, None]).astype(np.float32)
    wall = Quad(np.array([-20.0, WALL_M, 20.0]), np.array([40.0, 0.0, 0.0]), np.array([0.0, 0.0, -40.0]))
    return assemble([wall.dressed(0, repeat_m=1.0, start=(0.0, 0.0))], (texture,))


def image_of(world: World, camera: CameraModel, pose: np.ndarray, supersampling: int = 2) -> np.ndarray:
    light, quality = Lighting(ambient=1.0, lamps=()), Quality(supersampling=supersampling)
    return Renderer(world, Raycaster(world), camera=camera, lighting=light, quality=quality).image(pose)


@LENSES
def test_the_image_shows_the_texture_where_opencv_projects_it(camera, wavy, north) -> None:
    """Points within 50 degrees of the axis, where the waves are wide in the image."""
    places = np.random.default_rng(0).uniform(-1.4, 1.4, (3000, 2))
    places = places[np.hypot(*places.T) < np.tan(np.deg2rad(50.0)) * WALL_M]
    points = np.column_stack([places[:, 0], np.full(len(places), WALL_M), places[:, 1]])
    uv = opencv(camera, transform(invert(north), points))
    inside = np.all((uv > 3.0) & (uv < np.array(SIZE) - 4.0), axis=1)
    assert inside.sum() > 1000
    image = image_of(wavy, camera, north)
    shown = cv2.remap(image, *uv[inside].astype(np.float32).T[..., None], cv2.INTER_CUBIC)[:, 0]
    expected = grey(places[inside, 0], places[inside, 1])
    assert np.median(np.abs(shown - expected)) < 0.002
    shifted = cv2.remap(image, *(uv[inside] + 0.5).astype(np.float32).T[..., None], cv2.INTER_CUBIC)[:, 0]
    assert np.median(np.abs(shifted - expected)) > 0.006


@LENSES
def test_depth_and_surface_lie_on_the_wall(camera, wavy, north) -> None:
    caster = Raycaster(wavy)
    depth = depth_map(caster, camera, north)
    np.testing.assert_allclose(depth.depth_m[depth.valid], WALL_M, rtol=1e-9)
    uv = np.random.default_rng(1).uniform(0.0, np.array(SIZE) - 1.0, (500, 2))
    points, hit = surface_points(caster, camera, north, uv)
    assert hit.mean() > 0.9
    np.testing.assert_allclose(opencv(camera, transform(invert(north), points[hit])), uv[hit], atol=1e-7)


def test_pixels_without_a_ray_are_black_and_have_no_depth(wavy, north) -> None:
    camera = replace(FISHEYE, fx=40.0, fy=40.0, distortion=(0.0, 0.0, 0.0, 0.0))
    v, u = np.indices((120, 160))
    radius = np.hypot(u - camera.cx, v - camera.cy) / 40.0
    image, depth = image_of(wavy, camera, north), depth_map(Raycaster(wavy), camera, north)
    points, hit = surface_points(Raycaster(wavy), camera, north, np.array([[0.0, 0.0], [80.0, 60.0]]))
    assert np.all(image[radius > np.pi / 2 + 0.05] == 0.0)
    assert np.all(image[radius < np.pi / 2 - 0.05] > 0.05)
    assert not depth.valid[radius > np.pi / 2].any()
    assert hit.tolist() == [False, True]
    np.testing.assert_array_equal(points[0], north[:3, 3])


def test_without_distortion_both_kinds_of_rays_are_the_same() -> None:
    camera, offsets = Camera(16, 12, 20.0, 21.0, 7.4, 5.6), sample_offsets(3)
    fast, general = PinholeRays(camera, offsets).rows(2, 5), LensRays(camera, offsets).rows(2, 5)
    assert general.shape == fast.shape == (3, 9, 16)
    np.testing.assert_allclose(general.x - fast.x, 0.0, atol=1e-14)
    np.testing.assert_allclose(general.y - fast.y, 0.0, atol=1e-14)
    for step, expected in zip((*general.right, *general.down), (*fast.right, *fast.down), strict=True):
        np.testing.assert_allclose(step, expected, atol=1e-14)
    assert not general.blind.any()


@LENSES
def test_fine_texture_is_blurred_as_much_as_the_lens_shrinks_it(camera, north, facing: Callable[..., Quad]) -> None:
    """Noise that is finer than a pixel at the sides: few rays, each blurred, show almost what many rays show."""
    noise = np.random.default_rng(0).uniform(0.0, 1.0, (256, 256)).astype(np.float32)
    wall = facing(0.0, 0.0, width=80.0, height=80.0, distance=WALL_M)
    world = assemble([wall.dressed(0, repeat_m=8.0, start=(0.0, 0.0))], (noise,))
    few, many = (image_of(world, camera, north, supersampling=count) for count in (2, 8))
    error = np.sqrt(np.mean((few - many) ** 2, axis=0))
    assert many[:, 5:20].std() > 0.09
    assert error[5:20].mean() < 0.045  # 0.049 through the fisheye if nothing is blurred
    assert error[70:90].mean() < 0.01
