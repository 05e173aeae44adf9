"""Poses of a second camera in the first, from calibration files, against transforms that are computed by hand."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.sequences.camera_files import CameraFile, read_camera_file
from tracknoise.sequences.camera_pairs import pose_of_numbers, read_second, require_pose_numbers

# camera 1 is 0.2 m on the right of camera 0, turned by 90 degrees about z: its x is y of camera 0, its y is -x
FIRST_FROM_SECOND = np.array([[0, -1, 0, 0.2], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
# so a point (x, y, z) of camera 0 is (y, 0.2 - x, z) in camera 1
SECOND_FROM_FIRST = [[0, 1, 0, 0], [-1, 0, 0, 0.2], [0, 0, 1, 0], [0, 0, 0, 1.0]]
LENS = {"camera_model": "pinhole", "distortion_model": "radtan", "distortion_coeffs": [0.0] * 4, "resolution": [64, 48]}


def chain(tmp_path: Path, *parts: dict[str, object]) -> Path:
    cameras = {
        f"cam{index}": {"intrinsics": [50.0 + index, 50.0, 31.5, 23.5], **LENS, **part}
        for index, part in enumerate(parts)
    }
    path = tmp_path / "camchain.yaml"
    path.write_text(yaml.safe_dump(cameras))
    return path


def second_in(
    path: Path,
    name: str | None = None,
    second: str | None = None,
    *,
    file: Path | None = None,
    size: tuple[int, int] | None = None,
) -> tuple[CameraFile, np.ndarray | None]:
    first = read_camera_file(path, camera=name, size=size)
    return read_second(first, path, name, file=file, name=second, size=size, lens=None)


def test_kalibr_s_transform_maps_points_of_the_camera_before(tmp_path: Path) -> None:
    np.testing.assert_array_equal(np.linalg.inv(FIRST_FROM_SECOND), SECOND_FROM_FIRST)
    path = chain(tmp_path, {}, {"T_cn_cnm1": SECOND_FROM_FIRST})
    second, place = second_in(path)
    assert second.camera.fx == 51.0
    np.testing.assert_allclose(place, FIRST_FROM_SECOND, atol=1e-15)
    first, other = second_in(path, "cam1")
    assert first.camera.fx == 50.0
    np.testing.assert_allclose(other, SECOND_FROM_FIRST, atol=1e-15)


def test_steps_of_a_chain_are_joined(tmp_path: Path) -> None:
    aside = np.eye(4)
    aside[2, 3] = -0.5  # camera 2 is half a metre in front of camera 1
    path = chain(tmp_path, {}, {"T_cn_cnm1": SECOND_FROM_FIRST}, {"T_cn_cnm1": aside.tolist()})
    expected = FIRST_FROM_SECOND.copy()
    expected[2, 3] = 0.5
    np.testing.assert_allclose(second_in(path, second="cam2")[1], expected, atol=1e-15)
    with pytest.raises(DataError, match=r"3 cameras \(cam0, cam1, cam2\), expected the second one: .*second_camera"):
        second_in(path)
    with pytest.raises(DataError, match="cam1 as both cameras, expected another one of cam0, cam1, cam2"):
        second_in(path, "cam1", "cam1")
    with pytest.raises(UnknownNameError, match="unknown camera 'cam7'"):
        second_in(path, second="cam7")


def test_places_on_a_body(tmp_path: Path) -> None:
    body_from_first = np.array([[0, 0, 1, 0.1], [-1, 0, 0, 0.2], [0, -1, 0, 0.3], [0, 0, 0, 1.0]])
    both = [{"T_cam_imu": np.linalg.inv(body_from_first @ place).tolist()} for place in (np.eye(4), FIRST_FROM_SECOND)]
    np.testing.assert_allclose(second_in(chain(tmp_path, *both))[1], FIRST_FROM_SECOND, atol=1e-12)
    alone = chain(tmp_path, both[0])
    other = tmp_path / "sensor.yaml"
    sensor = {"intrinsics": [70.0, 70.0, 31.5, 23.5], **LENS}
    other.write_text(yaml.safe_dump({**sensor, "T_BS": (body_from_first @ FIRST_FROM_SECOND).ravel().tolist()}))
    second, place = second_in(alone, file=other)
    assert second.camera.fx == 70.0
    np.testing.assert_allclose(place, FIRST_FROM_SECOND, atol=1e-12)
    other.write_text(yaml.safe_dump(sensor))
    assert second_in(alone, file=other)[1] is None


def test_a_camera_that_is_not_related_to_the_other_has_no_place(tmp_path: Path) -> None:
    """A place on the body of one of them is none in the other."""
    assert second_in(chain(tmp_path, {}, {}))[1] is None
    assert second_in(chain(tmp_path, {}, {"T_cam_imu": SECOND_FROM_FIRST}))[1] is None


@pytest.mark.parametrize("name", ["pair.yaml", "pair.xml"])
def test_opencv_s_pair_maps_points_of_the_first_camera(tmp_path: Path, name: str) -> None:
    matrix, lens = np.array([[50.0, 0, 31.5], [0, 50.0, 23.5], [0, 0, 1]]), np.array([[-0.1, 0.02, 0.0, 0.0, 0.0]])
    storage = cv2.FileStorage(str(tmp_path / name), cv2.FILE_STORAGE_WRITE)
    for key, value in (("M1", matrix), ("D1", lens), ("M2", matrix + np.diag([1.0, 0, 0])), ("D2", lens * 2.0)):
        storage.write(key, value)
    storage.write("R", np.array(SECOND_FROM_FIRST)[:3, :3])
    storage.write("T", np.array(SECOND_FROM_FIRST)[:3, 3:])
    storage.release()
    second, place = second_in(tmp_path / name, size=(64, 48))
    assert (second.camera.fx, second.camera.distortion[0]) == (51.0, -0.2)
    np.testing.assert_allclose(place, FIRST_FROM_SECOND, atol=1e-15)
    first, other = second_in(tmp_path / name, "2", size=(64, 48))
    assert first.camera.fx == 50.0
    np.testing.assert_allclose(other, SECOND_FROM_FIRST, atol=1e-15)


def test_camera_json_may_hold_a_second_camera(tmp_path: Path) -> None:
    plain = {"width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5}
    beside = {**plain, "fx": 60.0, "model": "equidistant", "distortion": [0.01, 0.0, 0.0, 0.0]}
    path = tmp_path / "camera.json"
    path.write_text(json.dumps({**plain, "second": {**beside, "first_from_second": FIRST_FROM_SECOND.tolist()}}))
    second, place = second_in(path)
    assert (second.camera.fx, second.camera.distortion) == (60.0, (0.01, 0.0, 0.0, 0.0))
    np.testing.assert_array_equal(place, FIRST_FROM_SECOND)
    path.write_text(json.dumps({**plain, "second": beside}))
    assert second_in(path)[1] is None
    path.write_text(json.dumps({**plain, "second": {**beside, "first_from_second": [1.0]}}))
    with pytest.raises(DataError, match=r"camera.json \(second\): first_from_second = \[1.0\], expected 16 numbers"):
        second_in(path)


def test_another_number_of_cameras_is_named(tmp_path: Path) -> None:
    path = chain(tmp_path, {})
    with pytest.raises(
        DataError, match=r"camchain.yaml: one camera \(cam0\), expected two cameras, or --option second"
    ):
        second_in(path)
    plain = tmp_path / "camera.json"
    plain.write_text(json.dumps({"width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5}))
    with pytest.raises(DataError, match=r"camera.json: one camera, expected two cameras"):
        second_in(plain)
    with pytest.raises(DataError, match=r"2 cameras \(cam0, cam1\), expected the second one"):
        second_in(plain, file=chain(tmp_path, {}, {"T_cn_cnm1": SECOND_FROM_FIRST}))


def test_poses_of_options_are_checked() -> None:
    np.testing.assert_array_equal(pose_of_numbers("p", FIRST_FROM_SECOND.ravel().tolist()), FIRST_FROM_SECOND)
    with pytest.raises(DataError, match="p: a pose whose singular values differ from 1"):
        pose_of_numbers("p", [*(2.0 * FIRST_FROM_SECOND).ravel().tolist()[:12], 0.0, 0.0, 0.0, 1.0])
    require_pose_numbers("p", None)
    with pytest.raises(ValueError, match=r"p is .*expected 16 numbers"):
        require_pose_numbers("p", (1.0, 2.0))
