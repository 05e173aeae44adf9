from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert, transform
from tracknoise.simulation.ray_casting import MISS, Raycaster, depth_map, surface_points
from tracknoise.simulation.world import Quad, assemble

TEXTURES = (np.ones((1, 1), np.float32),)


@pytest.fixture
def oblique() -> np.ndarray:
    """A camera with no special place or direction, which looks more or less down."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("ZYX", [30.0, 12.0, 155.0], degrees=True).as_matrix()
    pose[:3, 3] = (123.4, -56.7, 8.9)
    return pose


@pytest.fixture
def plain_ground() -> Raycaster:
    """Two huge triangles, on which Embree's own hit points are off by tenths of millimetres."""
    ground = Quad(np.array([-5000.0, 5000.0, 0.0]), np.array([1e4, 0.0, 0.0]), np.array([0.0, -1e4, 0.0]))
    return Raycaster(assemble([ground], TEXTURES))


def pixels(camera: Camera, count: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    return rng.uniform(-0.5, (camera.width - 0.5, camera.height - 0.5), (count, 2))


def test_points_lie_on_the_surface_and_in_the_pixel(camera, oblique, plain_ground) -> None:
    uv = pixels(camera, 500)
    points, hit = surface_points(plain_ground, camera, oblique, uv)
    assert hit.all()
    assert np.abs(points[:, 2]).max() < 1e-11
    assert np.abs(camera.project(transform(invert(oblique), points)) - uv).max() < 1e-9


def test_depth_is_that_of_the_plane(camera, oblique, plain_ground) -> None:
    v, u = np.indices((camera.height, camera.width), dtype=np.float64)
    down = (camera.bearings(np.stack([u, v], axis=-1)) @ oblique[:3, :3].T)[..., 2]
    depth = depth_map(plain_ground, camera, oblique)
    assert depth.valid.all()
    np.testing.assert_allclose(depth.depth_m, oblique[2, 3] / -down, rtol=1e-13)


def test_depth_is_along_the_axis_and_not_along_the_ray(camera, north, facing: Callable[..., Quad]) -> None:
    raycaster = Raycaster(assemble([facing(0.0, 0.0, width=20.0, height=20.0, distance=4.0)], TEXTURES))
    np.testing.assert_allclose(depth_map(raycaster, camera, north).depth_m, 4.0, rtol=1e-14)


def test_the_nearest_surface_is_met_and_a_miss_is_known(camera, north, facing: Callable[..., Quad]) -> None:
    far, near = (
        facing(0.0, 0.0, width=2.0, height=2.0, distance=4.0),
        facing(0.3, 0.0, width=0.6, height=9.0, distance=2.0),
    )
    depth = depth_map(Raycaster(assemble([far, near], TEXTURES)), camera, north)
    np.testing.assert_allclose(depth.depth_m[32, [40, 55]], [4.0, 2.0])
    assert not depth.valid[32, [2, 90]].any()
    assert np.all(depth.depth_m[~depth.valid] == 0.0)


def test_a_missing_ray_meets_no_triangle(plain_ground) -> None:
    found = plain_ground.first_triangle(np.array([0.0, 0.0, 1.0]), np.array([[0.0, 0.0, 1.0]], np.float32))
    assert found.tolist() == [MISS]


def test_a_surface_in_between_blocks_the_light(facing: Callable[..., Quad]) -> None:
    raycaster = Raycaster(assemble([facing(0.0, 0.0, width=1.0, height=1.0, distance=2.0)], TEXTURES))
    points = np.array([[0.0, 5.0, 0.0], [3.0, 5.0, 0.0], [0.0, 2.0, 0.0]])
    assert raycaster.lit(points, np.array([0.0, -1.0, 0.0])).tolist() == [False, True, True]


def test_a_sky_lets_the_light_through_but_is_seen(facing: Callable[..., Quad]) -> None:
    sky = replace(facing(0.0, 0.0, width=1.0, height=1.0, distance=2.0), blocks_light=False)
    block = facing(3.0, 0.0, width=1.0, height=1.0, distance=2.0)
    raycaster = Raycaster(assemble([sky, block], TEXTURES))
    points = np.array([[0.0, 5.0, 0.0], [3.0, 5.0, 0.0]])
    assert raycaster.lit(points, np.array([0.0, -1.0, 0.0])).tolist() == [True, False]
    assert raycaster.first_triangle(np.zeros(3), np.array([[0.0, 1.0, 0.0]], np.float32))[0] in (0, 1)
