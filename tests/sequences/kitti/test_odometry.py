import re
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from tests.writers.kitti_odometry import BASELINES_M, CAMERA0_FROM_VELODYNE, row, write_kitti_odometry

from tracknoise.exceptions import DataError, SettingsError, TracknoiseError
from tracknoise.geometry.cameras import Camera
from tracknoise.sequences.kitti_odometry import KittiOdometry
from tracknoise.sequences.reader_registry import make_reader, open_sequence
from tracknoise.sequences.sequence import SWEPT, TRIANGULATED
from tracknoise.sequences.simulated import Simulated

INTRINSICS = (60.0, 61.0, 31.0, 24.0)


def images(count):
    return list(np.random.default_rng(0).integers(0, 256, (count, 48, 64), dtype=np.uint8))


def poses(count):
    made = np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
    made[:, :3, :3] = Rotation.from_rotvec(np.outer(np.arange(count), (0.0, 0.1, 0.0))).as_matrix()
    made[:, 2, 3] = np.arange(count) * 1.2
    return made


@pytest.fixture
def course(tmp_path: Path) -> Path:
    return write_kitti_odometry(tmp_path, images(4), poses(4), intrinsics=INTRINSICS)


def test_a_simulated_recording_is_read_as_it_was_made(tmp_path):
    source = Simulated(motions=("forward",), frames=5, width=96, height=64, supersampling=1)
    sequence = source.open(source.sequences()[0])
    camera = sequence.camera
    shown = [sequence.image(index) for index in range(5)]
    intrinsics = (camera.fx, camera.fy, camera.cx, camera.cy)
    write_kitti_odometry(tmp_path, shown, sequence.world_from_camera, intrinsics=intrinsics)
    read = open_sequence("kitti-odometry", tmp_path)
    assert read.camera == camera
    np.testing.assert_allclose(read.world_from_camera, sequence.world_from_camera, atol=1e-12)
    for index in range(5):
        np.testing.assert_array_equal(read.image(index), shown[index])
        assert read.depth(index) is None
    assert read.truths == (SWEPT, TRIANGULATED)


@pytest.mark.parametrize("camera", range(4))
def test_other_cameras_are_beside_camera_0(tmp_path, camera):
    write_kitti_odometry(tmp_path, images(3), poses(3), intrinsics=INTRINSICS, camera=camera)
    read = open_sequence("kitti-odometry", tmp_path, camera=camera)
    aside = np.eye(4)
    aside[0, 3] = BASELINES_M[camera]
    np.testing.assert_allclose(read.world_from_camera, poses(3) @ aside, atol=1e-12)
    assert read.camera == Camera(64, 48, *INTRINSICS)
    found = open_sequence("kitti-odometry", tmp_path)
    np.testing.assert_array_equal(found.world_from_camera, read.world_from_camera)
    assert f"images are those of camera {camera}" in found.notes
    other = (camera + 1) % 4
    with pytest.raises(DataError, match=f"image_{other}: no such directory"):
        open_sequence("kitti-odometry", tmp_path, camera=other)


@pytest.mark.parametrize(("first", "second"), [(0, 1), (2, 3), (1, 0)])
def test_the_other_camera_of_a_pair_is_the_second_one(tmp_path, first, second):
    folder = write_kitti_odometry(tmp_path, images(3), poses(3), intrinsics=INTRINSICS, camera=first)
    assert open_sequence("kitti-odometry", tmp_path).second is None
    (folder / f"image_{second}").mkdir()
    for index in range(3):
        assert cv2.imwrite(str(folder / f"image_{second}" / f"{index:06d}.png"), images(3)[2 - index])
    other = open_sequence("kitti-odometry", tmp_path, camera=first).second
    assert other.camera == Camera(64, 48, *INTRINSICS)
    aside = np.eye(4)
    aside[0, 3] = BASELINES_M[second] - BASELINES_M[first]
    np.testing.assert_allclose(other.first_from_second, aside, atol=1e-12)
    np.testing.assert_array_equal(other.images(0), images(3)[2])
    (folder / f"image_{second}" / "000001.png").unlink()
    assert open_sequence("kitti-odometry", tmp_path, camera=first).second is None


def test_velodyne_scans_are_projected_into_the_camera(tmp_path):
    folder = write_kitti_odometry(tmp_path, images(2), poses(2), intrinsics=INTRINSICS, camera=1)
    (folder / "velodyne").mkdir()
    centre = (np.array([[31.0, 24.0], [40.0, 24.0]]) - INTRINSICS[2:]) / INTRINSICS[:2]
    in_camera1 = np.column_stack([centre * [[8.0], [5.0]], [8.0, 5.0]])
    in_camera0 = in_camera1 + np.array([BASELINES_M[1], 0.0, 0.0])
    inverse = np.linalg.inv(CAMERA0_FROM_VELODYNE)
    scan = np.zeros((2, 4), "<f4")
    scan[:, :3] = in_camera0 @ inverse[:3, :3].T + inverse[:3, 3]
    (folder / "velodyne" / "000001.bin").write_bytes(scan.tobytes())
    read = open_sequence("kitti-odometry", tmp_path, camera=1)
    assert read.depth(0) is None
    depth = read.depth(1)
    assert depth.radius_px == 1.0
    assert np.argwhere(depth.valid).tolist() == [[24, 31], [24, 40]]
    np.testing.assert_allclose(depth.depth_m[depth.valid], (8.0, 5.0), atol=1e-5)
    assert "1 of 2 frames has no depth" in read.notes


def test_poses_may_outnumber_images_and_row_i_is_of_image_i(course, tmp_path):
    for index in (0, 3):
        (course / "image_0" / f"{index:06d}.png").unlink()
    read = open_sequence("kitti-odometry", tmp_path)
    np.testing.assert_allclose(read.world_from_camera, poses(4)[1:3], atol=1e-12)
    np.testing.assert_allclose(read.timestamps_s, (0.0, 0.1036), atol=1e-9)
    np.testing.assert_array_equal(read.image(0), images(4)[1])
    assert any("4 poses" in note for note in read.notes)


def test_a_missing_image_between_others_is_named(course, tmp_path):
    (course / "image_0" / "000002.png").unlink()
    with pytest.raises(DataError, match=r"000002\.png: missing image, expected images 0 to 3 without a gap"):
        open_sequence("kitti-odometry", tmp_path)


def test_sequences_without_poses_are_excluded_with_the_reason(course, tmp_path):
    write_kitti_odometry(tmp_path, images(2), poses(2), intrinsics=INTRINSICS, name="11")
    missing = tmp_path / "poses" / "11.txt"
    missing.unlink()
    reader = KittiOdometry(tmp_path)
    assert [item.scene for item in reader.sequences()] == ["00"]
    assert reader.excluded_scenes() == {"11": f"no poses in {missing}"}
    (tmp_path / "poses" / "00.txt").unlink()
    with pytest.raises(DataError, match="2 sequences without poses, expected files such as"):
        reader.sequences()


def test_a_single_sequence_finds_its_poses_beside_or_within(course, tmp_path, monkeypatch):
    monkeypatch.chdir(course)
    assert len(open_sequence("kitti-odometry", ".")) == 4
    (tmp_path / "poses" / "00.txt").rename(course / "poses.txt")
    read = open_sequence("kitti-odometry", course)
    assert read.id.scene == "00"
    np.testing.assert_allclose(read.world_from_camera, poses(4), atol=1e-12)


def test_times_that_are_missing_or_do_not_increase_are_not_used(course, tmp_path):
    times = course / "times.txt"
    times.write_text("0\n0.1\n0.1\n0.3\n")
    read = open_sequence("kitti-odometry", tmp_path)
    assert read.timestamps_s is None
    assert f"{times}: the times do not increase, so they are not used" in read.notes
    times.unlink()
    assert f"{times}: no such file, so times are unknown" in open_sequence("kitti-odometry", tmp_path).notes


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("poses/00.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n", "1 pose, expected at least 4"),
        ("poses/00.txt", "1 0 0 0 0 1 0 0 0 0 1\n", r":1: 11 fields, expected 12"),
        ("poses/00.txt", "2 0 0 0 0 2 0 0 0 0 2 0\n" * 4, ":1: a pose whose singular values differ from 1 by 1"),
        ("sequences/00/times.txt", "0\n0.1\n", "2 times, expected at least 4"),
        ("sequences/00/calib.txt", "P1: 1 2 3\n", "no P0, expected a line of P0 and 12 numbers"),
        ("sequences/00/calib.txt", "60 61 31 24\n", "no keys, expected a line of P0 and 12 numbers, for reader kitti-"),
        ("sequences/00/calib.txt", f"P0: {row(np.ones(12))}\n", "another P0, expected fx 0 cx"),
    ],
)
def test_damaged_files_are_named_with_what_was_found(course, tmp_path, file, text, message):
    (tmp_path / file).write_text(text)
    with pytest.raises(DataError, match=f"{re.escape(str(tmp_path / file))}.*{message}"):
        open_sequence("kitti-odometry", tmp_path)


@given(st.sampled_from(["calib.txt", "times.txt", "../../poses/00.txt"]), st.binary(max_size=200))
def test_any_bytes_give_one_clear_line(tmp_path_factory, file, content):
    root = tmp_path_factory.mktemp("fuzz")
    (write_kitti_odometry(root, images(2), poses(2), intrinsics=INTRINSICS) / file).write_bytes(content)
    with suppress(TracknoiseError):
        open_sequence("kitti-odometry", root).image(0)


@pytest.mark.parametrize(("option", "value"), [("camera", 4), ("camera", -1), ("radius_px", -0.5)])
def test_impossible_options_are_named(tmp_path, option, value):
    with pytest.raises(SettingsError, match=option):
        make_reader("kitti-odometry", tmp_path, {option: value})


def test_the_real_sample_is_read(sample):
    read = open_sequence("kitti-odometry", sample("kitti_odometry"))
    assert len(read) == 30
    assert read.image(29).shape == (read.camera.height, read.camera.width) == (370, 1226)
    forward = np.diff(read.world_from_camera[:, 2, 3])
    assert np.all(forward > 0.5)
    assert np.median(np.diff(read.timestamps_s)) == pytest.approx(0.1036, abs=0.001)
