import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.geometry.pose import transform
from tracknoise.sequences.kitti_files import read_camera, read_camera_from_imu, read_camera_from_velodyne

CAM = """calib_time: 09-Jan-2012 13:57:47
S_rect_02: 1.242000e+03 3.750000e+02
R_rect_00: 0 -1 0 1 0 0 0 0 1
P_rect_02: 700 0 600 45.5 0 710 170 -0.25 0 0 1 0.003
"""
VELO = "R: 0 -1 0 0 0 -1 1 0 0\nT: 0.1 -0.2 -0.3\ndelta_f: 0 0\n"
IMU = "R: 0 0 1 1 0 0 0 1 0\nT: -0.8 0.3 -0.7\n"


@pytest.fixture
def day(tmp_path):
    (tmp_path / "calib_cam_to_cam.txt").write_text(CAM)
    (tmp_path / "calib_velo_to_cam.txt").write_text(VELO)
    (tmp_path / "calib_imu_to_velo.txt").write_text(IMU)
    return tmp_path


def test_the_camera(day):
    camera = read_camera(day)
    assert (camera.width, camera.height) == (1242, 375)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (700, 710, 600, 170)
    assert camera.distortion == ()


def test_projection_is_p_rect_times_r_rect_times_velo_to_cam(day):
    """The formula of the data set's own description, in homogeneous coordinates."""
    points = np.array([[10.0, 2.0, -1.0], [25.0, -7.0, 0.5], [-2.0, 1.0, 12.0]])
    P = np.array([[700, 0, 600, 45.5], [0, 710, 170, -0.25], [0, 0, 1, 0.003]])
    rectify, velo, imu = np.eye(4), np.eye(4), np.eye(4)
    rectify[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    velo[:3] = [[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3]]
    imu[:3] = [[0, 0, 1, -0.8], [1, 0, 0, 0.3], [0, 1, 0, -0.7]]
    for read, chain in (
        (read_camera_from_velodyne, P @ rectify @ velo),
        (read_camera_from_imu, P @ rectify @ velo @ imu),
    ):
        image = np.c_[points, np.ones(3)] @ chain.T
        in_front = image[:, 2] > 0
        assert in_front.any()
        uv = read_camera(day).project(transform(read(day), points))
        np.testing.assert_allclose(uv[in_front], (image[:, :2] / image[:, 2:])[in_front], rtol=1e-12)


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("cam_to_cam", "P_rect_02", "P_rect_03", ": no P_rect_02, expected a line of P_rect_02 and 12 numbers"),
        ("cam_to_cam", "R_rect_00", "R_rect", ": no R_rect_00, expected a line of R_rect_00 and 9 numbers"),
        ("cam_to_cam", "3.75", "3x75", ":2: S_rect_02 with fields that are not numbers, expected 2 numbers"),
        ("cam_to_cam", "0.003", "", ":4: P_rect_02 of 11 numbers, expected 12"),
        (
            "cam_to_cam",
            "1.242000e+03",
            "1242.5",
            ": S_rect_02 of 1242.5 375, expected the images' width and height, px",
        ),
        (
            "cam_to_cam",
            "700 0 600",
            "700 2 600",
            ": another P_rect_02, expected fx 0 cx . 0 fy cy . 0 0 1 . with positive fx, fy",
        ),
        ("cam_to_cam", "0.003", "1e308", ": a position of nan -inf 1e+308, expected metres, up to 1e+09"),
        ("velo_to_cam", "-0.3", "nan", ":2: NaN or infinity in T, expected finite numbers"),
        ("velo_to_cam", "R: 0 -1", "R: 0 1", ": a pose with a reflection, expected a rotation"),
        ("imu_to_velo", "T:", "t:", ": no T, expected a line of T and 3 numbers"),
        (
            "imu_to_velo",
            "R: 0 0 1",
            "R: 0 0 2",
            ": a pose whose singular values differ from 1 by 1, expected a rotation (at most 0.05)",
        ),
    ],
)
def test_faults_name_file_and_key(day, file, old, new, message):
    path = day / f"calib_{file}.txt"
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(DataError) as caught:
        (read_camera(day), read_camera_from_imu(day))
    assert str(caught.value) == f"{path}{message}"


def test_a_missing_file(day):
    (day / "calib_imu_to_velo.txt").unlink()
    with pytest.raises(DataError) as caught:
        read_camera_from_imu(day)
    assert str(caught.value) == f"{day / 'calib_imu_to_velo.txt'}: no such file, expected a calibration with R, T"
