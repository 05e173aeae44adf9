import numpy as np

from tracknoise.geometry.cameras import Camera
from tracknoise.sequences.kitti_writer import CAMERA_FROM_VELODYNE, lidar_sweep

CAMERA = Camera(1242, 375, 721.5, 721.5, 609.6, 172.9)


def test_a_turn_is_as_dense_as_the_real_one():
    """KITTI's scans cover 3.5 to 4 % of the image, whose upper part no laser reaches."""
    uv = lidar_sweep(CAMERA, CAMERA_FROM_VELODYNE, np.random.default_rng(0))
    assert CAMERA.contains(uv).all()
    pixels = np.unique(np.floor(uv + 0.5), axis=0)
    assert 0.03 < len(pixels) / (1242 * 375) < 0.06


def test_rings_are_a_third_or_half_of_a_degree_apart():
    """Seen by a level camera, in the column in which it looks straight ahead."""
    level = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    uv = lidar_sweep(CAMERA, level, np.random.default_rng(0))
    v = uv[np.abs(uv[:, 0] - CAMERA.cx) < 1.0, 1]
    steps_deg = np.diff(np.sort(np.rad2deg(np.arctan((v - CAMERA.cy) / CAMERA.fy))))
    rings = steps_deg[steps_deg > 0.1]
    assert 40 < len(rings) < 50
    assert np.all((np.abs(rings - 1 / 3) < 0.01) | (np.abs(rings - 0.5) < 0.01))


def test_no_two_turns_are_alike_but_those_of_one_seed():
    one, same, other = (lidar_sweep(CAMERA, CAMERA_FROM_VELODYNE, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert not np.isin(other[:, 0], one[:, 0]).any()
