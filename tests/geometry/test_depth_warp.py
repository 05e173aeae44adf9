import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.geometry.accuracy import DepthAccuracy
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import DepthMap, interpolate, reproject_depth
from tracknoise.geometry.pose import invert, transform

SENSOR = Camera(160, 120, 146.0, 146.0, 80.0, 60.0)
COLOUR = Camera(160, 120, 131.0, 131.0, 79.5, 59.5)


def pose(rotation_deg: tuple[float, float, float], translation_m: tuple[float, float, float]) -> np.ndarray:
    made = np.eye(4)
    made[:3, :3] = Rotation.from_euler("xyz", rotation_deg, degrees=True).as_matrix()
    made[:3, 3] = translation_m
    return made


BESIDE = pose((0.5, -0.4, 0.2), (-0.026, 0.001, 0.002))


def pixels(camera: Camera) -> np.ndarray:
    return np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=-1).reshape(-1, 2) * 1.0


def plane_depth(camera: Camera, normal: np.ndarray, distance_m: float, uv: np.ndarray) -> np.ndarray:
    """Depth at which the rays through pixels meet the plane of points with normal . point = distance."""
    return distance_m / (camera.bearings(uv) @ normal)


def plane_map(camera: Camera, normal: np.ndarray, distance_m: float) -> DepthMap:
    depth_m = plane_depth(camera, normal, distance_m, pixels(camera)).reshape(camera.height, camera.width)
    return DepthMap(depth_m, depth_m > 0)


def moved_plane(normal: np.ndarray, distance_m: float, moved: np.ndarray) -> tuple[np.ndarray, float]:
    turned = moved[:3, :3] @ normal
    return turned, distance_m + float(turned @ moved[:3, 3])


def uniform(metres: float, camera: Camera = SENSOR) -> DepthMap:
    depth_m = np.full((camera.height, camera.width), metres)
    return DepthMap(depth_m, depth_m > 0)


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (-0.3, 0.7, 0.65), (0.1, -0.6, 0.7)])
@pytest.mark.parametrize("target_from_camera", [np.eye(4), BESIDE], ids=["same place", "beside"])
def test_planes_stay_exact_at_and_between_pixels(normal, target_from_camera):
    normal = np.array(normal) / np.linalg.norm(normal)
    seen = reproject_depth(plane_map(SENSOR, normal, 1.2), SENSOR, COLOUR, target_from_camera)
    inner = pixels(COLOUR)[np.flatnonzero(seen.valid.ravel())]
    expected = plane_depth(COLOUR, *moved_plane(normal, 1.2, target_from_camera), inner)
    np.testing.assert_allclose(seen.depth_m[seen.valid], expected, rtol=1e-9)
    between = np.random.default_rng(1).uniform((40.0, 30.0), (120.0, 90.0), (500, 2))
    read = interpolate(seen, between, COLOUR, spread=0.2)
    assert read.valid.mean() > 0.95
    np.testing.assert_allclose(
        read.depth_m[read.valid],
        plane_depth(COLOUR, *moved_plane(normal, 1.2, target_from_camera), between[read.valid]),
        rtol=1e-9,
    )


def test_every_pixel_that_the_sensor_sees_has_depth():
    """A surface without discontinuities has no holes: not between triangles, and not on their outlines."""
    for camera in (COLOUR, Camera(320, 240, 300.0, 300.0, 160.0, 120.0), Camera(80, 60, 73.0, 73.0, 40.0, 30.0)):
        seen = reproject_depth(uniform(1.5), SENSOR, camera, BESIDE)
        points = camera.unproject(pixels(camera), np.full(camera.width * camera.height, 1.5))
        from_sensor = SENSOR.project(transform(invert(BESIDE), points))
        inside = np.all((from_sensor > 0.5) & (from_sensor < (SENSOR.width - 1.5, SENSOR.height - 1.5)), axis=1)
        assert inside.sum() > 1000
        assert seen.valid.ravel()[inside].all()


def test_the_same_camera_sees_the_same():
    depth_m = 1.5 + 0.2 * np.sin(pixels(SENSOR)[:, 0] / 40).reshape(120, 160)
    seen = reproject_depth(DepthMap(depth_m, depth_m > 0), SENSOR, SENSOR, np.eye(4))
    assert seen.valid.all()
    np.testing.assert_allclose(seen.depth_m, depth_m, rtol=1e-9)


def test_the_nearest_surface_wins_and_nothing_is_invented_behind_it():
    """A near square before a far wall: beside it lies a strip that the sensor does not see."""
    depth_m = np.full((120, 160), 3.0)
    depth_m[40:80, 60:100] = 1.0
    shift = np.eye(4)
    shift[0, 3] = -0.1
    seen = reproject_depth(DepthMap(depth_m, depth_m > 0), SENSOR, SENSOR, shift)
    row = seen.depth_m[60]
    moved_near, moved_far = 14.6, 14.6 / 3
    assert set(np.round(np.unique(seen.depth_m[seen.valid]), 9)) == {1.0, 3.0}
    near = np.flatnonzero(row == 1.0)
    assert (near.min(), near.max()) == (np.ceil(60 - moved_near), np.floor(99 - moved_near))
    hole = np.flatnonzero(~seen.valid[60, 20:140]) + 20
    unseen = np.arange(np.floor(99 - moved_near) + 1, np.ceil(100 - moved_far))
    np.testing.assert_array_equal(np.intersect1d(hole, unseen), unseen)


def test_holes_stay_holes_and_far_sides_are_not_joined():
    depth = uniform(2.0)
    valid = depth.valid.copy()
    valid[50:60, 70:80] = False
    seen = reproject_depth(DepthMap(depth.depth_m, valid), SENSOR, SENSOR, np.eye(4))
    np.testing.assert_array_equal(seen.valid[50:60, 70:80], False)
    assert seen.valid.sum() == valid.sum()
    assert (seen.depth_m[~seen.valid] == 0).all()


def test_points_behind_the_target_are_not_seen():
    behind = np.eye(4)
    behind[2, 3] = -2.5
    assert not reproject_depth(uniform(2.0), SENSOR, COLOUR, behind).valid.any()


def test_the_accuracy_is_kept_and_the_map_is_not_changed():
    accuracy = DepthAccuracy(0.01, 0.0)
    depth = DepthMap(np.full((120, 160), 2.0), np.ones((120, 160), bool), accuracy=accuracy)
    assert reproject_depth(depth, SENSOR, COLOUR, BESIDE).accuracy == accuracy
    assert (depth.depth_m == 2.0).all()
