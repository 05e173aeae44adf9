import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Camera, EquidistantCamera
from tracknoise.geometry.pose import invert, transform
from tracknoise.geometry.projection import origins, rectify

PINHOLE = Camera(64, 48, 50.0, 50.0, 31.0, 24.5)
FISHEYE = EquidistantCamera(64, 48, 30.0, 31.0, 31.0, 24.5, (-0.01, 0.002, 0.0, 0.0))


def beside(x: float, y: float, z: float, *rotvec: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(rotvec or (0.0, 0.0, 0.0)).as_matrix()
    pose[:3, 3] = x, y, z
    return pose


def test_a_rectified_pair_stays_as_it_is():
    pair = rectify(PINHOLE, beside(0.2, 0.0, 0.0))
    np.testing.assert_allclose(pair.first_from_rectified, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(pair.second_from_rectified, np.eye(3), atol=1e-15)
    assert pair.baseline_m == pytest.approx(0.2)
    assert (pair.camera.width, pair.camera.height) == (64, 48)
    np.testing.assert_allclose(
        [pair.camera.fx, pair.camera.fy, pair.camera.cx, pair.camera.cy], [50.0, 50.0, 31.0, 24.5], atol=1e-8
    )
    u, v = np.meshgrid(np.arange(64.0), np.arange(48.0))
    np.testing.assert_allclose(origins(pair.camera, PINHOLE, np.eye(3)), np.stack([u, v], axis=-1), atol=1e-8)


@pytest.mark.parametrize(
    "first_from_second",
    [
        beside(0.2, 0.0, 0.0),
        beside(-0.3, 0.01, 0.02, 0.02, -0.03, 0.01),
        beside(0.01, 0.2, 0.0, 0.0, 0.01, -0.02),
        beside(0.11, 0.002, -0.01, 0.01, 0.05, -0.03),
    ],
    ids=["right", "left", "below", "like EuRoC"],
)
@pytest.mark.parametrize(("first", "second"), [(PINHOLE, FISHEYE), (FISHEYE, PINHOLE)])
def test_points_lie_in_one_row_and_their_disparity_gives_their_depth(first, second, first_from_second):
    """By projection with the full models: where both images show a point, it has one row and a disparity of f B / z."""
    pair = rectify(first, first_from_second)
    points = np.random.default_rng(0).uniform((-0.4, -0.3, 1.0), (0.4, 0.3, 5.0), (200, 3))
    in_second = transform(invert(first_from_second), points)
    left = pair.camera.project(points @ pair.first_from_rectified)
    right = pair.camera.project(in_second @ pair.second_from_rectified)
    np.testing.assert_allclose(left[:, 1], right[:, 1], atol=1e-9)
    depth = (points @ pair.first_from_rectified)[:, 2]
    np.testing.assert_allclose(left[:, 0] - right[:, 0], pair.camera.fx * pair.baseline_m / depth, rtol=1e-9)
    for camera, seen, rotation in (
        (first, points, pair.first_from_rectified),
        (second, in_second, pair.second_from_rectified),
    ):
        uv = pair.camera.project(seen @ rotation)
        columns, rows = np.rint(uv).astype(int).T
        inside = (columns >= 0) & (rows >= 0) & (columns < pair.camera.width) & (rows < pair.camera.height)
        off = origins(pair.camera, camera, rotation)[rows[inside], columns[inside]] - camera.project(seen)[inside]
        assert inside.mean() > 0.8
        assert np.abs(off).max() < 1.0


@pytest.mark.parametrize("first_from_second", [np.eye(4), beside(0.0, 0.0, 0.5), beside(0.1, 0.0, -0.5)])
def test_cameras_that_are_not_side_by_side_are_refused(first_from_second):
    with pytest.raises(ValueError, match="expected it beside the first"):
        rectify(PINHOLE, first_from_second)
